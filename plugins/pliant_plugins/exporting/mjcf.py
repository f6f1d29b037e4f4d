"""A chain as MJCF: surfaces to look at, shapes that collide, joints with the law's stiffness at rest."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Comment, Element, SubElement, indent, tostring

import numpy as np

from pliant.mechanics.rotations import quaternion_of_matrix
from pliant.records.chain import ChainModel
from pliant.records.shape import Shape
from pliant_plugins.exporting.stiffness import THE_LAW, stiffness_at_rest
from pliant_plugins.exporting.surfaces import SurfaceFiles, shapes_of
from pliant_plugins.physics.mujoco.mjcf import add_chain, document, text

SEEN, TOUCHED = "2", "3"  # MuJoCo's usual groups: visuals are shown, collision shapes are not


def write_mjcf(
    chain: ChainModel, path: Path, looks: ChainModel | None = None, damping: float = 0.0
) -> tuple[Path, ...]:
    """Bodies `base`, `body_1`…`body_n`, `tip`, joints `joint_1`…`joint_n` with viscous `damping`.

    A ball joint of MuJoCo has one stiffness: the mean of the law's three. The chain does not collide with itself.
    """
    surfaces = SurfaceFiles(path)
    root = document("chain")
    root.insert(0, Comment(THE_LAW))
    SubElement(root, "option", integrator="implicitfast", gravity=text(chain.gravity_m_s2))
    assets = _Assets(SubElement(root, "asset"), surfaces, path.parent)
    bodies = add_chain(SubElement(root, "worldbody"), chain)
    for number, body in enumerate(bodies):
        for shape in shapes_of(looks, number):
            _add_geom(body, shape, assets, group=SEEN, contype="0", conaffinity="0")
        for shape in shapes_of(chain, number):
            _add_geom(body, shape, assets, group=TOUCHED, contype="1", conaffinity="0")
    joints = [joint for body in bodies for joint in body.findall("joint")]
    for number, (joint, stiffness) in enumerate(zip(joints, stiffness_at_rest(chain), strict=True), start=1):
        joint.set("name", f"joint_{number}")
        joint.set("stiffness", repr(float(np.mean(np.diag(stiffness)))))
        joint.set("damping", repr(damping))
    indent(root)
    path.write_text(tostring(root, encoding="unicode") + "\n", encoding="utf-8")
    return (path, *surfaces.written)


class _Assets:
    """Mesh assets by file."""

    def __init__(self, parent: Element, surfaces: SurfaceFiles, start: Path) -> None:
        self._parent, self._surfaces, self._start = parent, surfaces, start
        self._known: set[str] = set()

    def name(self, shape: Shape) -> str:
        assert shape.mesh is not None
        path = self._surfaces.file(shape.mesh)
        if path.stem not in self._known:
            self._known.add(path.stem)
            # A half module is open where it meets its other half: as a shell it needs no volume.
            file = path.relative_to(self._start).as_posix()
            SubElement(self._parent, "mesh", name=path.stem, file=file, inertia="shell")
        return path.stem


def _add_geom(body: Element, shape: Shape, assets: _Assets, **how: str) -> None:
    quaternion = text(quaternion_of_matrix(np.asarray(shape.rotation, float)))
    place = {"pos": text(shape.position_m), "quat": quaternion}
    geom = SubElement(body, "geom", {"type": shape.kind, **place, "mass": "0", **how})
    if shape.mesh is None:
        geom.set("size", text(shape.size_m))
    else:
        geom.set("mesh", assets.name(shape))
