"""`sensor_lag`: recorded angles lag by a first-order filter; positions, tasks and tables do not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.effects.bench import followed, model_with

from pliant.interfaces.effect import Model
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.design import Array
from pliant.records.history import History
from pliant.testing.effect_bench import run_readings
from pliant.testing.samples import linear_law, sample_chain
from pliant_plugins.effects.lag import lagged


def model(time_s: float) -> Model:
    return model_with(sample_chain(modules=2), "sensor_lag", time_s=time_s)


def read(constant_s: float, time_s: Array, angle: Array) -> Array:
    late: Array = model(constant_s).reported({"time_s": time_s, "angle_rad": angle})["angle_rad"]
    return late


def test_a_ramp_is_late_by_the_time_constant_at_uneven_steps() -> None:
    t = np.cumsum([0.0, *np.random.default_rng(3).uniform(0.01, 0.8, 200)])
    np.testing.assert_allclose(
        read(0.6, t, 0.1 * t), 0.1 * (t - 0.6 * (1 - np.exp(-t / 0.6))), rtol=1e-12, atol=1e-15
    )


def test_a_sine_has_first_order_filter_gain_and_phase() -> None:
    """Linear interpolation between samples replaces the sine, with an error of (ω h)²/12."""
    omega, constant, step = 2.0, 0.3, 1e-3
    t = np.arange(0.0, 20.0, step)
    settled = read(constant, t, np.sin(omega * t))[t > 10]
    wanted = np.sin(omega * t - np.arctan(omega * constant)) / np.hypot(1.0, omega * constant)
    np.testing.assert_allclose(settled, wanted[t > 10], atol=1e-6)


@given(st.lists(st.floats(1e-6, 30.0), min_size=1, max_size=20), st.floats(1e-3, 60.0))
def test_more_samples_on_the_same_straight_lines_change_nothing(steps: list[float], constant: float) -> None:
    t = np.cumsum([0.0, *steps])
    angle = np.random.default_rng(len(steps)).normal(size=len(t))
    fine = np.sort(np.concatenate([t, (t[1:] + t[:-1]) / 2]))
    halved = read(constant, fine, np.interp(fine, t, angle))[np.isin(fine, t)]
    if len(halved) == len(t):  # halves of the smallest steps may be rounded to their ends
        np.testing.assert_allclose(halved, read(constant, t, angle), rtol=1e-9, atol=1e-9)


def test_very_slow_and_very_fast_sensors_are_the_limits() -> None:
    t, angle = np.linspace(0.0, 1.0, 50), np.linspace(0.2, 0.5, 50) ** 2
    np.testing.assert_allclose(lagged(angle, t, 1e9), angle[0], rtol=1e-8)
    np.testing.assert_allclose(lagged(angle, t, 1e-9), angle, atol=1e-8)
    np.testing.assert_array_equal(lagged(np.array([1.0, 2.0, 2.0]), np.array([0.0, 0.0, 0.0]), 1.0), 1.0)


def test_positions_numbers_lists_and_readings_without_a_clock_are_in_time() -> None:
    t = np.linspace(0.0, 2.0, 9)
    ramp = 0.3 * t
    readings = {
        "time_s": t,
        "angle_rad": ramp,
        "tip_x_m": ramp,
        "bend_angle_rad": 0.4,
        "joint_angles_rad": [[0.1]],
    }
    after = model(0.5).reported(readings)
    assert after["angle_rad"][-1] < ramp[-1] - 0.1
    for name in ("time_s", "tip_x_m", "bend_angle_rad", "joint_angles_rad"):
        assert (
            after[name] == readings[name] if np.ndim(readings[name]) != 1 else after[name] is readings[name]
        )
    assert model(0.5).reported({"angle_rad": ramp})["angle_rad"] is ramp
    assert model(0.0).reported(readings)["angle_rad"] is ramp


@pytest.mark.parametrize(("kind", "late"), [("sensor_lag", True), ("supply_lag", False)])
def test_a_load_step_at_constant_pressure_tells_it_from_a_supply(kind: str, late: bool) -> None:
    chain = sample_chain(linear_law(), modules=1, gravity=(0, 0, 0))
    t = 0.1 * np.arange(40)
    moment = np.where(t > 0.95, 4e-3, 0.0)
    history = History.from_arrays({"pressure_pa": np.full(40, 8e3)}, t, moment_n_m=moment)
    changed = model_with(chain, kind, time_s=0.5)
    path = followed(changed.chain, changed.commanded(history))[0][:, :, None]
    said = run_readings(changed, path, history)
    true = (8e-7 * 8e3 - moment) / 0.04
    np.testing.assert_allclose(path[:, 0, 0], true, atol=1e-9)
    geometry = ChainGeometry.from_chain(chain)
    np.testing.assert_allclose(said["tip_x_m"], [geometry.markers(q)[-1, 0] for q in path], atol=1e-12)
    if late:
        after = t[9:] - t[9]
        wanted = true[-1] + (true[0] - true[-1]) * (0.5 / 0.1) * (1 - np.exp(-0.1 / 0.5)) * np.exp(
            -(after - 0.1) / 0.5
        )
        np.testing.assert_allclose(said["angle_rad"][10:], wanted[1:], atol=1e-8)
    else:
        np.testing.assert_allclose(said["angle_rad"], true, atol=1e-9)
