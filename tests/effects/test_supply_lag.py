"""`supply_lag`: two stages in series, the first with a separate venting time: closed forms, its integral, limits."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from tests.effects.bench import model_with

from pliant.records.design import Array
from pliant.records.history import History
from pliant.testing.samples import sample_chain
from pliant_plugins.effects.lag import lagged
from pliant_plugins.effects.supply_lag import lagged_twice

P = 12e3
ratios = st.floats(0.2, 5.0)
seconds = st.floats(0.01, 1.0)


def arrived(
    t: Array,
    pressure: Array,
    filling_s: float,
    ratio: float = 1.0,
    second: float = 0.3,
    valve: Array | None = None,
) -> Array:
    values = {"time_s": filling_s, "vent_ratio": ratio, "second_ratio": second}
    history = History.from_arrays({"pressure_pa": pressure}, t, valve_open=valve)
    model = model_with(sample_chain(modules=1), "supply_lag", **values)
    return model.commanded(history).actuation["pressure_pa"]


def first_stage(t: Array, pressure: Array, filling_s: float, ratio: float) -> Array:
    return lagged(pressure, t, filling_s, falling_s=ratio * filling_s)


def wandering(seed: int, n: int) -> tuple[Array, Array]:
    """Return uneven steps of levels in both directions."""
    rng = np.random.default_rng(seed)
    return np.cumsum([0.0, *rng.uniform(1e-3, 0.5, n - 1)]), rng.uniform(-P, P, n)


@pytest.mark.parametrize(("ratio", "rate"), [(2.0, 3e3), (2.0, -3e3), (0.3, 3e3), (0.3, -3e3), (1.0, 3e3)])
@pytest.mark.parametrize("second", [0.05, 0.3, 1.0])
def test_a_ramp_is_late_by_the_times_for_its_direction(ratio: float, rate: float, second: float) -> None:
    """p = s (t − T − T₂ + (T² e^(−t/T) − T₂² e^(−t/T₂)) / (T − T₂)); for T₂ = T s (t − 2T + (t + 2T) e^(−t/T))."""
    t = np.cumsum([0.0, *np.random.default_rng(3).uniform(0.01, 0.8, 100)])
    one, two = 0.4 * (ratio if rate < 0 else 1.0), 0.4 * second
    if abs(one - two) < 1e-12:
        wanted = rate * (t - 2 * one + (t + 2 * one) * np.exp(-t / one))
    else:
        decayed = (one**2 * np.exp(-t / one) - two**2 * np.exp(-t / two)) / (one - two)
        wanted = rate * (t - one - two + decayed)
    np.testing.assert_allclose(
        arrived(t, rate * t, 0.4, ratio, second), wanted, rtol=1e-11, atol=1e-11 * abs(rate)
    )


def test_steps_up_and_down_decay_with_their_own_times() -> None:
    """Two samples at one instant are an instantaneous jump. The response to a step starts with zero slope."""
    t = np.concatenate([[0.0], np.linspace(0.0, 8.0, 401), np.linspace(8.0, 16.0, 401)])
    p = arrived(t, np.repeat([0.0, P, 0.0], [1, 401, 401]), 0.5, 1.6, 0.2)

    def left(since: Array, one: float, two: float) -> Array:
        rest: Array = (one * np.exp(-since / one) - two * np.exp(-since / two)) / (one - two)
        return rest

    np.testing.assert_allclose(p[1:402], P * (1 - left(t[1:402], 0.5, 0.1)), rtol=0, atol=1e-10 * P)
    np.testing.assert_allclose(p[402:], P * left(t[402:] - 8.0, 0.8, 0.1), rtol=0, atol=1e-6 * P)
    assert p[2] - p[1] < 0.2 * (p[12] - p[11])


def test_nearly_equal_times_are_the_limit_to_equal_ones() -> None:
    t, pressure = wandering(8, 60)
    equal = lagged_twice(pressure, t, (0.4, 0.4), 0.4)
    for apart in (1e-4, 1e-8, 1e-12):
        off = lagged_twice(pressure, t, (0.4, 0.4), 0.4 * (1 + apart))
        np.testing.assert_allclose(off, equal, rtol=0, atol=2 * apart * P + 1e-12 * P)
    np.testing.assert_allclose(  # the order of two linear stages does not matter
        lagged_twice(pressure, t, (0.4, 0.4), 0.1),
        lagged_twice(pressure, t, (0.1, 0.1), 0.4),
        rtol=0,
        atol=1e-11 * P,
    )


@given(ratios, st.integers(0, 50))
def test_a_second_stage_without_time_is_none(ratio: float, seed: int) -> None:
    """p is below y by T₂ y', and y' ≤ 2 P / (T min(1, r))."""
    t, pressure = wandering(seed, 40)
    one = first_stage(t, pressure, 0.4, ratio)
    for second_s in (1e-4, 1e-7, 1e-10):
        short = np.abs(lagged_twice(pressure, t, (0.4, ratio * 0.4), second_s) - one)
        assert short.max() <= second_s * 2 * P / (0.4 * min(1.0, ratio)) + 1e-12 * P


def test_a_command_that_overtakes_what_is_left_changes_the_time_within_its_step() -> None:
    """The first stage is vented from P at once, then ramped up in one step: y falls to s t, then lags behind it."""
    filling, ratio, rate, end = 0.3, 3.0, 8e3, 2.0
    venting = ratio * filling
    y = first_stage(np.array([0.0, 0.0, end]), np.array([P, 0.0, rate * end]), filling, ratio)[-1]
    met = venting * np.log1p(P / (venting * rate))  # where (P + s rT) e^(−t/rT) = s rT
    assert 0.0 < met < end
    wanted = rate * end - filling * rate * (1 - np.exp(-(end - met) / filling))
    assert y == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("hold", [100.0, 744.3, 1e4])  # e^(−744.3) is the least number above zero
def test_the_least_rest_long_ago_does_not_choose_the_time(hold: float) -> None:
    """After venting for so long that the pressure nearly underflows, a ramp up is filled from its start."""
    filling, venting, rate = 0.3, 1.0, 0.2
    t = np.array([0.0, 0.0, hold, hold + 2.0])
    y = lagged(np.array([1.0, 0.0, 0.0, 2.0 * rate]), t, filling, falling_s=venting)
    wanted = rate * (2.0 - filling * (1 - np.exp(-2.0 / filling)))
    assert y[-1] == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize(("ratio", "second"), [(0.3, 0.3), (3.0, 0.3), (0.3, 1.0), (3.0, 0.02), (1.0, 1.0)])
def test_it_solves_its_equations(ratio: float, second: float) -> None:
    """Compared with scipy's integrator, between samples one by one."""
    t, pressure = wandering(5, 12)
    pressure = np.abs(pressure) * (-1.0) ** np.arange(12)
    filling, state = 0.3, np.full(2, pressure[0])
    wanted = [state]
    for k in range(len(t) - 1):
        ends = t[k : k + 2], pressure[k : k + 2]

        def rates(now: float, both: Array, ends: tuple[Array, Array] = ends) -> list[float]:
            u = np.interp(now, *ends)
            way = ratio if both[0] > u else 1.0
            return [(u - both[0]) / (way * filling), (both[0] - both[1]) / (second * filling)]

        state = solve_ivp(rates, (t[k], t[k + 1]), state, rtol=1e-8, atol=1e-9 * P, max_step=0.02).y[:, -1]
        wanted.append(state)
    first, late = np.transpose(wanted)
    assert np.count_nonzero(np.diff(np.sign(first - pressure))) > 6  # it changed within steps, both ways
    np.testing.assert_allclose(first_stage(t, pressure, filling, ratio), first, rtol=0, atol=1e-6 * P)
    np.testing.assert_allclose(arrived(t, pressure, filling, ratio, second), late, rtol=0, atol=1e-6 * P)


