"""Inner edges are found where a skin turns inward sharply, and Netgen's cells are smaller there."""

from pathlib import Path

import numpy as np
import pytest

from pliant.errors import UserError
from pliant_plugins.families.mesh_file.netgen import inner_edges, mesh_cad, outer_skin


def length(ends: np.ndarray) -> float:
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())


def test_a_notch_has_one_and_a_convex_body_none() -> None:
    # a chevron, 1 high: its notch is the edge over (0, 0)
    outline = np.array([(0.0, 0.0), (1.0, 1.0), (0.0, -1.0), (-1.0, 1.0)])
    points = np.vstack([np.column_stack([outline, np.full(4, z)]) for z in (0.0, 1.0)])
    sides = [(b, a, a + 4, b, a + 4, b + 4) for a, b in ((0, 1), (1, 2), (2, 3), (3, 0))]
    caps = [(0, 1, 2), (0, 2, 3), (4, 6, 5), (4, 7, 6)]
    triangles = np.array([*caps, *np.reshape(sides, (-1, 3)).tolist()])
    found = inner_edges(points, triangles)
    assert found[:, :, :2].tolist() == [[[0, 0], [0, 0]]]
    assert length(found) == 1
    turned = triangles[:, ::-1]
    assert len(inner_edges(points, turned)) > 1  # inside out, the other edges are inner ones


def test_the_hollow_in_a_body_with_two_volumes(tmp_path: Path) -> None:
    occ = pytest.importorskip("netgen.occ", reason="the extra pliant[ngsolve]")

    def box(low: tuple[float, ...], high: tuple[float, ...]):
        return occ.Box(occ.Pnt(*low), occ.Pnt(*high))

    body = box((0, 0, 1), (6, 4, 5)) - box((0, 0, 2), (6, 2, 4))  # a channel along x, open at y = 0
    solid = occ.Glue([body, box((0, 0, 0), (6, 4, 1))])
    mesh = occ.OCCGeometry(solid).GenerateMesh(maxh=2)
    assert length(inner_edges(*outer_skin(mesh))) == pytest.approx(2 * 6)

    def name(points: np.ndarray) -> str:
        return "wall" if points[:, 0].max() < 1e-9 else "outside"

    sizes = {}
    for inner in (None, 0.25):
        path = mesh_cad(solid, tmp_path / "notch.msh", 2.0, name, inner=inner)
        sizes[inner] = path.read_text().count("\n")
    assert sizes[0.25] > 4 * sizes[None]
    with pytest.raises(UserError, match=r"inner = 3: .* at most 2"):
        mesh_cad(solid, tmp_path / "notch.msh", 2.0, name, inner=3)
