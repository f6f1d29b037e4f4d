"""The tables of examples/designs can be read as the designs of the studies in the same folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pliant import api
from pliant.errors import InvalidDesignError
from pliant.fem_tables.reading import read_designs_table
from pliant.records.fem import SELF_CONTACT, TRUSTED
from pliant_designs.sweep_designs import sweep_designs

DESIGNS = Path(__file__).parents[2] / "examples/designs"
TABLES = {"bending_grid": 56, "bending_test": 24, "helical_grid": 25, "helical_test": 8}
SWEPT = ("inner_radius_m", "average_radius_m", "module_length_m")


@pytest.mark.parametrize("name", TABLES)
def test_a_table_has_its_study_designs(name: str, tmp_path: Path) -> None:
    opened = api.open_study(DESIGNS / "fem" / f"{name}.yaml", store=tmp_path)
    possible = []
    for design in sweep_designs(opened.study):
        try:
            opened.context.build("family", design.family)
        except InvalidDesignError:
            continue
        possible.append([design.parameters[parameter] for parameter in SWEPT])
    found = [
        [data.design.parameters[p] for p in SWEPT] for data in read_designs_table(DESIGNS / f"{name}.csv")
    ]
    assert len(found) == TABLES[name]
    np.testing.assert_allclose(sorted(found), sorted(possible), rtol=1e-8)


@pytest.mark.parametrize("name", TABLES)
def test_states_in_a_table_are_sound(name: str) -> None:
    for data in read_designs_table(DESIGNS / f"{name}.csv"):
        free = data.branch == "free"
        main = data.axes.index(data.main_axis)
        assert (
            np.isin(data.status, (*TRUSTED, SELF_CONTACT)).all() and np.isin(data.status, TRUSTED).sum() >= 12
        )
        assert np.sum(data.role == "check") >= 8
        assert np.abs(data.tau[free]).max() < 1e-6 * np.ptp(data.tau[:, main])
        assert np.all(data.dtau_du[np.isin(data.status, TRUSTED), main, main] < 0)
