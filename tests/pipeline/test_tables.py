"""FEM tables, read and written: exact round trips of every shape, and the written text."""

from __future__ import annotations

import csv
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.pliant_designs.sweep_bench import opened

from pliant import api
from pliant.errors import ContractError, UserError
from pliant.fem_tables.reading import read_designs_table, read_module_table, read_table
from pliant.fem_tables.writing import write_table
from pliant.records.design import Design
from pliant.records.fem import FemDataset, ModuleData
from pliant.records.law import EXTENSIBLE_AXES, EXTENSION
from pliant.units import BEYOND
from pliant_designs.sweep_table import shortened, write_sweep_table

EXAMPLES = Path(__file__).parents[2] / "examples" / "data"
NUMBERS = ("actuation", "angle_rad", "moment_n_m", "dmoment_dp", "dmoment_du", "energy_j")
OF_MODULES = (
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
WORDS = ("branch", "status", "role")
XYZ = ("x", "y", "z")


def same(read, written) -> None:
    """Check that two data sets of one axis, or of whole modules, are equal to the bit."""
    whole = isinstance(written, ModuleData)
    for name in OF_MODULES if whole else NUMBERS:
        np.testing.assert_array_equal(getattr(read, name), getattr(written, name), err_msg=name)
    for name in (*WORDS, "explored") if whole else WORDS:
        assert getattr(read, name).tolist() == getattr(written, name).tolist()
    for name in ("axes", "main_axis", "joint", "actuation_name") if whole else ("axis", "joint"):
        assert getattr(read, name) == getattr(written, name)


def module(axes: tuple[str, ...], main: str, n: int = 16, seed: int = 0, **changes: object) -> ModuleData:
    """Return states with random numbers; slopes symmetric and definite."""
    random, k = np.random.default_rng(seed), len(axes)
    root = random.normal(size=(n, k, k))
    explored = (main, *axes, *(("coupling",) if k > 1 else ()))
    data = ModuleData(
        design=Design("helix", {"wall_m": 1.5e-3, "turns": 4, "shape": "round"}),
        joint={1: "revolute", 3: "spherical", 4: "extensible"}[k],
        axes=axes,
        main_axis=main,
        actuation_name="pressure_pa",
        actuation=random.uniform(0, 15e3, n),
        deformation=random.normal(size=(n, k)),
        tau=random.normal(size=(n, k)),
        dtau_dp=random.normal(size=(n, k)),
        dtau_du=-root @ np.swapaxes(root, 1, 2) - 0.1 * np.eye(k),
        energy_j=random.uniform(size=n),
        travel=random.uniform(size=n),
        iterations=np.arange(n),
        wall_s=random.uniform(size=n),
        explored=np.array([explored[i % (k + 1)] for i in range(n)]),
        branch=np.array(["free", "constrained"] * (n // 2)),
        status=np.array(["ok"] * n),
        role=np.array(["fit", "fit", "check", "fit"] * (n // 4)),
    )
    return replace(data, **changes)


def dataset(n: int = 3, **changes: object) -> FemDataset:
    columns = {name: np.linspace(0.1, 0.7, n) / 3 for name in NUMBERS}
    words = {"branch": "constrained", "status": "ok", "role": "fit"}
    labels = {name: np.full(n, word) for name, word in words.items()}
    return replace(
        FemDataset(Design("bellow", {"wall_m": 0.0015}), "y", "pressure_pa", **columns, **labels), **changes
    )


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


# Values of quantities: none is larger, and smaller ones are read as zero.
finite = st.floats(-BEYOND, BEYOND).filter(lambda value: value == 0.0 or abs(value) >= 1 / BEYOND)
word = st.text(
    st.characters(categories=("L", "N", "P", "S"), exclude_characters="#"), min_size=1, max_size=12
)
branches, roles = st.sampled_from(["free", "constrained"]), st.sampled_from(["fit", "check"])
unknown = [finite | st.just(float("nan"))] * 3
angle = st.floats(-6.28, 6.28).filter(lambda value: value == 0.0 or abs(value) >= 1 / BEYOND)
state = st.tuples(finite, angle, finite, *unknown, branches, word, roles)
names = st.from_regex(r"design_[a-z]{1,8}_m", fullmatch=True)
parameters = st.dictionaries(names, st.one_of(finite, st.integers(-(10**6), 10**6)), max_size=4)


@settings(max_examples=40, deadline=None)
@given(
    states=st.lists(state, min_size=1, max_size=8),
    axis=st.sampled_from("xyz"),
    actuation=st.sampled_from(["pressure_pa", "tendon_force_n"]),
    design=parameters,
)
def test_what_is_written_is_read_to_the_bit(tmp_path_factory, states, axis, actuation, design) -> None:
    columns = list(zip(*states, strict=True))
    arrays = [np.array(c, float) for c in columns[:6]] + [np.array(c) for c in columns[6:]]
    written = FemDataset(Design("bellow", design), axis, actuation, *arrays)
    path = tmp_path_factory.mktemp("tables") / "fem.csv"
    write_table(written, path)
    read = read_table(path)
    same(read, written)
    for name in NUMBERS:
        expected, got = getattr(written, name), getattr(read, name)
        np.testing.assert_array_equal(np.signbit(got), np.signbit(expected) & ~np.isnan(expected))
    assert read.actuation_name == actuation
    assert {k: repr(v) for k, v in read.design.parameters.items()} == {k: repr(v) for k, v in design.items()}


@pytest.mark.parametrize(
    ("axes", "main", "changes"),
    [
        (("y",), "y", {}),
        (("y",), "y", {"actuation_name": "tendon_force_n"}),
        (("x",), "x", {"joint": "prismatic"}),
        (XYZ, "y", {}),
        (XYZ, "z", {}),
        (EXTENSIBLE_AXES, "y", {"joint": "extensible"}),
    ],
)
def test_a_module_and_each_axis_are_read_back_to_the_bit(tmp_path: Path, axes, main, changes) -> None:
    data = module(axes, main, **changes)
    data = replace(data, branch=np.where(data.explored == main, "free", "constrained"))
    data.dtau_du[3] = np.nan if len(axes) > 1 else data.dtau_du[3]  # slopes that were not solved stay unknown
    path = tmp_path / "fem.csv"
    write_table(data, path)
    same(read_module_table(path), data)
    assert dict(read_module_table(path).design.parameters) == {"wall_m": 1.5e-3, "turns": 4}
    for axis in axes:
        joint = data.joint if len(axes) == 1 else "revolute"
        if axis != EXTENSION:  # a travel's data set has separate columns
            same(read_table(path, axis), replace(data.axis(axis), joint=joint))


@pytest.mark.parametrize("axes", [("y",), XYZ, EXTENSIBLE_AXES])
@pytest.mark.parametrize(
    "name", ["pressure_1_pa, pressure_2_pa", "pressure_2_pa, pressure_7_pa, tendon_force_n"]
)
def test_a_module_with_several_inputs_is_read_back_to_the_bit(tmp_path: Path, axes, name: str) -> None:
    data, random, m = module(axes, "y"), np.random.default_rng(3), name.count(",") + 1
    n, k = len(data), len(axes)
    data = replace(
        data,
        actuation_name=name,
        actuation=random.uniform(0, 15e3, (n, m)),
        dtau_dp=random.normal(size=(n, k, m)),
        travel=random.uniform(size=(n, m)),
        branch=np.where(data.explored == "y", "free", "constrained"),
    )
    path = tmp_path / "fem.csv"
    write_table(data, path)
    same(read_module_table(path), data)
    assert dict(read_module_table(path).design.parameters) == {"wall_m": 1.5e-3, "turns": 4}
    for one in read_designs_table(path):
        same(one, data)
    with pytest.raises(UserError, match=f"driven by {name}.*give the table as 'data' of the whole law"):
        read_table(path, "y")


def test_nothing_on_several_axes_is_lost(tmp_path: Path) -> None:
    data, path = module(XYZ, "y"), tmp_path / "fem.csv"
    write_table(data, path)
    for i, row in enumerate(rows(path)):
        for a, axis in enumerate(data.axes):
            assert float(row[f"angle_{axis}_rad"]) == data.deformation[i, a]
            assert float(row[f"moment_{axis}_n_m"]) == data.tau[i, a]
            assert float(row[f"dmoment_{axis}_dp"]) == data.dtau_dp[i, a]
            for b, other in enumerate(data.axes):
                assert float(row[f"dmoment_{axis}_du_{other}"]) == data.dtau_du[i, a, b]
        assert float(row["volume_change_m3"]) == data.travel[i]
        assert row["axis"] == ("all" if data.explored[i] == "coupling" else data.explored[i])
        assert (row["iterations"], row["wall_m"], row["turns"]) == (str(i), "0.0015", "4")


@pytest.mark.parametrize(
    ("data", "header"),
    [
        (
            dataset(),
            "pressure_pa axis angle_rad moment_n_m dmoment_dp dmoment_du energy_j branch status role wall_m",
        ),
        (
            module(("y",), "y"),
            "pressure_pa axis angle_rad moment_n_m dmoment_dp dmoment_du energy_j branch status role "
            "volume_change_m3 iterations wall_s wall_m turns",
        ),
        (
            module(("x",), "x", joint="prismatic", actuation_name="tendon_force_n"),
            "tendon_force_n axis extension_m force_n dforce_dp dforce_du energy_j branch status role "
            "tendon_travel_m iterations wall_s wall_m turns",
        ),
    ],
)
def test_the_written_file_has_the_contract_columns(tmp_path: Path, data, header: str) -> None:
    path = tmp_path / "fem.csv"
    write_table(data, path)
    assert list(rows(path)[0]) == header.split()


def test_unknown_numbers_are_blank_and_only_numbers_are_parameters(tmp_path: Path) -> None:
    design = Design("bellow", {"wall_m": np.float64(0.0015), "modules": 8, "shape": "round", "closed": True})
    write_table(dataset(2, design=design, energy_j=np.array([np.nan, 1e-30])), tmp_path / "fem.csv")
    first, second = rows(tmp_path / "fem.csv")
    assert (first["energy_j"], second["energy_j"]) == ("", "1e-30")
    assert list(first.items())[-2:] == [("wall_m", "0.0015"), ("modules", "8")]
    with pytest.raises(ContractError, match="'energy_j' has the name of a data column"):
        write_table(dataset(design=Design("bellow", {"energy_j": 1.0})), tmp_path / "fem.csv")


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "fem.csv"
    path.write_text("old")

    def full(source: object, target: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError, match="disk full"):
        write_table(dataset(), path)
    assert path.read_text() == "old" and [entry.name for entry in tmp_path.iterdir()] == ["fem.csv"]


FAMILIES = ["bellow_bending", "bellow_helical", "bellow_translational", "tendon_joint"]


@pytest.mark.parametrize("family", FAMILIES)
def test_the_shipped_tables_are_read_and_written_again(tmp_path: Path, family: str) -> None:
    source, copy = EXAMPLES / f"{family}.csv", tmp_path / "copy.csv"
    data = read_module_table(source)
    write_table(data, copy)
    same(read_module_table(copy), data)
    assert copy.read_text() == source.read_text()


def test_a_sweep_is_read_back_design_by_design(tmp_path: Path) -> None:
    run = api.sweep(opened(tmp_path, "{radius: [5 mm, 6 mm], length: [9 mm, 11 mm]}"), workers=1)
    path, short = tmp_path / "sweep.csv", tmp_path / "short.csv"
    write_sweep_table(run, path)
    write_sweep_table(run, short, digits=5)
    written, read = [data for _, data in run.data()], read_designs_table(path)
    assert len(read) == len(written) == 4
    for one, other, brief in zip(read, written, read_designs_table(short), strict=True):
        same(one, other)
        numbers = {k: v for k, v in other.design.parameters.items() if not isinstance(v, str)}
        rubber = {k: v for k, v in one.design.parameters.items() if k.startswith("material.")}
        assert one.design.parameters == numbers | rubber
        assert rubber["material.kind"] == "neo_hookean" and rubber["material.shear_modulus_pa"] == 240e3
        np.testing.assert_allclose(brief.tau, other.tau, rtol=1e-4)
        assert brief.branch.tolist() == other.branch.tolist()
    assert len(short.read_text()) < len(path.read_text())
    cells = {"1234.56789012345": "1234.6", "ok": "ok", "-120000": "-120000", "": "", "1e-9": "1e-09"}
    assert {cell: shortened(cell, 5) for cell in cells} == cells


def test_designs_without_numbers_are_told_apart_by_their_parameters(tmp_path: Path) -> None:
    path = tmp_path / "two.csv"
    lines = [f"{p},{u},{p * 1e-6 - u * r},{r}" for r in (0.02, 0.03) for p in (0.0, 1e4) for u in (0.0, 0.1)]
    path.write_text("pressure_pa,angle_rad,moment_n_m,wall_m\n" + "\n".join(lines) + "\n")
    read = read_designs_table(path)
    assert [(dict(data.design.parameters), len(data)) for data in read] == [
        ({"wall_m": 0.02}, 4),
        ({"wall_m": 0.03}, 4),
    ]
