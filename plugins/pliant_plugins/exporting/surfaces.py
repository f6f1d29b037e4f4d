"""Surfaces of a chain as OBJ files: each distinct mesh once, however many bodies wear it."""

from __future__ import annotations

from pathlib import Path

from pliant.records.chain import ChainModel
from pliant.records.shape import Shape, TriangleMesh


class SurfaceFiles:
    """Files in the folder `<name>_meshes` beside the file `path`."""

    def __init__(self, path: Path) -> None:
        self.folder = path.with_name(f"{path.stem}_meshes")
        self.written: list[Path] = []
        self._known: dict[bytes, Path] = {}

    def file(self, mesh: TriangleMesh) -> Path:
        """The file of a mesh, written when it is first asked for."""
        content = mesh.vertices_m.tobytes() + mesh.faces.tobytes()
        if content not in self._known:
            path = self.folder / f"surface_{len(self._known) + 1}.obj"
            self.folder.mkdir(exist_ok=True)
            write_obj(path, mesh)
            self._known[content] = path
            self.written.append(path)
        return self._known[content]


def write_obj(path: Path, mesh: TriangleMesh) -> None:
    """A mesh as OBJ, in metres."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices_m.tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces.tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def shapes_of(chain: ChainModel | None, body: int) -> tuple[Shape, ...]:
    """The shapes on a body, if the chain has any."""
    return chain.shapes[body] if chain is not None and chain.shapes else ()
