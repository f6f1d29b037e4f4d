"""A study's own runs: allowed keys of each, and one-sentence refusals."""

from __future__ import annotations

import numpy as np
import pytest
from tests.diagnosis.quick import joint

from pliant.config.loading import load_study
from pliant.config.schema import study_schema
from pliant.errors import UserError
from pliant.experiments.experiment_catalogue import planned_runs, timed_catalogue
from pliant.experiments.planned_run import NEW, BenchScale
from pliant.records.chain import Actuator
from pliant.registry.discovery import discover

REGISTRY = discover()
SCALE = BenchScale.from_chain(joint(), 15e3)
STUDY = "pliant: 1\nname: joint\nprotocols:\n"


@pytest.fixture
def runs(tmp_path):
    """Return the runs of a `protocols` block."""

    def read(*lines: str, scale: BenchScale = SCALE):
        path = tmp_path / "study.yaml"
        path.write_text(STUDY + "".join(f"  - {line}\n" for line in lines))
        return planned_runs(load_study(path, REGISTRY).protocols, scale)

    return read


def test_runs_in_the_menu_take_what_is_different(runs) -> None:
    holds, slow, named = runs(
        "{run: holds, levels: [5 kPa, 10 kPa], hold: 30 s, minutes: 8}",
        "{run: slow_cycles, period: 160 s, cycles: 3}",
        "{run: slow_cycles, name: half, amplitudes: [0.5], words: cycle once to the half}",
    )
    assert holds.minutes == 8.0
    assert holds.history.actuation["pressure_pa"].max() == pytest.approx(10e3)
    assert holds.motion_minutes == pytest.approx(1.5)
    assert slow.motion_minutes == pytest.approx(8.0)
    assert "160 s per cycle, 3 times" in slow.words
    assert (named.name, named.history.run, named.words) == ("half", "half", "cycle once to the half")
    assert named.history.actuation["pressure_pa"].max() == pytest.approx(7.5e3)


def test_a_custom_run_is_what_it_says(runs) -> None:
    (run,) = runs(
        "{run: custom, name: push, times: [0, 10 s, 20 s], inputs: {pressure_pa: [0, 5 kPa, 5 kPa]}, "
        "moments: [0, 0, 2 mN*m], pitch: 90 deg, temperature_c: 30, new_specimen: true}"
    )
    history = run.history
    assert history.specimen == NEW
    assert history.actuation["pressure_pa"][10] == pytest.approx(2.5e3)
    assert history.moment_n_m[-1] == pytest.approx(2e-3)
    assert history.temperature_c[0] == 30.0
    np.testing.assert_allclose(history.base_angles_rad[0], [0.0, np.pi / 2, 0.0])


def test_without_a_block_it_is_the_menu() -> None:
    assert [run.name for run in planned_runs((), SCALE)] == [run.name for run in timed_catalogue(SCALE)]


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("{run: slow_cycle}", "there is no run 'slow_cycle'; did you mean 'slow_cycles'"),
        ("{run: holds, period: 80 s}", "takes no 'period'; it takes levels, hold"),
        ("{run: holds, levels: [5 m/s]}", "5 m/s"),
        ("{run: holds, hold: -3 s}", "greater than 0"),
        ("{run: holds, levles: [1]}", "did you mean 'levels'"),
        ("{run: slow_cycles, cycles: 0}", "greater than or equal to 1"),
        ("{run: slow_cycles, cycles: 3, amplitudes: [1, 1]}", "2 amplitudes for 3 cycles"),
        ("{run: custom, times: [0, 1], inputs: {pressure_pa: [0, 1]}}", "needs a 'name'"),
        ("{run: custom, name: a, inputs: {pressure_pa: [0, 1]}}", "needs 'times'"),
        ("{run: custom, name: a, times: [0, 2, 1], inputs: {pressure_pa: [0, 1, 0]}}", "must increase"),
        ("{run: custom, name: a, times: [0, 2], inputs: {pressure_pa: [0, 1, 0]}}", "3 values for 2 times"),
        ("{run: custom, name: a, times: [0, 2]}", "needs 'inputs'"),
        ("{minutes: 3}", "run"),
        ("slow_cycles", "protocols"),
    ],
)
def test_wrong_blocks_are_a_sentence_with_their_line(runs, line, says) -> None:
    with pytest.raises(UserError) as error:
        runs(line)
    assert says in str(error.value)
    assert "study.yaml, line " in str(error.value)


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (["{run: holds, levels: [5 N]}"], "protocols\\[0\\]"),
        (["{run: holds}", "{run: holds}"], "twice"),
        (
            ["{run: custom, name: a, times: [0, 2], inputs: {presure_pa: [0, 1]}}"],
            "did you mean 'pressure_pa'",
        ),
    ],
)
def test_what_this_chain_cannot_do_is_refused(runs, lines, says) -> None:
    with pytest.raises(UserError, match=says):
        runs(*lines)


def test_a_run_that_makes_no_sense_for_a_tendon_is_refused(runs) -> None:
    tendon = BenchScale.from_chain(joint().with_(actuators=(Actuator("tendon_force_n"),)), 9.0)
    with pytest.raises(UserError, match="makes no sense for this chain"):
        runs("{run: closed_valve}", scale=tendon)


def test_the_schema_knows_protocols() -> None:
    text = str(study_schema(REGISTRY)["properties"]["protocols"])
    assert "ProtocolConfig" in text
