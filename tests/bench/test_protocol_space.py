"""The space of runs: every member keeps all limits, whatever its numbers; conversions to planned runs and back."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.records.design import Array
from pliant_bench.bench import BenchChannel, BenchProtocol, ChannelLimits
from pliant_bench.config import ExperimentConfig
from pliant_bench.motions import Move
from pliant_bench.performed import turning_levels
from pliant_bench.plans import planned_from_protocol, protocol_from_planned
from pliant_bench.protocol_space import ProtocolSpace, Segment, SpaceMember, changed

INPUTS = {
    "pressure_1_pa": {"high": "15 kPa", "rate": "5 kPa/s", "acceleration": "20 kPa/s^2", "dwell": "0.7 s"},
    "pressure_2_pa": {"low": "-5 kPa", "high": "10 kPa", "rate": "40 kPa/s"},
    "moment_n_m": {"low": "-4 mN*m", "high": "4 mN*m", "dwell": "1 s"},
    "valve_open": {"low": 0, "high": 1},
}
LIMITED = {name: INPUTS[name] for name in INPUTS if name != "valve_open"}


def config(**settings: Any) -> ExperimentConfig:
    return ExperimentConfig.model_validate({"inputs": INPUTS, "longest_run": "90 s", **settings})


def exceeds(values: Array, clock: Array, channel: BenchChannel) -> str:
    """Return the limit that a path exceeds, by differences of its samples; "" if it keeps all."""
    limits, near = channel.limits, 1.0 + 1e-6
    steps = np.diff(clock)
    slopes = np.concatenate([[0.0], np.diff(values) / steps, [0.0]])
    if values.min() < limits.low - 1e-9 or values.max() > limits.high * near:
        return "range"
    if np.abs(slopes).max() > limits.rate * near:
        return "rate"
    if np.abs(np.diff(slopes)).max() / steps[0] > limits.acceleration * near:
        return "acceleration"
    moving = np.flatnonzero(np.abs(np.diff(values)) > 1e-9 * max(np.ptp(values), 1e-300))
    for before, after in itertools.pairwise(moving.tolist()):
        goes_on = after == before + 1 and slopes[before + 1] * slopes[after + 1] > 0.0
        if not goes_on and clock[after] - clock[before + 1] < limits.dwell_s / near:
            return "dwell"
    return ""


@pytest.mark.parametrize("period", ["20 ms", "50 ms", "0.4 s"])
def test_hundreds_of_random_members_keep_every_limit(period: str) -> None:
    space = ProtocolSpace.from_settings(config(period=period))
    rng = np.random.default_rng(1)
    moved = 0
    for k in range(300):
        protocol = space.protocol(space.random(rng, {}), f"run {k}")
        assert protocol.duration_s <= 90.0 + 1e-9
        assert set(protocol.commands) == set(INPUTS)
        for axis in space.axes:
            values = protocol.commands[axis.channel.name]
            assert exceeds(values, protocol.time_s, axis.channel) == "", (k, axis.channel.name)
            assert values[0] == axis.channel.rest and values[-1] == pytest.approx(axis.channel.rest, abs=1e-9)
        moved += any(np.ptp(values) > 0.0 for values in protocol.commands.values())
    assert moved > 250


def test_changed_numbers_keep_the_limits_and_change_the_run() -> None:
    space = ProtocolSpace.from_settings(config())
    rng = np.random.default_rng(2)
    different = 0
    for _ in range(100):
        member = space.random(rng, {})
        far = member.with_numbers(member.numbers + 3.0 * rng.standard_normal(len(member.numbers)))
        assert far.numbers.min() >= 0.0 and far.numbers.max() <= 1.0
        one, other = space.protocol(member, "a"), space.protocol(far, "b")
        different += len(one) != len(other) or any(
            not np.allclose(one.commands[name], other.commands[name]) for name in INPUTS
        )
        for axis in space.axes:
            assert exceeds(other.commands[axis.channel.name], other.time_s, axis.channel) == ""
    assert different > 80


def test_slow_inputs_move_as_far_as_they_can() -> None:
    slow = {
        "inputs": {"pressure_pa": {"high": "100 kPa", "rate": "0.2 kPa/s", "acceleration": "0.05 kPa/s^2"}}
    }
    space = ProtocolSpace.from_settings(config(**slow))
    rng = np.random.default_rng(3)
    tops = [space.protocol(space.random(rng, {}), "a").commands["pressure_pa"].max() for _ in range(60)]
    assert max(tops) > 1e3  # of 4.5 kPa that could be reached and left within 90 s at most


@pytest.mark.parametrize(
    ("longest_s", "words"),
    [
        (30, "half a sine wave of pressure_pa to 12 kPa"),
        (50, "1 sine wave of pressure_pa between 0 kPa and 12 kPa"),
        (75, "1.5 sine waves of pressure_pa between 0 kPa and 12 kPa"),
        (300, "2 sine waves of pressure_pa between 0 kPa and 12 kPa"),
    ],
)
def test_what_does_not_fit_into_the_longest_run_is_not_in_its_words(longest_s: float, words: str) -> None:
    pressure = {"pressure_pa": {"high": "12 kPa", "rate": "10 kPa/s"}}
    space = ProtocolSpace.from_settings(config(inputs=pressure, longest_run=longest_s))
    waves = Segment("waves", ("pressure_pa",), (1.0, 0.0, 0.4, 0.5, 0.3))
    protocol = space.protocol(SpaceMember((waves,), 1.0), "a")
    turns = turning_levels(protocol.commands["pressure_pa"], 100.0)
    assert (
        protocol.words.startswith(words) and len(turns) - 1 == {30: 2, 50: 2, 75: 4, 300: 4}[int(longest_s)]
    )


@pytest.mark.parametrize(
    ("fits", "words"), [(1, "fill pressure_pa to 9 kPa"), (2, "close the valve for 5 s"), (3, "and open it")]
)
def test_a_valve_that_is_not_opened_again_is_not_said_to_be(fits: int, words: str) -> None:
    moves = [
        Move({"pressure_pa": 9e3}, 0.5, 2.0),
        Move({"valve_open": 0.0}, 1.0, 5.0),
        Move({"valve_open": 1.0}, 1.0, 1.0),
    ]
    space = ProtocolSpace.from_settings(config(inputs={"pressure_pa": {"high": "12 kPa"}}))
    said = space._words(Segment("closed", ("pressure_pa",), (1.0,) * 5), moves[:fits])
    assert said.endswith(words)


def test_the_same_seed_gives_the_same_runs() -> None:
    space = ProtocolSpace.from_settings(config())
    first, second = (space.random(np.random.default_rng(5), {}) for _ in range(2))
    assert first == second and space.protocol(first, "a").words == space.protocol(second, "a").words


def test_settings_are_all_combinations_and_the_first_is_the_present_one() -> None:
    space = ProtocolSpace.from_settings(
        config(manual={"payload_kg": [0, "50 g"], "base_pitch_rad": [0, "90 deg"]})
    )
    assert len(space.settings) == 4 and space.settings[0] == {"payload_kg": 0.0, "base_pitch_rad": 0.0}
    assert [changed(one, space.settings[0]) for one in space.settings] == [0, 1, 1, 2]
    assert space.settings[-1]["payload_kg"] == pytest.approx(0.05)


def test_the_driver_limits_are_kept_too() -> None:
    driver = [BenchChannel(name, ChannelLimits(-3e3, 6e3, 1e3)) for name in LIMITED]
    settings = config(inputs={name: INPUTS[name] for name in LIMITED if name != "moment_n_m"})
    space = ProtocolSpace.from_settings(settings, driver)
    assert [(axis.low, axis.high) for axis in space.axes[:2]] == [(0.0, 6e3), (-3e3, 6e3)]
    assert all(axis.channel.limits.rate == 1e3 for axis in space.axes[:2])


def test_limits_of_an_unknown_input_and_an_input_without_range_are_user_errors() -> None:
    with pytest.raises(UserError, match="presure"):
        ProtocolSpace.from_settings(
            config(inputs={"presure_pa": {"high": 1.0}}), [BenchChannel("pressure_pa")]
        )
    with pytest.raises(UserError, match="has no range"):
        ProtocolSpace.from_settings(
            config(), [*map(BenchChannel, INPUTS), BenchChannel("pressure_3_pa", ChannelLimits(0.0))]
        )


def test_a_planned_run_has_few_samples_and_the_same_inputs() -> None:
    space = ProtocolSpace.from_settings(config(period="10 ms"))
    rng = np.random.default_rng(4)
    for k in range(40):
        protocol = space.protocol(space.random(rng, {"payload_kg": 0.05}), f"run {k}")
        run = planned_from_protocol(protocol, ["pressure_1_pa", "pressure_2_pa"], 1.5, "A")
        history = run.history
        assert history.time_s is not None and len(history) < 700
        for name, values in history.signals().items():
            if name in protocol.commands and name != "valve_open":
                whole = protocol.commands[name]
                between = np.interp(protocol.time_s, history.time_s, values)
                assert np.abs(between - whole).max() <= 0.031 * max(np.ptp(whole), 1e-12)
        assert history.payload_kg is not None and history.payload_kg[0] == 0.05


def test_a_planned_run_returns_to_the_bench_with_its_conditions() -> None:
    space = ProtocolSpace.from_settings(config())
    member = space.random(np.random.default_rng(7), {"payload_kg": 0.05})
    before = space.protocol(member, "a")
    planned = planned_from_protocol(before, ["pressure_1_pa", "pressure_2_pa"], 1.0, "A")
    after = protocol_from_planned(planned, list(INPUTS), space.period_s)
    assert isinstance(after, BenchProtocol) and after.conditions["payload_kg"] == 0.05
    for name, values in before.commands.items():
        close = 0.031 * max(np.ptp(values), 1e-12)
        assert np.abs(np.interp(before.time_s, after.time_s, after.commands[name]) - values).max() <= close
