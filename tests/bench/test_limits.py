"""Limits: what is allowed passes, and the first violation is named with instant, value and limit."""

import numpy as np
import pytest
from tests.bench.conftest import pressure

from pliant.errors import UserError
from pliant_bench.bench import BenchChannel, BenchProtocol, ChannelLimits
from pliant_bench.limits import CommandGuard, check_protocol, first_violation

PERIOD_S = 0.01


def channel(**limits):
    return BenchChannel("pressure_pa", ChannelLimits(**{"low": 0.0, "high": 15e3, **limits}))


def steps(*levels, held=10):
    return np.repeat(np.array(levels, float), held)


def test_a_protocol_within_every_limit_is_accepted(hill):
    # 10 kPa up and down in 4 s: at most 2π/4 · 5 kPa/s = 7.9 kPa/s and (2π/4)² · 5 kPa/s² = 12.4 kPa/s².
    check_protocol(hill(), [channel(rate=7.9e3, acceleration=12.4e3)])


@pytest.mark.parametrize(
    ("limits", "says"),
    [
        ({"high": 9e3}, r"pressure_pa is .* kPa at 1.6 s, above its limit of 9 kPa"),
        ({"rate": 5e3}, r"pressure_pa changes by 5.\d+ kPa/s at 0.\d+ s; its limit is 5 kPa/s"),
        ({"acceleration": 12e3}, r"has an acceleration of 12.\d+ kPa/s² at 0.01 s; its limit is 12 kPa/s²"),
        ({"dwell_s": 1.0}, r"changes at 2.01 s after a hold of 0 s; its least dwell is 1 s"),
    ],
)
def test_the_first_violation_is_named(hill, limits, says):
    with pytest.raises(UserError, match=rf"Run 'hill' is not allowed: .*{says}"):
        check_protocol(hill(), [channel(**limits)])


def test_a_run_has_to_begin_and_end_at_rest_where_speed_is_limited():
    held = pressure([5e3] * 20)
    check_protocol(held, [channel()])
    with pytest.raises(UserError, match="is 5 kPa at 0 s, where a run has to be at rest"):
        check_protocol(held, [channel(rate=1e5)])
    with pytest.raises(UserError, match="is 50 Pa at 0.05 s|is 0.05 kPa at 0.05 s"):
        check_protocol(pressure([0, 10, 20, 30, 40, 50]), [channel(rate=1e5)])


def test_holds_are_counted_between_changes():
    path = pressure(np.concatenate([steps(0, 1e3), steps(2e3, 3e3, 0)]))
    check_protocol(path, [channel(dwell_s=0.09)])
    with pytest.raises(UserError, match="dwell is 0.1 s"):
        check_protocol(path, [channel(dwell_s=0.1)])


@pytest.mark.parametrize(
    ("protocol", "says"),
    [
        (pressure([0.0]), "at least two instants"),
        (pressure([0.0, np.nan, 0.0]), "3 finite values of pressure_pa"),
        (BenchProtocol("raw", "", np.array([0.0, 1.0, 1.0]), {"pressure_pa": np.zeros(3)}), "increase"),
        (
            BenchProtocol("raw", "", np.array([0.0, 1.0]), {"force_n": np.zeros(2)}),
            "the bench has pressure_pa",
        ),
    ],
)
def test_a_protocol_that_is_no_run_is_refused(protocol, says):
    with pytest.raises(UserError, match=says):
        check_protocol(protocol, [channel()])


def test_the_check_agrees_with_the_definition_on_random_paths():
    rng, seen = np.random.default_rng(0), set()
    for _ in range(300):
        times = np.concatenate([[0], np.cumsum(rng.uniform(0.005, 0.02, 40))])
        values = np.concatenate([[0], 15e3 * rng.uniform(-0.02, 1.02, 39).cumsum() / 39, [0]])
        limits = ChannelLimits(0.0, 15e3, 10 ** rng.uniform(4, 6.5), 10 ** rng.uniform(6, 9))
        slopes = np.concatenate([[0], np.diff(values) / np.diff(times), [0]])
        gaps = np.diff(times)[[0, *range(40), -1]]
        keeps = (
            np.all((values >= 0) & (values <= 15e3))
            and np.all(np.abs(slopes) <= limits.rate)
            and np.all(np.abs(np.diff(slopes)) / (0.5 * (gaps[1:] + gaps[:-1])) <= limits.acceleration)
        )
        seen.add(bool(keeps))
        assert (first_violation(times, values, BenchChannel("pressure_pa", limits)) is None) == keeps
    assert seen == {True, False}


def test_the_guard_admits_what_the_check_accepts_with_commands_up_to_a_period_late(hill):
    rng, protocol = np.random.default_rng(1), hill()
    limits = channel(rate=7.9e3, acceleration=12.4e3)
    check_protocol(protocol, [limits])
    guard, sent_s = CommandGuard([limits], PERIOD_S), 0.0
    for due_s in protocol.time_s:
        stalled_s = due_s + rng.choice([0, rng.uniform(0, 0.1)], p=[0.9, 0.1])
        sent_s = max(sent_s, stalled_s if stalled_s > due_s + PERIOD_S else due_s)
        value = float(np.interp(sent_s, protocol.time_s, protocol.commands["pressure_pa"]))
        assert guard.admit(sent_s, {"pressure_pa": value}) is None


@pytest.mark.parametrize(
    ("limits", "values", "limit"),
    [
        ({}, [0, 16e3], "range"),
        ({"rate": 1e5}, [0, 500, 3e3], "rate"),
        ({"acceleration": 1e6}, [0, 0, 0, 500], "acceleration"),
        ({"dwell_s": 0.1}, [0, 100, 100, 100, 0], "dwell"),
    ],
)
def test_the_guard_names_a_command_beyond_a_limit(limits, values, limit):
    guard = CommandGuard([channel(**limits)], PERIOD_S)
    found = [guard.admit(k * PERIOD_S, {"pressure_pa": v}) for k, v in enumerate(values)]
    assert [one is None for one in found] == [True] * (len(values) - 1) + [False]
    assert found[-1].limit == limit
