"""What was done of a run: a sentence, a protocol and minutes of the motion that happened, not of the planned one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.bench.plain_bench import PlainBench
from tests.bench.test_folder import begun, protocol

from pliant_bench.bench import BenchProtocol, BenchRecording, RunStoppedError
from pliant_bench.loop.decision import Ended
from pliant_bench.loop.folder import ExperimentFolder
from pliant_bench.loop.live import LiveState
from pliant_bench.loop.perform import perform
from pliant_bench.loop.report import experiment_document
from pliant_bench.loop.rounds import run_minutes
from pliant_bench.performed import performed, performed_minutes, performed_words, turning_levels


def recording(
    count: int, ending: str = "stopped", levels: tuple[float, ...] = (0.0, 12e3, 3e3, 12e3, 0.0)
) -> BenchRecording:
    """Return a run of 40 s through these levels that ended after `count` of its 401 samples."""
    clock = 0.1 * np.arange(401)
    pressure = np.interp(clock, np.linspace(0.0, 40.0, len(levels)), levels)
    planned = BenchProtocol(
        "run 4", "two cycles to 12 kPa", clock, {"pressure_pa": pressure, "moment_n_m": 0.0 * clock}
    )
    cut = {name: values[:count] for name, values in planned.commands.items()}
    return BenchRecording(
        planned,
        clock[:count],
        clock[:count],
        cut,
        {"angle_rad": cut["pressure_pa"] / 15e3},
        np.zeros(count, bool),
        ending,
    )  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("count", "words"),
    [
        (
            51,
            "cut short after 5 of 40 s: pressure_pa went from 0 kPa to 6 kPa and moment_n_m stayed at 0 mN·m, then it "
            "was vented",
        ),
        (
            151,
            "cut short after 15 of 40 s: pressure_pa went from 0 kPa to 12 kPa, 7.5 kPa and moment_n_m stayed at 0 "
            "mN·m, then it was vented",
        ),
        (0, "cut short before its first sample, of 40 s"),
    ],
)
def test_a_run_that_was_cut_short_is_described_by_what_happened(count: int, words: str) -> None:
    assert performed_words(recording(count)) == words


def test_many_reversals_are_told_by_their_range() -> None:
    cycles = recording(399, "lost", tuple(np.tile([0.0, 9e3], 8)))
    assert "pressure_pa went 15 times between 0 kPa and 9 kPa" in performed_words(cycles)
    assert "vented" not in performed_words(cycles)  # of a lost bench it is not known


def test_a_complete_run_keeps_its_words_protocol_and_minutes() -> None:
    whole = recording(401, "complete")
    assert performed_words(whole) == "two cycles to 12 kPa"
    assert performed(whole) is whole.protocol and performed_minutes(whole, 0.9) == 0.9


def test_the_protocol_and_the_minutes_are_those_that_were_performed() -> None:
    cut = recording(151)
    assert performed(cut).duration_s == pytest.approx(15.0)
    assert performed(cut).commands["pressure_pa"].max() == pytest.approx(12e3)
    assert performed_minutes(cut, 0.2 + 40.0 / 60.0) == pytest.approx(0.2 + 15.0 / 60.0)
    assert performed(replace(cut, commanded_s=np.full(151, np.nan))).commands["pressure_pa"].size == 0


def test_a_small_wobble_is_no_reversal() -> None:
    values = np.array([0.0, 5.0, 4.95, 10.0, 2.0])
    assert turning_levels(values, 0.2) == [0.0, 10.0, 2.0]


def test_the_watchdog_leaves_the_motion_that_happened_in_folder_and_page(tmp_path: Path) -> None:
    folder, one = begun(tmp_path)

    def refuse(index: int) -> None:
        if index == 20:
            raise RunStoppedError("angle_rad was 1 rad.")

    perform(PlainBench(before=refuse), protocol(), folder, one, [])
    (warned,) = experiment_document("finger", folder, Ended("stopped", "It ended."), 1.0, None).warnings
    assert warned.sentence.startswith(
        "Run 1 was cut short after 1.9 of 3.9 s: pressure_pa went from 0 kPa to 1.9 kPa"
    )
    shown = LiveState(ExperimentFolder(tmp_path)).read()["runs"][0]
    assert shown["words"].startswith("cut short after 1.9 of 3.9 s: pressure_pa went from 0 kPa to 1.9 kPa")
    assert shown["minutes"] == pytest.approx(run_minutes(one)) == pytest.approx(1.0 - 2.0 / 60.0)
