"""Equivalent recordings give the same comparison."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.metamorphic.random_studies import Raw, random_study

from pliant import api

COUNT = max(int(os.environ.get("PLIANT_METAMORPHIC", "50")) // 10, 2)
Rows = list[dict[str, object]]
PSI = 6894.757293168361


def recording(rng: np.random.Generator) -> Rows:
    """Return two runs of pressure and bend with noise, a sample every half a second."""
    rows: Rows = []
    for run in ("a", "b"):
        pressure = np.interp(np.arange(12), [0, 4, 8, 11], rng.uniform(0.0, 8e3, 4))
        bend = 1e-4 * pressure + rng.normal(0.0, 0.01, 12)
        rows += [
            {"run": run, "time_s": 0.5 * k, "pressure_pa": float(p), "angle_rad": float(u)}
            for k, (p, u) in enumerate(zip(pressure, bend, strict=True))
        ]
    return rows


def as_they_are(rows: Rows) -> tuple[list[Rows], Raw]:
    return [rows], {}


def in_other_units(rows: Rows) -> tuple[list[Rows], Raw]:
    """Return the rows in milliseconds, psi and degrees, with the units in the names of the columns."""
    other = [
        {
            "run": row["run"],
            "time_ms": 1e3 * float(row["time_s"]),
            "pressure_psi": float(row["pressure_pa"]) / PSI,
            "angle_deg": float(np.degrees(row["angle_rad"])),
        }
        for row in rows
    ]
    return [other], {}


def renamed(rows: Rows) -> tuple[list[Rows], Raw]:
    """Rename the columns; the study states the bench's names."""
    names = {"P1": "pressure_pa", "theta": "angle_rad"}
    back = {new: old for old, new in names.items()}
    return [[{back.get(name, name): value for name, value in row.items()} for row in rows]], {"rename": names}


def runs_the_other_way(rows: Rows) -> tuple[list[Rows], Raw]:
    return [[row for run in ("b", "a") for row in rows if row["run"] == run]], {}


def a_file_for_each_run(rows: Rows) -> tuple[list[Rows], Raw]:
    return [[row for row in rows if row["run"] == run] for run in ("a", "b")], {}


def columns_the_other_way(rows: Rows) -> tuple[list[Rows], Raw]:
    return [[dict(reversed(row.items())) for row in rows]], {}


def mirrored(rows: Rows) -> tuple[list[Rows], Raw]:
    """Change the sign of the encoder; the study states it."""
    other = [{**row, "angle_rad": -float(row["angle_rad"])} for row in rows]
    return [other], {"units": {"angle_rad": "-1 rad"}}


WAYS = (in_other_units, renamed, runs_the_other_way, a_file_for_each_run, columns_the_other_way, mirrored)


def compared(
    raw: Raw, way: Callable[[Rows], tuple[list[Rows], Raw]], rows: Rows, folder: Path
) -> dict[str, float]:
    """Return error, floor and independent readings of a comparison."""
    tables, notes = way(rows)
    files = []
    for number, table in enumerate(tables):
        text = io.StringIO()
        writer = csv.DictWriter(text, list(table[0]))
        writer.writeheader()
        writer.writerows(table)
        files.append(f"bench_{number}.csv")
        (folder / files[-1]).write_text(text.getvalue(), encoding="utf-8")
    study = {**raw, "measurements": {"file": files if len(files) > 1 else files[0], **notes}}
    path = folder / "study.yaml"
    path.write_text(json.dumps(study), encoding="utf-8")
    found = api.compare(api.open_study(path, store=folder / "store"))
    (error,) = found.outputs.values()
    return {"rmse": error.rmse, "bias": abs(error.bias), "n": found.n_samples, "worth": found.n_effective}


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_a_comparison_does_not_depend_on_how_it_is_written(way, tmp_path):
    for seed in range(COUNT):
        rng = np.random.default_rng(seed)
        raw, rows = random_study(rng), recording(rng)
        wanted, there = (compared(raw, one, rows, tmp_path) for one in (as_they_are, way))
        assert there == pytest.approx(wanted, rel=1e-7), (seed, way.__name__)
