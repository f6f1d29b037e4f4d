"""Ramps and shaped paths keep every limit, and reach where they should in the shortest time."""

import numpy as np
import pytest
from tests.bench.conftest import PERIOD_S, pressure

from pliant.errors import UserError
from pliant_bench.bench import BenchChannel, ChannelLimits
from pliant_bench.limits import check_protocol
from pliant_bench.ramps import follow, ramp, shaped, with_ramps


def random_limits(rng):
    return ChannelLimits(
        float(rng.choice([0.0, -5e3])),
        15e3,
        float(rng.choice([np.inf, 10 ** rng.uniform(3.5, 5.5)])),
        float(rng.choice([np.inf, 10 ** rng.uniform(4, 6)])),
        float(rng.choice([0.0, rng.uniform(0.01, 0.3)])),
    )


def test_a_ramp_takes_the_time_of_a_trapezoid():
    # 10 kPa at 5 kPa/s with 10 kPa/s²: 0.5 s to accelerate, 0.5 s to brake, 1.5 s between.
    path = ramp(0.0, 10e3, 0.001, ChannelLimits(rate=5e3, acceleration=10e3))
    assert len(path) * 0.001 == pytest.approx(2.5, abs=0.005)
    assert path[-1] == 10e3


def test_ramps_without_limits_are_steps():
    assert ramp(0.0, 1.0, 0.01, ChannelLimits()).tolist() == [1.0]
    assert len(ramp(1.0, 1.0, 0.01, ChannelLimits())) == 0


def test_any_raw_path_is_shaped_into_one_that_keeps_the_limits():
    rng = np.random.default_rng(2)
    for _ in range(300):
        inputs = [BenchChannel("pressure_pa", random_limits(rng))]
        raw = np.repeat(rng.uniform(-10e3, 20e3, 12), rng.integers(1, 40, 12))
        done = shaped(pressure(raw), inputs)
        check_protocol(done, inputs)
        path = done.commands["pressure_pa"]
        assert path[0] == path[-1] == 0.0
        assert len(path) >= len(raw)


def test_a_shaped_path_reaches_its_levels():
    raw = np.repeat([0.0, 8e3, 2e3], 300)
    limits = ChannelLimits(0.0, 15e3, 20e3, 1e5)
    path = shaped(pressure(raw), [BenchChannel("pressure_pa", limits)]).commands["pressure_pa"]
    assert path[[299, 599, 899]].tolist() == [0.0, 8e3, 2e3]


def test_a_path_that_keeps_the_limits_is_followed_exactly_without_a_limit_of_acceleration(hill):
    raw = hill().commands["pressure_pa"]
    assert np.array_equal(follow(raw, 0.0, PERIOD_S, ChannelLimits(0.0, 15e3, 9e3)), raw)


def test_levels_are_held_for_the_dwell():
    raw = np.repeat([0.0, 1e3, 2e3, 3e3, 0.0], 5)  # a change every 50 ms
    path = follow(np.append(raw, np.zeros(60)), 0.0, PERIOD_S, ChannelLimits(dwell_s=0.2))
    changes = np.flatnonzero(np.diff(path))
    assert len(changes) >= 2
    assert np.diff(changes).min() * PERIOD_S >= 0.2 - 1e-9


def test_ramps_are_put_around_a_protocol():
    rng = np.random.default_rng(3)
    raw = pressure(np.full(100, 6e3))
    for _ in range(50):
        inputs = [BenchChannel("pressure_pa", random_limits(rng))]
        done = with_ramps(raw, inputs, PERIOD_S)
        check_protocol(done, inputs)
        path = done.commands["pressure_pa"]
        assert path[0] == path[-1] == 0.0
        assert np.sum(path == 6e3) >= 100


def test_a_protocol_at_rest_gets_no_ramp(hill):
    inputs = [BenchChannel("pressure_pa", ChannelLimits(0.0, 15e3, 1e4, 1e5))]
    assert len(with_ramps(hill(), inputs, PERIOD_S)) == len(hill())


def test_ramps_do_not_hide_a_violation(hill):
    with pytest.raises(UserError, match="above its limit of 5 kPa"):
        with_ramps(hill(10e3), [BenchChannel("pressure_pa", ChannelLimits(0.0, 5e3))], PERIOD_S)


def test_limits_that_never_end_a_ramp_are_refused():
    with pytest.raises(UserError, match="too low"):
        ramp(0.0, 1e6, 0.1, ChannelLimits(rate=1.0))
