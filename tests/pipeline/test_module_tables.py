"""Tables of the FEM stage: all axes and prismatic joints in, the same law out."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pliant.errors import UserError
from pliant.records.design import Design
from pliant.records.fem import FemDataset, ModuleData
from pliant.tabular.fem_reading import read_table
from pliant.tabular.fem_writing import write_table

COLUMNS = ("actuation", "angle_rad", "moment_n_m", "dmoment_dp", "dmoment_du", "energy_j")
WORDS = ("branch", "status", "role")


def module(axes: tuple[str, ...], main: str, n: int = 8, seed: int = 0, **changes: object) -> ModuleData:
    """States with random numbers; slopes symmetric and definite."""
    random, k = np.random.default_rng(seed), len(axes)
    root = random.normal(size=(n, k, k))
    data = ModuleData(
        design=Design("helix", {"wall_m": 1.5e-3, "turns": 4, "shape": "round"}),
        joint="spherical" if k > 1 else "revolute",
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
        explored=np.array([(main, *axes, *(("coupling",) if k > 1 else ()))[i % (k + 1)] for i in range(n)]),
        branch=np.array(["free", "constrained"] * (n // 2)),
        status=np.array(["ok"] * n),
        role=np.array(["fit", "fit", "check", "fit"] * (n // 4)),
    )
    return replace(data, **changes)


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def same(read: FemDataset, written: FemDataset) -> None:
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(read, name), getattr(written, name))
    for name in WORDS:
        assert getattr(read, name).tolist() == getattr(written, name).tolist()
    assert (read.axis, read.joint) == (written.axis, written.joint)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), axis=st.sampled_from("xyz"))
def test_each_axis_of_a_table_is_read_back_to_the_bit(tmp_path_factory, seed, axis) -> None:
    data = module(("x", "y", "z"), "y", n=16, seed=seed)
    path = tmp_path_factory.mktemp("tables") / "fem.csv"
    write_table(data, path)
    same(read_table(path, axis), replace(data.axis(axis), joint="revolute"))


def test_nothing_of_several_axes_is_lost(tmp_path: Path) -> None:
    data = module(("x", "y", "z"), "y")
    path = tmp_path / "fem.csv"
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


def test_a_module_of_one_axis_has_the_columns_of_the_contract(tmp_path: Path) -> None:
    path = tmp_path / "fem.csv"
    data = module(("y",), "y")
    write_table(data, path)
    assert list(rows(path)[0]) == [
        *("pressure_pa", "axis", "angle_rad", "moment_n_m", "dmoment_dp", "dmoment_du", "energy_j"),
        *("branch", "status", "role", "volume_change_m3", "iterations", "wall_s", "wall_m", "turns"),
    ]
    same(read_table(path), data.axis("y"))
    assert dict(read_table(path).design.parameters) == {"wall_m": 1.5e-3, "turns": 4}


def test_a_tendon_s_travel_has_its_own_name(tmp_path: Path) -> None:
    path = tmp_path / "fem.csv"
    write_table(module(("y",), "y", actuation_name="tendon_force_n"), path)
    assert {"tendon_force_n", "tendon_travel_m"} <= set(rows(path)[0])


def test_a_prismatic_joint_has_extension_and_force(tmp_path: Path) -> None:
    path = tmp_path / "fem.csv"
    data = module(("x",), "x", joint="prismatic")
    write_table(data, path)
    header = list(rows(path)[0])
    assert header[2:6] == ["extension_m", "force_n", "dforce_dp", "dforce_du"]
    assert "angle_rad" not in header
    same(read_table(path), data.axis("x"))
    write_table(data.axis("x"), path)
    same(read_table(path), data.axis("x"))


def test_a_prismatic_table_from_elsewhere_needs_only_its_two_columns(tmp_path: Path) -> None:
    path = tmp_path / "bench.csv"
    path.write_text("pressure_pa,extension_m,force_n\n0,0,0\n1000,7.5,0.2\n")
    data = read_table(path)
    assert (data.axis, data.joint) == ("x", "prismatic")
    assert data.angle_rad.tolist() == [0.0, 7.5]  # metres: no full turn ends them
    assert data.branch.tolist() == ["free", "constrained"]
    path.write_text("pressure_pa,extension_m,moment_n_m\n0,0,0\n")
    with pytest.raises(UserError, match="line 1: column 'force_n' is missing"):
        read_table(path)


def test_which_axis_to_read_is_asked_or_said(tmp_path: Path) -> None:
    path = tmp_path / "fem.csv"
    write_table(module(("x", "y", "z"), "y", n=16), path)
    with pytest.raises(
        UserError, match="one table holds one axis here; give a spherical joint this table for each of 'axes"
    ):
        read_table(path)
    head = "pressure_pa,angle_rad,moment_n_m,axis\n"
    path.write_text(head + "1,0.1,0.2,y\n1,0.1,0.2,x\n")
    with pytest.raises(UserError, match="no state explores axis z, only y, x"):
        read_table(path, "z")
    path.write_text(head + "1,0.1,0.2,z\n1,0.1,0.2,all\n")
    assert read_table(path, "x").axis == "z"
    assert len(read_table(path)) == 1
    path.write_text(head + "1,0.1,0.2,all\n")
    with pytest.raises(UserError, match="no state explores one axis alone"):
        read_table(path)
