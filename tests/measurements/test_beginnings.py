"""Recordings that begin in the middle of a motion: a model begins every run at rest."""

from pathlib import Path

import numpy as np
import pytest

from pliant import api
from pliant.records.measurement import Measurement

TIME = np.arange(0.0, 8.0, 0.1)
PRESSURE = np.where(TIME < 4.0, 13e3, 3e3)


def read(folder: Path, angle: np.ndarray, pressure: np.ndarray = PRESSURE) -> Measurement:
    lines = [
        f"{run},{t:.1f},{p},{a:.5f}" for run in "ab" for t, p, a in zip(TIME, pressure, angle, strict=True)
    ]
    (folder / "bench.csv").write_text("run,time_s,pressure_pa,angle_rad\n" + "\n".join(lines) + "\n")
    return api.read(folder / "bench.csv", {})[0]


def test_a_motion_that_nothing_drives_is_doubted_with_the_span_to_exclude(tmp_path: Path) -> None:
    """Both runs begin at 13 kPa with the joint straight; it settles within 5 % after three time constants."""
    still = 0.3 * (PRESSURE / 13e3)
    measured = read(tmp_path, np.where(TIME < 4.0, still * (1.0 - np.exp(-TIME / 0.3)), still))
    (doubt,) = measured.doubts
    assert doubt.kind == "beginning"
    assert "begins in the middle of a motion, from 0 rad to 0.3 rad" in doubt.sentence
    assert "{run: a, end: 0.9 s}, {run: b, end: 0.9 s}" in doubt.sentence
    assert doubt.sentence in measured.remarks


@pytest.mark.parametrize(
    ("angle", "pressure"),
    [
        (0.3 * PRESSURE / 13e3, PRESSURE),  # at rest from the first sample on
        (0.3 * (PRESSURE / 13e3) * (1.0 + 0.2 * (1.0 - np.exp(-TIME / 2.0))), PRESSURE),  # it creeps
        (0.3 * (1.0 - np.exp(-TIME / 0.3)), np.where(TIME < 0.05, 0.0, 13e3)),  # the bench itself has stepped
    ],
)
def test_rest_creep_and_a_step_of_the_bench_are_no_such_beginning(
    tmp_path: Path, angle: np.ndarray, pressure: np.ndarray
) -> None:
    assert not [d for d in read(tmp_path, angle, pressure).doubts if d.kind == "beginning"]
