"""Frames with an unknown rotation, zeros of each run, bends and curvatures about two axes, free swings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis.quick import BENCH, ENGINE, blank, effect, make_measurement, make_predictor, ramp

from pliant.errors import UserError
from pliant.evidence.alignment import Alignment
from pliant.evidence.prediction import Predictor
from pliant.mechanics.rotations import exp_map
from pliant.records.history import History, LetGo
from pliant.records.measurement import Measurement, SensorFrame
from pliant.testing.samples import linear_law, linear_spherical_law, sample_chain

SPATIAL = sample_chain(modules=3, turns_rad=(0.0, 0.4), payload=0.004)
RUNS = [ramp("a", 3e3, 0.5), ramp("b", 3e3, 0.5, base_angles_rad=[0.2, 0.7, -0.3], specimen="B")]
TIP = ("tip_x_m", "tip_y_m", "tip_z_m")
TURN = exp_map(np.array([[0.3, -1.1, 2.0]]))[0]
SPHERICAL = sample_chain(linear_spherical_law(), modules=2, gravity=(3.0, 2.0, -9.81), payload=0.02)


def turned_readings(shift: float = 0.0) -> tuple[dict[str, np.ndarray], ...]:
    """Return tips in a camera's frame, each run moved by `shift` more than the one before."""
    truth = make_predictor(SPATIAL, blank(RUNS, TIP)).predict()
    found = []
    for k, run in enumerate(truth):
        seen = np.stack([run[name] for name in TIP], axis=1) @ TURN.T + shift * k
        found.append(dict(zip(TIP, seen.T, strict=True)))
    return tuple(found)


def test_the_camera_turn_is_identified_and_reported() -> None:
    readings = turned_readings()
    measured = make_measurement(RUNS, readings, frames={"*": SensorFrame()})
    model = make_predictor(SPATIAL, measured)
    for run, seen in zip(model.predict(), readings, strict=True):
        for name in TIP:
            np.testing.assert_allclose(run[name], seen[name], atol=1e-12)
    np.testing.assert_allclose(model.turns[0].positions, TURN, atol=1e-9)
    angle = float(np.degrees(np.linalg.norm([0.3, -1.1, 2.0])))
    assert any(f"turned by {angle:.4g}°" in said and "Three numbers" in said for said in model.remarks)


def test_a_stated_turn_is_not_fitted_and_holds_for_runs_without_readings() -> None:
    readings = turned_readings()
    model = make_predictor(SPATIAL, make_measurement(RUNS, readings, frames={"*": SensorFrame()}))
    menu = model.for_runs(blank(RUNS, TIP))
    empty = menu.for_runs(
        replace(
            menu.measurement,
            runs=tuple(
                r.with_outputs({n: np.full(len(r), np.nan) for n in TIP}) for r in menu.measurement.runs
            ),
        )
    )
    world = empty.predict()[0]["tip_x_m"]
    kept = model.for_runs(empty.measurement).predict()[0]["tip_x_m"]
    np.testing.assert_allclose(kept, readings[0]["tip_x_m"], atol=1e-12)
    assert not np.allclose(world, kept)


def test_slopes_are_those_after_turn_and_zeros_are_fitted() -> None:
    """Variable projection: the derivatives are compared with finite differences of the aligned outputs."""
    rng = np.random.default_rng(3)
    readings = [
        {name: values + rng.normal(0.0, 2e-3, len(values)) for name, values in run.items()}
        for run in turned_readings(0.01)
    ]
    zeros = dict.fromkeys(TIP, "per run")
    model = make_predictor(
        SPATIAL, make_measurement(RUNS, readings, frames={"*": SensorFrame()}, free_zeros=zeros)
    )
    step = 1e-4
    there = [effect("actuation_gain", gain=1.0 + step)]
    here, (change,) = model.vary([effect("actuation_gain", gain=1.0)], [there])
    other = model.evaluate(there).runs
    for a, d, b in zip(here.runs, change, other, strict=True):
        for name in TIP:
            assert np.abs(b[name] - a[name]).max() > 1e-7
            np.testing.assert_allclose(d[name], b[name] - a[name], atol=2e-9)


def test_the_zero_in_each_run_is_subtracted_and_one_for_all_runs_is_not_enough() -> None:
    truth = make_predictor(SPATIAL, blank(RUNS)).predict()
    moved = [{"angle_rad": run["angle_rad"] + offset} for run, offset in zip(truth, (0.1, -0.2), strict=True)]
    own = make_predictor(SPATIAL, make_measurement(RUNS, moved, free_zeros={"angle_rad": "per run"}))
    for run, seen in zip(own.predict(), moved, strict=True):
        np.testing.assert_allclose(run["angle_rad"], seen["angle_rad"], atol=1e-12)
    one = make_predictor(SPATIAL, make_measurement(RUNS, moved, free_zeros={"angle_rad": "unknown"}))
    missed = np.concatenate(
        [m["angle_rad"] - r["angle_rad"] for r, m in zip(one.predict(), moved, strict=True)]
    )
    assert abs(missed.mean()) < 1e-12
    assert np.abs(missed).max() > 0.1