@given(ratios, seconds, st.floats(1e-2, 5.0), st.integers(0, 50))
def test_more_samples_on_the_same_straight_lines_change_nothing(
    ratio: float, second: float, filling: float, seed: int
) -> None:
    t, pressure = wandering(seed, 20)
    fine = np.sort(np.concatenate([t, 0.3 * t[1:] + 0.7 * t[:-1]]))
    halved = arrived(fine, np.interp(fine, t, pressure), filling, ratio, second)[np.isin(fine, t)]
    np.testing.assert_allclose(halved, arrived(t, pressure, filling, ratio, second), rtol=0, atol=1e-9 * P)


@given(ratios, st.integers(0, 50))
def test_upside_down_filling_is_venting(ratio: float, seed: int) -> None:
    """−p with exchanged times is the mirror image."""
    t, pressure = wandering(seed, 30)
    there = arrived(t, pressure, 0.4, ratio)
    mirrored = lagged_twice(-pressure, t, (ratio * 0.4, 0.4), 0.12)
    np.testing.assert_allclose(there, -mirrored, rtol=0, atol=1e-10 * P)


def test_the_neutral_ratio_is_the_lag_by_one_time() -> None:
    """For a ratio that differs from 1 in the last digit the loop with two times agrees with the loop with one."""
    t, pressure = wandering(1, 400)
    one = lagged(pressure, t, 0.4)
    d, wanted = 0.0, [pressure[0]]
    for h, change, level in zip(np.diff(t), np.diff(pressure), pressure[1:], strict=True):
        d = np.exp(-h / 0.4) * d + np.expm1(-h / 0.4) * 0.4 / h * change
        wanted.append(level + d)
    np.testing.assert_allclose(one, wanted, rtol=0, atol=1e-12 * P)
    np.testing.assert_allclose(
        lagged(pressure, t, 0.4, falling_s=0.4 * (1 + 4e-16)), one, rtol=0, atol=1e-12 * P
    )


