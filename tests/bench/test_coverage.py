"""Coverage: a verdict holds only where every input went through its allowed range, and the planner goes there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.bench.test_choose import LOAD, PRESSURE, Laboratory, config

from pliant_bench.beliefs import is_poor
from pliant_bench.bench import BenchChannel, BenchProtocol, BenchRecording, ChannelLimits
from pliant_bench.coverage import Coverage
from pliant_bench.limits import check_protocol
from pliant_bench.motions import axes_within
from pliant_bench.protocol_space import ProtocolSpace

PAIR = axes_within(
    [
        BenchChannel("pressure_pa", ChannelLimits(0.0, 15e3, 20e3)),
        BenchChannel("moment_n_m", ChannelLimits(-4e-3, 4e-3, 8e-3)),
    ],
    60.0,
)


def run(
    top_pa: float, moment_n_m: float = 0.0, performed: float = 1.0, angle_rad: float = 0.1
) -> BenchRecording:
    """Return a ramp of pressure and moment, of which this share was performed."""
    clock = np.linspace(0.0, 10.0, 101)
    way = clock / 10.0
    count = round(performed * 101)
    commands = {"pressure_pa": top_pa * way, "moment_n_m": moment_n_m * way}
    done = {name: values[:count] for name, values in commands.items()}
    ending: Any = "complete" if performed == 1.0 else "stopped"
    readings = {"angle_rad": np.full(count, angle_rad)}
    return BenchRecording(
        BenchProtocol("r", "", clock, commands),
        clock[:count],
        clock[:count],
        done,
        readings,
        np.zeros(count, bool),
        ending,
    )


def test_ends_that_no_run_reached_are_missing_on_both_sides_of_rest() -> None:
    coverage = Coverage.from_recordings(PAIR, [run(10e3), run(14e3, 4e-3)], {})
    assert str(coverage) == "moment_n_m below −3.6 mN·m"
    assert str(Coverage.from_recordings(PAIR, [run(10e3)], {})).startswith(
        "pressure_pa above 13.5 kPa, moment_n_m below"
    )
    assert coverage.added_by(run(0.0, -4e-3).protocol) == 1 and coverage.added_by(run(15e3).protocol) == 0


def test_a_run_that_was_cut_short_covers_only_what_it_did() -> None:
    cut = run(15e3, performed=0.5)
    assert "pressure_pa" in Coverage.from_recordings(PAIR, [cut], {}).inputs


def test_where_the_specimen_leaves_its_envelope_no_more_is_asked() -> None:
    cut = run(15e3, performed=0.5, angle_rad=1.2)
    envelope = {"angle_rad": ChannelLimits(-1.0, 1.0)}
    assert "pressure_pa" not in Coverage.from_recordings(PAIR, [cut], envelope).inputs


@pytest.mark.parametrize("seed", range(5))
def test_composed_runs_go_to_all_ends_within_the_limits(seed: int) -> None:
    valve = {"valve_open": {"low": 0.0, "high": 1.0}}
    space = ProtocolSpace.from_settings(config(inputs=PRESSURE | LOAD | valve, longest_run="180 s"))
    coverage = Coverage.from_recordings(space.axes, [], {})
    assert len(coverage.missing) == 4
    rng = np.random.default_rng(seed)
    protocols = [
        space.protocol(space.covering(rng, space.settings[0], coverage.inputs), "r") for _ in range(20)
    ]
    for protocol in protocols:
        check_protocol(protocol, [axis.channel for axis in space.axes])
    assert max(coverage.added_by(one) for one in protocols) == 4


def test_a_wrong_model_is_taken_through_the_whole_range(tmp_path: Path) -> None:
    """The model is wrong, so that what it expects of low pressures is worth little: the next run goes to the top."""
    lab = Laboratory(
        tmp_path,
        "effects: [{kind: mullins, softening: 0.4}, {kind: backlash, play: 4 deg}]\n",
        config(inputs=PRESSURE),
    )
    diagnosis = lab.diagnose(["sensor_scale"])
    assert is_poor(diagnosis)
    recordings = [run(one.commands["pressure_pa"].max()) for one in lab.done]
    axes = ProtocolSpace.from_settings(lab.settings, lab.bench.inputs).axes
    coverage = Coverage.from_recordings(axes[:1], recordings, {})
    assert coverage.missing
    choice = lab.choose(diagnosis, coverage=coverage)
    assert choice.protocol is not None
    assert choice.protocol.commands["pressure_pa"].max() >= 0.9 * axes[0].high
    assert "No run has taken pressure_pa above 13.5 kPa yet" in choice.why
