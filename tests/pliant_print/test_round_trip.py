"""The printed solid, meshed again by Netgen and read as a mesh file, has the volume and the answers of the FEM."""

from __future__ import annotations

from pathlib import Path

import pytest
from benchmarks.print.round_trip import BELLOW, PRESSURES_PA, again, differences, figures, quarter_stl

from pliant.meshing.cells import cell_volumes

pytest.importorskip("netgen")


def test_a_quarter_of_the_printed_module_is_a_mesh_file_again(tmp_path: Path) -> None:
    quarter = quarter_stl(BELLOW, tmp_path / "quarter.stl")
    mesh = again(BELLOW, 1.5, None, tmp_path).problem().mesh
    own = BELLOW.problem().mesh
    assert cell_volumes(mesh.nodes_m, mesh.cells).sum() == pytest.approx(quarter, rel=2e-3)
    assert quarter == pytest.approx(cell_volumes(own.nodes_m, own.cells).sum(), rel=5e-3)


@pytest.mark.slow
def test_a_coarse_round_trip_is_within_three_percent(tmp_path: Path) -> None:
    """The benchmark's fine mesh is within 1 %; this one is made in seconds."""
    printed = figures(again(BELLOW, 1.5, None, tmp_path), PRESSURES_PA)
    found = differences(printed, figures(BELLOW, PRESSURES_PA))
    assert abs(found["free_angle"]) < 0.02 and abs(found["torque"]) < 0.01 and abs(found["slope"]) < 0.03