@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_a_closed_chamber_keeps_its_pressure_and_continues_with_its_side_time(ratio: float) -> None:
    """The command crosses the chamber's pressure at a closed valve: nothing moves and no crossing time is computed."""
    t = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    late = lagged(
        np.array([0.0, P, 2 * P, 0.0, 0.0]), t, 0.5, np.array([True, False, False, True]), 0.5 * ratio
    )
    assert late[1] == late[2] == late[3] == pytest.approx(P * (1 - 0.5 * (1 - np.exp(-2.0))))
    assert late[4] == pytest.approx(late[3] * np.exp(-1.0 / (0.5 * ratio)))
    held = arrived(t, np.array([0.0, P, P, P, P]), 0.5, ratio, valve=np.array([1.0, 1.0, 0.0, 0.0, 1.0]))
    assert held[1] == held[2] == held[3] < held[4]


def test_a_closed_valve_stops_both_stages_in_time() -> None:
    """The part of a change that has not yet arrived when the valve closes arrives after it opens."""
    t = np.array([0.0, 0.0, 0.3, 0.6, 0.9])
    pressure, valve = np.array([0.0, P, P, P, P]), np.array([1.0, 1.0, 1.0, 0.0, 1.0])
    held = arrived(t, pressure, 0.5, 1.5, 0.4, valve)
    open_ = arrived(t[:4], pressure[:4], 0.5, 1.5, 0.4)
    assert held[3] == held[2] and held[4] == pytest.approx(open_[3], rel=1e-12)


@given(ratios, seconds, st.floats(1e-3, 60.0), st.integers(0, 50))
def test_what_arrives_stays_within_what_was_commanded(
    ratio: float, second: float, filling: float, seed: int
) -> None:
    t, pressure = wandering(seed, 30)
    late = arrived(t, pressure, filling, ratio, second)
    assert np.all(late <= np.maximum.accumulate(pressure) + 1e-9 * P)
    assert np.all(late >= np.minimum.accumulate(pressure) - 1e-9 * P)


def test_time_grows_with_the_recording_and_not_faster() -> None:
    """Four times the samples take four times as long, also when the side changes at every second step."""

    def least_s(samples: int) -> float:
        t, pressure = wandering(2, samples)
        took = []
        for _ in range(20):
            start = time.process_time()
            arrived(t, pressure, 0.4, 1.7)
            took.append(time.process_time() - start)
        return min(took)

    assert least_s(8000) < 7.0 * least_s(2000)
