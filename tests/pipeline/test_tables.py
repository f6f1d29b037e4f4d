"""Tables in and out: exact round trip, defaults, and one sentence for each thing that can be wrong."""

from __future__ import annotations

import csv
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pliant.errors import ContractError, UserError
from pliant.records.design import Design
from pliant.records.fem import FemDataset
from pliant.tabular.fem_reading import read_table
from pliant.tabular.fem_writing import write_table

NUMBERS = ("actuation", "angle_rad", "moment_n_m", "dmoment_dp", "dmoment_du", "energy_j")
WORDS = ("branch", "status", "role")
HEAD = "pressure_pa,angle_rad,moment_n_m"


def dataset(n: int = 3, **changes: object) -> FemDataset:
    columns = {name: np.linspace(0.1, 0.7, n) / 3 for name in NUMBERS}
    words = {"branch": "constrained", "status": "ok", "role": "fit"}
    labels = {name: np.full(n, word) for name, word in words.items()}
    data = FemDataset(Design("bellow", {"wall_m": 0.0015}), "y", "pressure_pa", **columns, **labels)
    return replace(data, **changes)


def table(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "fem.csv"
    path.write_text(text, encoding="utf-8")
    return path


finite = st.floats(allow_nan=False, allow_infinity=False)
word = st.text(
    st.characters(categories=("L", "N", "P", "S"), exclude_characters="#"), min_size=1, max_size=12
)
state = st.tuples(
    finite,
    st.floats(-6.28, 6.28),
    finite,
    *[st.floats(allow_infinity=False)] * 3,
    st.sampled_from(["free", "constrained"]),
    word,
    st.sampled_from(["fit", "check"]),
)
parameters = st.dictionaries(
    st.from_regex(r"design_[a-z]{1,8}_m", fullmatch=True),
    st.one_of(finite, st.integers(-(10**6), 10**6)),
    max_size=4,
)


@settings(max_examples=150, deadline=None)
@given(
    states=st.lists(state, min_size=1, max_size=8),
    axis=st.sampled_from("xyz"),
    actuation=st.sampled_from(["pressure_pa", "tendon_force_n"]),
    design=parameters,
)
def test_what_is_written_is_read_to_the_bit(tmp_path_factory, states, axis, actuation, design) -> None:
    columns = list(zip(*states, strict=True))
    arrays = [np.array(column, float) for column in columns[:6]] + [
        np.array(column) for column in columns[6:]
    ]
    written = FemDataset(Design("bellow", design), axis, actuation, *arrays)
    path = tmp_path_factory.mktemp("tables") / "fem.csv"
    write_table(written, path)
    read = read_table(path)
    for name in NUMBERS:
        expected, got = getattr(written, name), getattr(read, name)
        np.testing.assert_array_equal(got, expected)
        np.testing.assert_array_equal(np.signbit(got), np.signbit(expected) & ~np.isnan(expected))
    for name in WORDS:
        assert getattr(read, name).tolist() == getattr(written, name).tolist()
    assert (read.axis, read.actuation_name) == (axis, actuation)
    assert {name: repr(value) for name, value in read.design.parameters.items()} == {
        name: repr(value) for name, value in design.items()
    }


def test_the_written_file_has_the_columns_of_the_contract(tmp_path: Path) -> None:
    design = Design("bellow", {"wall_m": np.float64(0.0015), "modules": 8, "shape": "round", "closed": True})
    path = tmp_path / "fem.csv"
    write_table(dataset(2, design=design, energy_j=np.array([np.nan, 1e-30])), path)
    with path.open(newline="") as file:
        first, second = csv.DictReader(file)
    assert list(first) == [
        "pressure_pa",
        "axis",
        "angle_rad",
        "moment_n_m",
        "dmoment_dp",
        "dmoment_du",
        "energy_j",
        "branch",
        "status",
        "role",
        "wall_m",
        "modules",
    ]
    assert (first["energy_j"], second["energy_j"]) == ("", "1e-30")
    assert (first["wall_m"], first["modules"]) == ("0.0015", "8")


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "fem.csv"
    path.write_text("old")

    def full(source: object, target: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError, match="disk full"):
        write_table(dataset(), path)
    assert path.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["fem.csv"]


def test_a_parameter_with_a_column_s_name_is_a_broken_contract(tmp_path: Path) -> None:
    with pytest.raises(
        ContractError, match="family 'bellow': parameter 'energy_j' has the name of a data column"
    ):
        write_table(dataset(design=Design("bellow", {"energy_j": 1.0})), tmp_path / "fem.csv")


def test_the_smallest_table_takes_the_defaults(tmp_path: Path) -> None:
    rows = "1000, 0.1,0, a,1\n# pause\n2000,0.2,-1e-3,b,2\n"
    text = f"\ufeff# from a bench\n\n{HEAD} , note, half_force_n\n{rows}"
    data = read_table(table(tmp_path, text))
    assert (data.axis, data.actuation_name, len(data)) == ("y", "pressure_pa", 2)
    assert data.branch.tolist() == ["free", "constrained"]
    assert (data.status.tolist(), data.role.tolist()) == (["ok", "ok"], ["fit", "fit"])
    assert np.isnan([data.dmoment_dp, data.dmoment_du, data.energy_j]).all()
    assert data.moment_n_m.tolist() == [0.0, -1e-3]
    assert dict(data.design.parameters) == {}


def test_blank_optional_cells_are_missing_and_constant_columns_are_the_design(tmp_path: Path) -> None:
    text = f"{HEAD},energy_j,role,wall_m,modules\n1,0.1,0,,check,0.0015,8\n2,0.2,0.1,NaN,,0.0015,8\n"
    data = read_table(table(tmp_path, text))
    assert np.isnan(data.energy_j).all()
    assert data.role.tolist() == ["check", "fit"]
    assert dict(data.design.parameters) == {"wall_m": 0.0015, "modules": 8}


GOOD = "1000,0.1,0.001"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "fem.csv: the table is empty; it needs a header such as pressure_pa"),
        ("# nothing\n\n", "the table is empty"),
        (f"{HEAD}\n", "a header and no rows"),
        (
            f"# c\npresure_pa,angle_rad,moment_n_m\n{GOOD}",
            "line 2: column 'pressure_pa' or 'tendon_force_n' is missing; the file has 'presure_pa'.",
        ),
        (f"x,angle_rad,moment_n_m\n{GOOD}", "'pressure_pa' or 'tendon_force_n' is missing.$"),
        (
            f"pressure_pa,angle_rad,moment_nm\n{GOOD}",
            "column 'moment_n_m' is missing; the file has 'moment_nm'.",
        ),
        (
            f"pressure_pa,joint_angle_rad,moment_n_m\n{GOOD}",
            "'angle_rad' is missing; the file has 'joint_angle_rad'.",
        ),
        (f"pressure_pa,half_angle_rad,moment_n_m\n{GOOD}", "twice the half-module angle"),
        (f"pressure_pa,tendon_force_n,angle_rad,moment_n_m\n1,{GOOD}", "one law has one actuation"),
        (f"{HEAD},angle_rad\n{GOOD},1", "column 'angle_rad' stands 2 times"),
        (f"{HEAD}\n{GOOD}\n1,2", "line 3: 2 cells, but the header has 3"),
        (f"{HEAD}\n0,5,0,1,0\n", "line 2: 5 cells"),
        (f"{HEAD}\n{GOOD}\n\n# c\n15 kPa,0.1,0.2", "line 5, column pressure_pa: '15 kPa' is not a number"),
        (f"{HEAD}\n1_000,0.1,0.2", "'1_000' is not a number"),
        (f"{HEAD}\n1,,0.2", "line 2, column angle_rad: it is blank"),
        (f"{HEAD}\n1,nan,0.2", "column angle_rad: 'nan' is not a finite number"),
        (f"{HEAD}\n1,0.1,-inf", "column moment_n_m: '-inf' is not a finite number"),
        (f"{HEAD},dmoment_du\n{GOOD},inf", "column dmoment_du: 'inf' is not a finite number"),
        (
            f"{HEAD}\n{GOOD}\n1,12.5,0.1",
            "line 3, column angle_rad: 12.5 rad is more than a full turn; is the column in degrees",
        ),
        (
            f"{HEAD},branch\n{GOOD},constraned",
            "'constraned' is not one of free, constrained; did you mean 'constrained'",
        ),
        (f"{HEAD},role\n{GOOD},test", "line 2, column role: 'test' is not one of fit, check"),
        (f"{HEAD},axis\n{GOOD},y\n{GOOD},w", "line 3, column axis: 'w' is not one of x, y, z"),
        (
            f"{HEAD},axis\n{GOOD},y\n{GOOD},z",
            "line 3, column axis: it is 'z' after 'y'; one table holds one axis",
        ),
    ],
)
def test_each_problem_gets_one_sentence_with_its_place(tmp_path: Path, text: str, sentence: str) -> None:
    path = table(tmp_path, text)
    with pytest.raises(UserError, match=sentence) as caught:
        read_table(path)
    assert str(caught.value).startswith(str(path))


def test_files_that_are_no_text_are_said(tmp_path: Path) -> None:
    binary = tmp_path / "fem.csv"
    binary.write_bytes(b"\x00\x01\x02pressure")
    with pytest.raises(UserError, match="not a text file"):
        read_table(binary)
    for path in (tmp_path / "absent.csv", tmp_path):
        with pytest.raises(UserError, match="the table cannot be read"):
            read_table(path)
