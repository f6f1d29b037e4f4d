"""Readings opposite to the model indicate a sign error and not physics."""

from __future__ import annotations

from pathlib import Path

import pandas
import pytest

from pliant import api
from pliant.errors import UserError

EXAMPLE = Path(__file__).parents[2] / "examples" / "opposed_chambers"


def opened(folder: Path, *overrides: str) -> api.OpenStudy:
    return api.open_study(EXAMPLE / "joint.yaml", overrides, store=folder / "store")


def test_the_right_signs_say_nothing(tmp_path: Path) -> None:
    assert not api.compare(opened(tmp_path)).bookkeeping


def test_swapped_chambers_are_named(tmp_path: Path) -> None:
    swapped = "chain.actuators=[{input: pressure_1_pa, sign: -1}, {input: pressure_2_pa, sign: 1}]"
    (found,) = api.compare(opened(tmp_path, swapped)).bookkeeping
    assert found.kind == "exchanged" and found.where == ("pressure_1_pa", "pressure_2_pa")
    assert "pressure_1_pa and pressure_2_pa are exchanged" in found.words
    assert "their signs in 'chain.actuators'" in found.remedy


def test_one_chamber_in_two_is_missing(tmp_path: Path) -> None:
    rows = [line.split(",") for line in (EXAMPLE / "bench.csv").read_text().splitlines()]
    short = tmp_path / "short.csv"
    short.write_text("\n".join(",".join([*row[:3], *row[4:]]) for row in rows) + "\n")
    with pytest.raises(UserError, match="driven by 'pressure_2_pa'"):
        api.read_measurement(opened(tmp_path), short)


def test_a_pattern_and_a_frame_are_data_too(tmp_path: Path) -> None:
    whole = pandas.read_csv(EXAMPLE / "bench.csv", comment="#")
    study = opened(tmp_path)
    read = api.read_measurement(study, whole)
    for name, part in whole.groupby("run"):
        part.drop(columns="run").to_csv(tmp_path / f"{name}.csv", index=False)
    parts = api.read_measurement(study, str(tmp_path / "*.csv"))
    assert {run.name for run in parts.runs} == {run.name for run in read.runs} == set(whole["run"])
    assert parts.n_samples == read.n_samples == api.read_measurement(study).n_samples
