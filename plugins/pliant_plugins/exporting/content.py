"""Content that all file formats share: the law's stiffness at rest and surfaces as OBJ files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.shape import Shape, TriangleMesh

THE_LAW = (
    " Written by Pliant. The joint law is not in this file: stiffness is that of the law at rest without actuation. "
    "The law is in the JSON file beside it. SI units. PyBullet takes the inertias of this file with "
    "flags=URDF_USE_INERTIA_FROM_FILE alone. "
)
WITHOUT_FORM = ("The law is in the JSON file beside it.", "It has no form that other languages can take.")


def stiffness_at_rest(chain: ChainModel) -> Array:
    """Return (n, a, a) −∂τ/∂u of every joint without actuation and deformation, all actuators together."""
    a = len(chain.axes)
    of_law = [law.evaluate(law.unactuated(1), np.zeros((1, a))).dtau_du[0] for law in chain.laws]
    found = []
    for joint in chain.joints:
        acting = slice(*chain.actuator_range(joint))
        turns = [actuator.turn(a) for actuator in chain.actuators[acting]]
        if len(chain.laws[joint.law].actuations) > 1:
            turns = turns[:1]  # one law of all of them
        found.append(-sum(turn @ of_law[joint.law] @ turn.T for turn in turns))
    return np.array(found)


class SurfaceFiles:
    """Mesh files in the folder `<name>_meshes` next to the file `path`: each distinct mesh once."""

    def __init__(self, path: Path) -> None:
        self.folder = path.with_name(f"{path.stem}_meshes")
        self.written: list[Path] = []
        self._known: dict[bytes, Path] = {}

    def file(self, mesh: TriangleMesh) -> Path:
        """Return the file of a mesh, written on first use."""
        content = mesh.vertices_m.tobytes() + mesh.faces.tobytes()
        if content not in self._known:
            path = self.folder / f"surface_{len(self._known) + 1}.obj"
            self.folder.mkdir(exist_ok=True)
            lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices_m.tolist()]
            lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces.tolist()]
            path.write_text("\n".join(lines) + "\n", encoding="utf-8")
            self._known[content] = path
            self.written.append(path)
        return self._known[content]


def body_shapes(chain: ChainModel | None, body: int) -> tuple[Shape, ...]:
    """Return the shapes on a body, if the chain has any."""
    return chain.shapes[body] if chain is not None and chain.shapes else ()
