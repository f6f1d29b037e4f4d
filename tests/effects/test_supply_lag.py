"""`supply_lag` with a venting time of its own: closed forms both ways, the change between them within a step."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from pliant.interfaces.effect import Model
from pliant.records.design import Array
from pliant.records.history import History
from pliant.testing.samples import sample_chain
from pliant_plugins.effects.lag import lagged
from pliant_plugins.effects.supply_lag import SupplyLag, SupplyLagConfig

P = 12e3
ratios = st.floats(0.2, 5.0)


def arrived(
    t: Array, pressure: Array, filling_s: float, ratio: float = 1.0, valve: Array | None = None
) -> Array:
    effect = SupplyLag(SupplyLagConfig(time_s=filling_s, vent_ratio=ratio))
    history = History.of({"pressure_pa": pressure}, t, valve_open=valve)
    return effect.apply(Model(sample_chain(modules=1))).commanded(history).actuation["pressure_pa"]


def wandering(seed: int, n: int) -> tuple[Array, Array]:
    """Uneven steps of levels that go both ways."""
    rng = np.random.default_rng(seed)
    return np.cumsum([0.0, *rng.uniform(1e-3, 0.5, n - 1)]), rng.uniform(-P, P, n)


@pytest.mark.parametrize(("ratio", "rate"), [(2.0, 3e3), (2.0, -3e3), (0.5, 3e3), (0.5, -3e3)])
def test_a_ramp_is_late_by_the_time_of_its_own_direction(ratio: float, rate: float) -> None:
    """p = p_c − s T (1 − e^(−t/T)), T that of filling on the way up and that of venting on the way down."""
    t = np.cumsum([0.0, *np.random.default_rng(3).uniform(0.01, 0.8, 100)])
    constant = 0.4 * (ratio if rate < 0 else 1.0)
    wanted = rate * (t - constant * (1 - np.exp(-t / constant)))
    np.testing.assert_allclose(arrived(t, rate * t, 0.4, ratio), wanted, rtol=1e-11, atol=1e-8)


def test_steps_up_and_down_decay_with_their_own_times() -> None:
    """Steps within no time; two samples at one instant are a jump."""
    t = np.concatenate([[0.0], np.linspace(0.0, 5.0, 26), np.linspace(5.0, 12.0, 36)])
    pressure = np.repeat([0.0, P, 0.0], [1, 26, 36])
    p = arrived(t, pressure, 0.5, 1.6)
    np.testing.assert_allclose(p[1:27], P * (1 - np.exp(-t[1:27] / 0.5)), rtol=1e-11, atol=1e-8)
    np.testing.assert_allclose(p[27:], p[26] * np.exp(-(t[27:] - 5.0) / 0.8), rtol=1e-11)


def test_a_command_that_overtakes_what_is_left_changes_the_time_within_its_step() -> None:
    """Vented from P at once, then a ramp up from zero in one step: p falls as e^(−t/rT), meets s t, follows late."""
    filling, ratio, rate, end = 0.3, 3.0, 8e3, 2.0
    venting = ratio * filling
    p = arrived(np.array([0.0, 0.0, end]), np.array([P, 0.0, rate * end]), filling, ratio)[-1]
    met = venting * np.log1p(P / (venting * rate))  # where (P + s rT) e^(−t/rT) = s rT
    assert 0.0 < met < end
    wanted = rate * end - filling * rate * (1 - np.exp(-(end - met) / filling))
    assert p == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("ratio", [0.3, 3.0])
def test_it_is_the_solution_of_its_equation(ratio: float) -> None:
    """Against the midpoint rule in 4000 parts of each step, whose kinks are rounded off by one part."""
    t, pressure = wandering(5, 12)
    pressure = np.abs(pressure) * (-1.0) ** np.arange(12)
    parts, filling, y = 4000, 0.3, pressure[0]
    wanted = [y]
    for k in range(len(t) - 1):
        h = (t[k + 1] - t[k]) / parts
        for share in (np.arange(parts) / parts).tolist():
            u = pressure[k] + share * (pressure[k + 1] - pressure[k])
            slope = (u - y) / (filling * (ratio if y > u else 1.0))
            half, at_half = y + 0.5 * h * slope, u + 0.5 / parts * (pressure[k + 1] - pressure[k])
            y += h * (at_half - half) / (filling * (ratio if half > at_half else 1.0))
        wanted.append(y)
    late = arrived(t, pressure, filling, ratio)
    assert np.count_nonzero(np.diff(np.sign(late - pressure))) > 6  # it changed within steps, both ways
    np.testing.assert_allclose(late, wanted, rtol=0, atol=1e-6 * P)


@given(ratios, st.floats(1e-2, 5.0), st.integers(0, 50))
def test_more_samples_of_the_same_straight_lines_change_nothing(
    ratio: float, filling: float, seed: int
) -> None:
    t, pressure = wandering(seed, 20)
    fine = np.sort(np.concatenate([t, 0.3 * t[1:] + 0.7 * t[:-1]]))
    halved = arrived(fine, np.interp(fine, t, pressure), filling, ratio)[np.isin(fine, t)]
    np.testing.assert_allclose(halved, arrived(t, pressure, filling, ratio), rtol=0, atol=1e-9 * P)


@given(ratios, st.integers(0, 50))
def test_upside_down_filling_is_venting(ratio: float, seed: int) -> None:
    """−p with times exchanged is the mirror image."""
    t, pressure = wandering(seed, 30)
    there = arrived(t, pressure, 0.4, ratio)
    mirrored = lagged(-pressure, t, ratio * 0.4, falling_s=0.4)
    np.testing.assert_allclose(there, -mirrored, rtol=0, atol=1e-10 * P)


def test_the_neutral_ratio_is_the_lag_of_one_time() -> None:
    """The loop with two times agrees with the loop with one where the two are alike but for the last digit."""
    t, pressure = wandering(1, 400)
    one = arrived(t, pressure, 0.4)
    d, wanted = 0.0, [pressure[0]]
    for h, change, level in zip(np.diff(t), np.diff(pressure), pressure[1:], strict=True):
        d = np.exp(-h / 0.4) * d + np.expm1(-h / 0.4) * 0.4 / h * change
        wanted.append(level + d)
    np.testing.assert_allclose(one, wanted, rtol=0, atol=1e-12 * P)
    np.testing.assert_allclose(
        lagged(pressure, t, 0.4, falling_s=0.4 * (1 + 4e-16)), one, rtol=0, atol=1e-12 * P
    )


@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_a_closed_chamber_keeps_its_pressure_and_goes_on_with_the_time_of_its_side(ratio: float) -> None:
    """The command passes what the chamber holds while the valve is closed: nothing moves, and no time is found."""
    t = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    late = lagged(
        np.array([0.0, P, 2 * P, 0.0, 0.0]), t, 0.5, np.array([True, False, False, True]), 0.5 * ratio
    )
    assert late[1] == late[2] == late[3] == pytest.approx(P * (1 - 0.5 * (1 - np.exp(-2.0))))
    assert late[4] == pytest.approx(late[3] * np.exp(-1.0 / (0.5 * ratio)))
    held = arrived(t, np.array([0.0, P, P, P, P]), 0.5, ratio, valve=np.array([1.0, 1.0, 0.0, 0.0, 1.0]))
    assert held[1] == held[2] == held[3] < held[4]


@given(ratios, st.floats(1e-3, 60.0), st.integers(0, 50))
def test_what_arrives_stays_within_what_was_commanded(ratio: float, filling: float, seed: int) -> None:
    t, pressure = wandering(seed, 30)
    late = arrived(t, pressure, filling, ratio)
    assert np.all(late <= np.maximum.accumulate(pressure) + 1e-9 * P)
    assert np.all(late >= np.minimum.accumulate(pressure) - 1e-9 * P)


@pytest.mark.parametrize("ratio", [0.1, 6.0, -1.0])
def test_a_ratio_beyond_its_bounds_is_refused(ratio: float) -> None:
    with pytest.raises(ValidationError, match="vent_ratio"):
        SupplyLagConfig(time_s=0.4, vent_ratio=ratio)


def test_a_long_recording_takes_a_millisecond() -> None:
    t, pressure = wandering(2, 3000)
    took = []
    for _ in range(10):
        start = time.process_time()
        arrived(t, pressure, 0.4, 1.7)
        took.append(time.process_time() - start)
    assert min(took) < 5e-3  # 0.6 ms on one core; room for a slow machine
