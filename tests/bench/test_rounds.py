"""The closed loop on the simulated bench: it ends with the hidden effect, and goes on after any interruption."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from tests.bench.joint_study import write_study
from tests.bench.plain_bench import PlainBench

from pliant import api
from pliant_bench.bench import BenchRecording, BenchSample, ConnectionLostError
from pliant_bench.choose import Choice, SearchEffort
from pliant_bench.config import ExperimentConfig
from pliant_bench.loop.compared import fall_of_error, read_bands
from pliant_bench.loop.decision import Ended
from pliant_bench.loop.experiment import Experiment, Situation
from pliant_bench.loop.folder import ExperimentFolder, RoundFolder, read_columns
from pliant_bench.loop.person import Nobody
from pliant_bench.loop.planner import CONTROL, TellingPlanner, model_inputs
from pliant_bench.loop.report_charts import runs_chart
from pliant_bench.loop.rounds import run_rounds, situation
from pliant_bench.loop.view import View

BENCH = """\
bench: {kind: simulated, truth: truth.yaml, noise: {angle_rad: 0.3 deg}}
experiment:
  inputs: {pressure_pa: {low: 0 kPa, high: 15 kPa, rate: 15 kPa/s}}
  period: 0.1 s
  longest_run: 30 s
"""
TRUTH = "effects: [{kind: viscous_damping, time: 0.3 s}]\n"
KINDS = ["viscous_damping", "sensor_scale"]
QUICK = SearchEffort(random=6, elsewhere=2, settings=1, generations=1, children=3)


def write_studies(folder: Path) -> Path:
    write_study(folder, TRUTH, "truth.yaml")
    return write_study(folder, BENCH)


class KillingView(View):
    """A view that interrupts the program at its n-th event."""

    def __init__(self, last: float) -> None:
        self.events, self.last = 0, last

    def _count(self, *_: Any) -> None:
        self.events += 1
        if self.events >= self.last:
            raise KeyboardInterrupt

    planned = sample = recorded = fitting = diagnosed = _count


def loop(
    folder: Path,
    path: Path,
    view: View | None = None,
    planner: Callable[..., TellingPlanner] = TellingPlanner,
) -> tuple[Any, ExperimentFolder]:
    opened = api.open_study(path, store=folder.parent / "store")
    settings, bench = opened.study.experiment, opened.context.build("bench", opened.study.bench)
    bench.connect()
    experiment = ExperimentFolder(folder)
    experiment.begin({"study": opened.study.name})
    end = run_rounds(
        Experiment(
            opened,
            settings,
            bench,
            experiment,
            model_inputs(opened),
            KINDS,
            planner(opened, settings, bench, QUICK),
            Nobody(),
            view or View(),
        )
    )
    return end, experiment


def verdict(folder: ExperimentFolder) -> Mapping[str, Any]:
    return [one for f in folder.rounds() if (one := f.read("verdict")) is not None][-1]


def rows(folder: RoundFolder) -> int:
    return len(folder.recording.read_text().splitlines()) - 1 if folder.recording.exists() else 0


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any, ExperimentFolder, int]:
    path = write_studies(tmp_path_factory.mktemp("study"))
    view = KillingView(np.inf)
    end, folder = loop(path.parent / "whole", path, view)
    return path, end, folder, view.events


def test_the_hidden_effect_is_named(whole: tuple[Path, Any, ExperimentFolder, int]) -> None:
    _, end, folder, _ = whole
    found = verdict(folder)
    assert end.why == "verdict"
    assert (found["verdict"], found["selected"]) == ("missing_effect", ["viscous_damping"])


def test_a_verdict_ends_only_after_the_whole_range(whole: tuple[Path, Any, ExperimentFolder, int]) -> None:
    _, end, folder, _ = whole
    tops = [one.read_protocol().commands["pressure_pa"].max() for one in folder.rounds()]
    assert max(tops[:3]) < 0.9 * 15e3 <= max(tops)
    *earlier, last = folder.rounds()
    assert (last.read("end") or {})["why"] in end.sentence
    assert all(one.read("end") is None for one in earlier)


def test_the_last_run_is_a_control(whole: tuple[Path, Any, ExperimentFolder, int]) -> None:
    """The first condition is repeated before the end, after the verdict was reached."""
    rounds = whole[2].rounds()
    first, last = (one.read_protocol().commands["pressure_pa"] for one in (rounds[0], rounds[-1]))
    np.testing.assert_array_equal(first, last)
    plan = rounds[-1].read("plan") or {}
    assert (plan["kind"], plan["purpose"], plan["why"]) == ("chosen", "repeat", CONTROL)
    settings = ExperimentConfig(inputs={"pressure_pa": {"high": 15e3}})

    def controlled(count: int, last_verdict: str = "missing_effect") -> bool:
        some = [cast(RoundFolder, Judged(one, one.read("verdict"))) for one in rounds[:count]]
        if last_verdict != "missing_effect":
            some[-1] = cast(RoundFolder, Judged(rounds[count - 1], {"verdict": last_verdict}))
        now = situation(some, settings, cast(Any, None), cast(Any, None), 1.0)
        return now.controlled

    assert not controlled(len(rounds) - 1) and controlled(len(rounds))
    assert not controlled(
        len(rounds), "unknown_effect"
    )  # the control changed the verdict: the next one needs its own


@dataclass
class Judged:
    """A run's folder with a verdict of the test's."""

    folder: RoundFolder
    verdict: Mapping[str, Any] | None

    def read(self, name: str) -> Mapping[str, Any] | None:
        return self.verdict if name == "verdict" else self.folder.read(name)

    def read_recording(self) -> BenchRecording:
        return self.folder.read_recording()


def test_a_verdict_that_holds_meets_the_runs_that_could_contradict_it(
    whole: tuple[Path, Any, ExperimentFolder, int], tmp_path: Path
) -> None:
    asked = []

    class Doubting(TellingPlanner):
        """A planner that has one further run for a verdict that holds."""

        def next(self, now: Situation) -> Choice:
            met = now.met
            if met is None:
                return super().next(now)
            asked.append(met)
            if "sensor_scale" in met:
                return Choice(None, "expose", "Nothing is left.")
            return replace(self.repeat(1), purpose="expose", exposes=("sensor_scale",))

    end, folder = loop(tmp_path / "doubted", whole[0], planner=Doubting)
    assert end.why == "verdict" and end.sentence.endswith("Nothing is left.")
    assert ["sensor_scale" in met for met in asked] == [
        False,
        False,
        True,
    ]  # two runs that would have shown it
    assert (folder.rounds()[-1].read("plan") or {})["exposes"] == ["sensor_scale"]
    again, _ = loop(tmp_path / "doubted", whole[0], planner=Doubting)
    assert again == end and len(asked) == 3  # the end is on disk


def test_what_was_compared_is_on_disk_with_and_without_the_effect(
    whole: tuple[Path, Any, ExperimentFolder, int],
) -> None:
    for one in whole[2].rounds():
        plain, explained = read_bands(one)["angle_rad"]
        assert explained.name == "with viscous_damping"
        samples = read_columns(one.samples)
        measured = np.interp(plain.time_s, samples["read_s"], samples["angle_rad"])
        errors = [np.sqrt(np.mean((measured - model.mean) ** 2)) for model in (plain, explained)]
        assert errors[1] < 0.6 * errors[0]
        assert fall_of_error(one)["angle_rad"] == pytest.approx(errors[0] - errors[1], rel=1e-3)
        inside = np.abs(measured - explained.mean) < 2.0 * explained.sd
        assert inside.mean() > 0.85
    drawn = runs_chart(whole[2].rounds(), "angle_rad")
    assert drawn is not None and len(drawn.panels) == 2 * len(whole[2].rounds())
    upper, lower = drawn.panels[:2]
    models = ["the study's model", "with viscous_damping"]
    names = {*models, *(f"{name} ± 2 sd" for name in models), "measured"}
    assert {mark.name for mark in upper.marks} == names
    assert lower.y.label == "error" and len(lower.lines) == 2


def test_every_step_is_on_disk(whole: tuple[Path, Any, ExperimentFolder, int]) -> None:
    folder = whole[2]
    for one in folder.rounds():
        plan = one.read("plan") or {}
        assert plan["why"] and plan["minutes"] > 0.0
        assert (one.read("recording") or {})["ending"] == "complete"
        assert rows(one) == len(one.read_protocol())
    assert json.loads((folder.path / "status.json").read_text())["doing"] == "planning"


@pytest.mark.parametrize("share", [0.02, 0.3, 0.55, 0.8, 0.97])
def test_an_interrupted_experiment_goes_on(
    whole: tuple[Path, Any, ExperimentFolder, int], tmp_path: Path, share: float
) -> None:
    path, end, uninterrupted, events = whole
    view = KillingView(max(1, round(share * events)))
    with pytest.raises(KeyboardInterrupt):
        loop(tmp_path / "killed", path, view)
    folder = ExperimentFolder(tmp_path / "killed")
    before = {one.number: one.samples.read_text() for one in folder.rounds() if one.samples.exists()}
    again, _ = loop(tmp_path / "killed", path)
    assert again.why == end.why
    assert verdict(folder)["selected"] == verdict(uninterrupted)["selected"]
    for one in folder.rounds():
        if one.number in before:
            assert one.samples.read_text() == before[one.number]  # nothing was lost


def test_a_sample_is_on_disk_before_it_is_looked_at(tmp_path: Path) -> None:
    path = write_studies(tmp_path)
    folder = ExperimentFolder(tmp_path / "experiment")
    seen = []

    class Looking(View):
        def sample(self, sample: BenchSample) -> None:
            seen.append(len(folder.rounds()[-1].samples.read_text().splitlines()) - 1 == sample.index + 1)
            if len(seen) > 20:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        loop(folder.path, path, Looking())
    assert all(seen)


def test_a_lost_bench_ends_the_experiment_and_the_same_command_goes_on(tmp_path: Path) -> None:
    path = write_studies(tmp_path)
    opened = api.open_study(path, store=tmp_path / "store")
    settings = opened.study.experiment

    def lose(index: int) -> None:
        if index == 20:
            raise ConnectionLostError("The cable is out.")

    def done(before: Callable[[int], None]) -> tuple[Ended, ExperimentFolder]:
        bench = PlainBench(before=before)
        folder = ExperimentFolder(tmp_path / "experiment")
        planner = TellingPlanner(opened, settings, bench, QUICK)
        inputs = model_inputs(opened)
        return run_rounds(
            Experiment(opened, settings, bench, folder, inputs, KINDS, planner, Nobody())
        ), folder

    end, folder = done(lose)
    assert end.why == "bench" and "The cable is out." in end.sentence
    assert [(one.read("recording") or {})["samples"] for one in folder.rounds()] == [20]
    end, folder = done(lambda index: None)
    assert end.why != "bench" and len(folder.rounds()) > 3


def test_the_loop_gives_the_bench_the_limits_of_the_study(tmp_path: Path) -> None:
    path = write_studies(tmp_path)
    path.write_text(path.read_text().replace("high: 15 kPa", "high: 6 kPa"))
    opened = api.open_study(path, store=tmp_path / "store")
    bench, settings = PlainBench(before=stop_at_once), opened.study.experiment
    folder, planner = (
        ExperimentFolder(tmp_path / "experiment"),
        TellingPlanner(opened, settings, bench, QUICK),
    )
    run_rounds(Experiment(opened, settings, bench, folder, ["pressure_pa"], KINDS, planner, Nobody()))
    assert bench.limited_inputs[0].limits.high == 6e3
    assert folder.rounds()[0].read_protocol().commands["pressure_pa"].max() < 6e3


def stop_at_once(index: int) -> None:
    raise ConnectionLostError("The cable is out.")
