"""Whole states of modules: what `write_table` and `write_sweep_table` wrote is read back to the bit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.pipeline.sweep_bench import opened
from tests.pipeline.test_module_tables import module

from pliant import api
from pliant.errors import UserError
from pliant.pipeline.sweep import shortened, write_sweep_table
from pliant.tabular.fem_reading import read_designs_table, read_module_table
from pliant.tabular.fem_writing import write_table

NUMBERS = (
    "actuation",
    "deformation",
    "tau",
    "dtau_dp",
    "dtau_du",
    "energy_j",
    "travel",
    "iterations",
    "wall_s",
)
WORDS = ("explored", "branch", "status", "role")
EXAMPLES = Path(__file__).parents[2] / "examples" / "data"


def same(read, written) -> None:
    for name in NUMBERS:
        np.testing.assert_array_equal(getattr(read, name), getattr(written, name), err_msg=name)
    for name in WORDS:
        assert getattr(read, name).tolist() == getattr(written, name).tolist()
    for name in ("axes", "main_axis", "joint", "actuation_name"):
        assert getattr(read, name) == getattr(written, name)


@pytest.mark.parametrize(
    ("axes", "main", "changes"),
    [
        (("y",), "y", {}),
        (("y",), "y", {"actuation_name": "tendon_force_n"}),
        (("x",), "x", {"joint": "prismatic"}),
        (("x", "y", "z"), "y", {}),
        (("x", "y", "z"), "z", {}),
    ],
)
def test_a_module_is_read_back_to_the_bit(tmp_path: Path, axes, main, changes) -> None:
    data = module(axes, main, n=16, **changes)
    data = replace(data, branch=np.where(data.explored == main, "free", "constrained"))
    path = tmp_path / "fem.csv"
    write_table(data, path)
    read = read_module_table(path)
    same(read, data)
    assert dict(read.design.parameters) == {"wall_m": 1.5e-3, "turns": 4}


def test_blank_slopes_of_axes_that_were_not_solved_stay_unknown(tmp_path: Path) -> None:
    data = module(("x", "y", "z"), "y", n=16)
    data.dtau_du[3] = np.nan
    path = tmp_path / "fem.csv"
    write_table(data, path)
    same(read_module_table(path), data)


@pytest.mark.parametrize(
    "family", ["bellow_bending", "bellow_helical", "bellow_translational", "tendon_joint"]
)
def test_the_shipped_tables_are_read_and_written_again(tmp_path: Path, family: str) -> None:
    source, copy = EXAMPLES / f"{family}.csv", tmp_path / "copy.csv"
    data = read_module_table(source)
    write_table(data, copy)
    same(read_module_table(copy), data)
    assert copy.read_text() == source.read_text()


def test_a_sweep_is_read_back_design_by_design(tmp_path: Path) -> None:
    run = api.sweep(opened(tmp_path, "{radius: [5 mm, 6 mm], length: [9 mm, 11 mm]}"), workers=1)
    path = tmp_path / "sweep.csv"
    write_sweep_table(run, path)
    written = [data for _, data in run.data()]
    read = read_designs_table(path)
    assert len(read) == len(written) == 4
    for one, other in zip(read, written, strict=True):
        same(one, other)
        numbers = {k: v for k, v in other.design.parameters.items() if not isinstance(v, str)}
        assert one.design.parameters == numbers


def test_a_table_with_fewer_digits_has_the_same_states(tmp_path: Path) -> None:
    run = api.sweep(opened(tmp_path, "{radius: [5 mm, 6 mm]}"), workers=1)
    whole, short = tmp_path / "whole.csv", tmp_path / "short.csv"
    write_sweep_table(run, whole)
    write_sweep_table(run, short, digits=5)
    for one, other in zip(read_designs_table(short), read_designs_table(whole), strict=True):
        np.testing.assert_allclose(one.tau, other.tau, rtol=1e-4)
        assert (one.status.tolist(), one.branch.tolist()) == (other.status.tolist(), other.branch.tolist())
    assert len(short.read_text()) < len(whole.read_text())


@pytest.mark.parametrize(
    ("cell", "short"),
    [
        ("1234.56789012345", "1234.6"),
        ("ok", "ok"),
        ("-120000", "-120000"),
        ("", ""),
        ("1e-9", "1e-09"),
        ("nan", "nan"),
    ],
)
def test_numbers_are_shortened_and_words_kept(cell: str, short: str) -> None:
    assert shortened(cell, 5) == short


def test_designs_without_numbers_are_told_apart_by_their_parameters(tmp_path: Path) -> None:
    path = tmp_path / "two.csv"
    rows = [f"{p},{u},{p * 1e-6 - u * r},{r}" for r in (0.02, 0.03) for p in (0.0, 1e4) for u in (0.0, 0.1)]
    path.write_text("pressure_pa,angle_rad,moment_n_m,wall_m\n" + "\n".join(rows) + "\n")
    read = read_designs_table(path)
    assert [dict(data.design.parameters) for data in read] == [{"wall_m": 0.02}, {"wall_m": 0.03}]
    assert [len(data) for data in read] == [4, 4]


def test_rows_that_no_design_owns_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "wrong.csv"
    path.write_text("pressure_pa,angle_rad,moment_n_m,sample\n0,0,0,1\n0,0.1,0,2\n")
    with pytest.raises(UserError, match="every row is a design of its own; a column 'design'"):
        read_designs_table(path)
    path.write_text("pressure_pa,angle_rad,moment_n_m,design\n0,0,0,1\n0,0.1,0,\n")
    with pytest.raises(UserError, match="line 3, column design: it is blank"):
        read_designs_table(path)


def test_several_axes_without_the_columns_of_all_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "axes.csv"
    path.write_text("pressure_pa,axis,angle_rad,moment_n_m\n0,y,0,0\n0,x,0.1,0.1\n")
    with pytest.raises(UserError, match=r"line 3, column axis: .*angle_x_rad"):
        read_module_table(path)