def test_a_ball_joint_is_read_about_two_axes_and_as_curvatures() -> None:
    names = (
        "joint_1_angle_y_rad",
        "joint_2_angle_z_rad",
        "angle_y_rad",
        "angle_z_rad",
        "curvature_z_1_per_m",
        "curvature_1_per_m",
    )
    model = make_predictor(SPHERICAL, blank(RUNS, names))
    assert model.outputs == names
    q = ENGINE.follow(SPHERICAL, RUNS)[0][0].joint_angles
    y, z = SPHERICAL.laws[0].axes.index("y"), SPHERICAL.laws[0].axes.index("z")
    run = model.predict()[0]
    np.testing.assert_allclose(run["joint_1_angle_y_rad"], q[:, 0, y])
    np.testing.assert_allclose(run["joint_2_angle_z_rad"], q[:, 1, z])
    np.testing.assert_allclose(run["angle_z_rad"], q[:, :, z].sum(axis=1))
    np.testing.assert_allclose(run["curvature_z_1_per_m"], q[:, :, z].sum(axis=1) / SPHERICAL.length_m)
    np.testing.assert_allclose(run["curvature_1_per_m"], run["angle_y_rad"] / SPHERICAL.length_m)
    assert np.abs(run["angle_z_rad"]).max() > 0.01
    assert "angle_z_rad" not in make_predictor(SPATIAL, blank(RUNS, ("angle_rad", "angle_z_rad"))).outputs


def test_a_bend_sensor_pair_may_be_turned_about_the_chain() -> None:
    pair = ("curvature_y_1_per_m", "curvature_z_1_per_m")
    truth = make_predictor(SPHERICAL, blank(RUNS, pair)).predict()
    c, s = np.cos(0.7), np.sin(0.7)
    seen = [
        {pair[0]: c * run[pair[0]] + s * run[pair[1]], pair[1]: -s * run[pair[0]] + c * run[pair[1]]}
        for run in truth
    ]
    model = make_predictor(SPHERICAL, make_measurement(RUNS, seen, frames={"*": SensorFrame()}))
    np.testing.assert_allclose(model.predict()[1][pair[1]], seen[1][pair[1]], atol=1e-10)
    assert any(f"turned by {np.degrees(0.7):.4g}° about the chain axis" in said for said in model.remarks)
    stated = make_predictor(SPHERICAL, make_measurement(RUNS, seen, frames={"*": SensorFrame(angle_rad=0.7)}))
    np.testing.assert_allclose(stated.predict()[0][pair[0]], seen[0][pair[0]], atol=1e-10)


def test_a_frame_that_nothing_tells_is_refused() -> None:
    with pytest.raises(UserError, match="needs x, y and z of a position, or y and z of a bend"):
        Alignment.from_measurement(replace(blank(RUNS, ("angle_rad",)), frames={"*": SensorFrame()}))
    flat = Measurement(blank(RUNS, TIP).runs, TIP, "bench.csv", frames={"*": SensorFrame()})
    assert make_predictor(SPATIAL, flat).turns[0].positions is not None  # all zero: unchanged
    line = [
        {"tip_x_m": np.linspace(0.1, 0.2, len(h)), "tip_y_m": np.zeros(len(h)), "tip_z_m": np.zeros(len(h))}
        for h in RUNS
    ]
    with pytest.raises(UserError, match="lie on one line"):
        make_predictor(SPATIAL, make_measurement(RUNS, line, frames={"*": SensorFrame()})).predict()


def test_a_released_joint_swings_with_the_period_from_stiffness_and_inertia() -> None:
    """A hinge of 0.04 N·m/rad with a tip mass, without gravity, released from an angle: T = 2π √(I / k)."""
    chain = sample_chain(linear_law(), modules=1, gravity=(0, 0, 0), payload=0.05)
    time = np.arange(0.0, 0.4, 5e-4)
    swing = History.from_arrays({"pressure_pa": np.zeros(len(time))}, time, run="swing").with_(let_go=LetGo())
    first = {"angle_rad": np.full(len(time), 0.2)}
    model = Predictor(
        BENCH, ENGINE, chain, make_measurement([swing], [first]), [effect("inertia", scale=1.0)]
    )
    bend = model.predict()[0]["angle_rad"]
    assert bend[0] == pytest.approx(0.2, abs=1e-8)
    downward = np.flatnonzero((bend[:-1] > 0) & (bend[1:] <= 0))
    period = np.diff(time[downward]).mean()
    arm = float(np.linalg.norm(chain.tip_offset_m))
    mass = chain.payload_kg * arm**2
    assert period == pytest.approx(2 * np.pi * np.sqrt(mass / 0.04), rel=0.05)
    with pytest.raises(UserError, match="first row has no reading"):
        nothing = {"angle_rad": np.full(len(time), np.nan)}
        Predictor(BENCH, ENGINE, chain, make_measurement([swing], [nothing])).predict()


def test_a_camera_that_was_moved_has_a_turn_for_each_session() -> None:
    truth = make_predictor(SPATIAL, blank(RUNS, TIP)).predict()
    turns = [TURN, exp_map(np.array([[1.0, 0.4, -0.2]]))[0]]
    seen = []
    for run, turn in zip(truth, turns, strict=True):
        vectors = np.stack([run[name] for name in TIP], axis=1) @ turn.T
        seen.append(dict(zip(TIP, vectors.T, strict=True)))
    sessions = {"a*": SensorFrame(), "b*": SensorFrame()}
    model = make_predictor(SPATIAL, make_measurement(RUNS, seen, frames=sessions))
    for run, other in zip(model.predict(), seen, strict=True):
        np.testing.assert_allclose(run["tip_y_m"], other["tip_y_m"], atol=1e-12)
    for found, turn in zip(model.turns, turns, strict=True):
        np.testing.assert_allclose(found.positions, turn, atol=1e-9)
    assert any("6 numbers were" in said and '"b*": [' in said for said in model.remarks)
    one = make_predictor(SPATIAL, make_measurement(RUNS, seen, frames={"*": SensorFrame()}))
    assert np.abs(one.predict()[1]["tip_y_m"] - seen[1]["tip_y_m"]).max() > 1e-3
    with pytest.raises(UserError, match="run 'b' fits none of the patterns"):
        make_predictor(SPATIAL, make_measurement(RUNS, seen, frames={"a*": SensorFrame()}))
