"""STL files, binary and text: triangles without a unit."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant.records.shape import TriangleMesh
from pliant.regular_files import require_there

HEAD = 84  # bytes before the triangles of a binary file
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(path: Path, scale: float = 1.0) -> TriangleMesh:
    """Return the triangles of a file with equal corners merged; its lengths times `scale` are metres.

    Raises:
        UserError: the file does not exist, is not an STL, or has no triangles.
    """
    require_there(path, f"surface '{path}'")
    raw = path.read_bytes()
    corners = _binary(raw)
    if corners is None:
        corners = _text(raw)
    if corners is None:
        raise UserError(f"surface '{path.name}' is no STL file, neither binary nor text.")
    if not np.all(np.isfinite(corners)):
        raise UserError(f"surface '{path.name}' holds corners that are no numbers.")
    points, ids = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    faces: IntArray = ids.reshape(-1, 3).astype(np.int64)
    real = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    if not np.any(real):
        raise UserError(f"surface '{path.name}' holds no triangles.")
    return TriangleMesh(scale * points, faces[real])


def write_stl(surface: TriangleMesh, path: Path, scale: float = 1.0) -> None:
    """Write a binary file; its lengths are metres times `scale` (1000 for programs that read millimetres)."""
    records = np.zeros(len(surface.faces), TRIANGLE)
    corners = scale * surface.vertices_m[surface.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    records["normal"] = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    records["corners"] = corners
    head = b"binary STL written by Pliant".ljust(80) + np.uint32(len(records)).tobytes()
    path.write_bytes(head + records.tobytes())


def _binary(raw: bytes) -> Array | None:
    """Return corners (n, 3, 3) of a binary file; None if its length does not match the count."""
    if len(raw) < HEAD:
        return None
    count = int(np.frombuffer(raw, "<u4", 1, 80)[0])
    if len(raw) != HEAD + count * TRIANGLE.itemsize:
        return None
    return np.asarray(np.frombuffer(raw, TRIANGLE, count, HEAD)["corners"], float)


def _text(raw: bytes) -> Array | None:
    """Return corners (n, 3, 3) of a text file; None if it is not a text STL."""
    if raw.lstrip()[:5].lower() != b"solid":
        return None
    words = [line.split() for line in raw.decode("utf-8", errors="replace").splitlines()]
    try:
        corners = [[float(x) for x in line[1:4]] for line in words if line and line[0].lower() == "vertex"]
        return np.array(corners, float).reshape(-1, 3, 3)
    except ValueError:
        return None
