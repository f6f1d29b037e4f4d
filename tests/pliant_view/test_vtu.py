"""VTU files: VTK's order of nodes, the mesh's volume and the values are read back."""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from pliant.errors import MissingDependencyError
from pliant.meshing.hexahedra import cell_volumes
from pliant.records.fem import ModuleFields
from pliant_view import vtu

meshio = pytest.importorskip("meshio", reason="the extra pliant[fields]")


def curved_block() -> ModuleFields:
    """Return two cells of a bent block over a shared face, and one unused node; u is linear in the points."""
    s = np.linspace(0, 1, 3)
    z, y, x = np.meshgrid(s, s, np.linspace(0, 1, 5), indexing="ij")
    points = np.stack([(1 + z) * np.sin(x), y, (1 + z) * np.cos(x)], axis=-1).reshape(-1, 3)
    ids = np.arange(45).reshape(3, 3, 5)
    cells = np.array([ids[:, :, k : k + 3].ravel() for k in (0, 2)])
    points = np.concatenate([points, [[9.0, 9.0, 9.0]]])
    gradient = np.array([[0.1, 0.2, 0.0], [0.0, -0.1, 0.3], [0.05, 0.0, 0.2]])
    return ModuleFields(points, points @ gradient.T, cells, {"von_mises_pa": points[:, 0] ** 2})


def test_round_trip_keeps_volume_values_and_drops_loose_nodes(tmp_path: Path) -> None:
    fields = curved_block()
    vtu.write_vtu(tmp_path / "a.vtu", fields)
    read = meshio.read(tmp_path / "a.vtu")
    assert [block.type for block in read.cells] == ["hexahedron27"]
    assert len(read.points) == 45
    back = np.argsort(vtu.VTK_ORDER)
    cells = read.cells[0].data[:, back]
    np.testing.assert_array_equal(read.points[cells], fields.points_m[fields.cells])
    # a sector of angle 1 between the radii 1 and 2, of width 1
    assert cell_volumes(read.points, cells).sum() == pytest.approx(1.5, rel=2e-4)
    moved = read.points + read.point_data["displacement_m"]
    F = np.eye(3) + np.array([[0.1, 0.2, 0.0], [0.0, -0.1, 0.3], [0.05, 0.0, 0.2]])
    assert cell_volumes(moved, cells).sum() == pytest.approx(
        np.linalg.det(F) * cell_volumes(read.points, cells).sum(), rel=1e-12
    )
    np.testing.assert_array_equal(read.point_data["von_mises_pa"], read.points[:, 0] ** 2)


def test_nodes_lie_where_vtk_wants_them() -> None:
    """Mid-edge and mid-face nodes are the means of the corners that VTK's documentation names for them."""
    place = np.array([(n % 3, n // 3 % 3, n // 9) for n in range(27)]) / 2
    cell = place[vtu.vtk_cells(np.arange(27)[None])[0]]
    edges = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
    faces = ((0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4), (3, 2, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7))
    for node, corners in enumerate((*edges, *faces, range(8)), start=8):
        np.testing.assert_allclose(cell[node], cell[list(corners)].mean(axis=0))
    # right-handed: 0 → 1, 0 → 3, 0 → 4
    assert np.linalg.det(cell[[1, 3, 4]] - cell[0]) == pytest.approx(1.0)


def test_a_collection_names_times_and_files(tmp_path: Path) -> None:
    vtu.write_pvd(tmp_path / "free.pvd", [(0.0, "a&b.vtu"), (8000.0, "c.vtu")])
    sets = ET.parse(tmp_path / "free.pvd").getroot().findall("Collection/DataSet")
    assert [(float(s.get("timestep") or "nan"), s.get("file")) for s in sets] == [
        (0.0, "a&b.vtu"),
        (8000.0, "c.vtu"),
    ]


def test_without_meshio_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'pliant\[fields\]'"):
        vtu.require_meshio()
