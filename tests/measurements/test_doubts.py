"""A correct bench raises no doubt with pauses, stiction, creep and quantisation; a defective sensor raises one."""

from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis import quick

from pliant.measurements.columns import MEASUREMENT
from pliant.measurements.doubts import sensor_doubts
from pliant_tables.schema import FileColumn

NAMES = ("pressure_pa", "angle_rad", "tip_x_m")
COLUMNS = {name: FileColumn(name, name, "output", MEASUREMENT.find(name).unit) for name in NAMES}
TIME = np.arange(400) * 0.05
RUNS = {
    "ramps, holds, loads": quick.rich(1),
    "waves": [quick.make_history("a", TIME, quick.P * np.sin(0.1 * np.pi * TIME) ** 2)],
    "steps": [quick.make_history("a", TIME, np.repeat([0.0, quick.P, 0.6 * quick.P, 0.0], 100))],
}


@pytest.mark.parametrize("runs", RUNS.values(), ids=RUNS)
@pytest.mark.parametrize(
    "kind", [None, "friction_hysteresis", "backlash", "dead_zone", "permanent_set", "viscoelastic"]
)
def test_a_healthy_bench_raises_no_doubt(runs, kind):
    effects = [quick.effect(kind)] if kind else []
    read = quick.measured(quick.joint(), runs, *effects, sigma=1e-12, outputs=NAMES[1:])
    for step in (1e-9, np.radians(0.1), np.radians(1.0)):
        steps = {"angle_rad": step, "tip_x_m": 0.02 * step}
        quantised = [
            run.with_outputs(
                {name: np.round(v / steps[name]) * steps[name] for name, v in run.outputs.items()}
            )
            for run in read.runs
        ]
        assert not sensor_doubts(quantised, COLUMNS, "notes.yaml")


@pytest.mark.parametrize("kind", ["saturated", "frozen", "zero", "absolute", "at 1800 m"])
def test_the_same_bench_with_a_sick_sensor_raises_one(kind):
    (run,) = quick.measured(quick.joint(), RUNS["waves"], sigma=1e-4, outputs=NAMES[1:2]).runs
    pressure, angle = run.history.actuation["pressure_pa"], run.outputs["angle_rad"]
    if kind == "frozen":
        angle = np.where((np.arange(400) > 60) & (np.arange(400) < 160), angle[60], angle)
    if kind == "zero":
        angle = angle + 0.3
    altered = {"saturated": np.minimum(pressure, 0.6 * quick.P), "absolute": pressure + 101.3e3}
    pressure = {**altered, "at 1800 m": pressure + 81.5e3}.get(kind, pressure)
    sick = replace(
        run.with_outputs({"angle_rad": angle}), history=run.history.with_(actuation={"pressure_pa": pressure})
    )
    (doubt,) = sensor_doubts([sick], COLUMNS, "notes.yaml")
    assert doubt.kind == {"absolute": "zero", "at 1800 m": "zero"}.get(kind, kind)
    assert doubt.column == ("angle_rad" if kind in ("frozen", "zero") else "pressure_pa")


def test_a_pressure_that_is_held_up_bends_what_it_is_in():
    """A gauge that begins at 81.5 kPa is not an absolute one where the bend does not begin at zero."""
    (run,) = quick.measured(quick.joint(), RUNS["waves"], sigma=1e-4, outputs=NAMES[1:2]).runs
    pressure = run.history.actuation["pressure_pa"] + 81.5e3
    bent = run.with_outputs({"angle_rad": run.outputs["angle_rad"] + 0.4})
    held = replace(bent, history=run.history.with_(actuation={"pressure_pa": pressure}))
    assert not [d for d in sensor_doubts([held], COLUMNS, "notes.yaml") if d.column == "pressure_pa"]
