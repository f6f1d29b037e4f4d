"""The planners that are compared: chosen runs, random runs of the same space, and the rich protocol in its order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from benchmarks.bench.bed_bench import BedBench, protocol_from_bed
from benchmarks.evidence.protocols import protocol

from pliant.diagnosis.diagnosis import Diagnosis
from pliant_bench.bench import BenchProtocol
from pliant_bench.choose import Choice
from pliant_bench.config import ExperimentConfig
from pliant_bench.loop.experiment import Planner, Situation
from pliant_bench.loop.planner import first_repeat
from pliant_bench.protocol_space import ProtocolSpace, changed

ARMS = ("chosen", "random", "rich")
# Share of random runs for which one condition changes: as many as of the rich protocol's runs.
ANOTHER_SETTING = 0.25


@dataclass
class UntilRight:
    """A planner that ends once its verdict has been right for some rounds, which only a judge can know.

    It does the planners a favour that are compared with the chosen runs: they need not find out that no run would split
    the class that is left.
    """

    planner: Planner
    is_right: Callable[[Diagnosis], bool]
    rounds: int
    held: int = 0

    def repeat(self, number: int) -> Choice:
        """Return a repeat of the first condition."""
        return self.planner.repeat(number)

    def next(self, now: Situation) -> Choice:
        """Return the planner's next run, or none."""
        if now.met is not None:  # a verdict is stable
            return Choice(None, "expose", "")
        self.held = self.held + 1 if self.is_right(now.diagnosis) else 0
        if self.held >= self.rounds:
            return Choice(None, "expose", "The verdict is right.")
        return self.planner.next(now)


@dataclass(frozen=True)
class RandomRuns:
    """Random runs of the space; now and then one condition changes."""

    settings: ExperimentConfig
    bench: BedBench

    def repeat(self, number: int) -> Choice:
        """Return a repeat of the first condition, as for chosen runs."""
        return first_repeat(self.settings, self.bench)

    def next(self, now: Situation) -> Choice:
        """Return a random run."""
        space = ProtocolSpace.from_settings(self.settings, self.bench.inputs)
        rng = np.random.default_rng([self.bench.seed, len(now.recordings)])
        standing = {name: now.recordings[-1].protocol.conditions[name] for name in self.settings.manual}
        near = [one for one in space.settings if changed(one, standing) == 1]
        another = rng.uniform() < ANOTHER_SETTING and bool(near)
        setting = near[int(rng.integers(len(near)))] if another else standing
        run = space.protocol(space.random(rng, setting), "random")
        return Choice(run, "decide", "a random run", 0.0, minutes(run, standing, self.settings))


@dataclass(frozen=True)
class RichRuns:
    """The runs of the rich protocol in their order, both specimens."""

    settings: ExperimentConfig
    bench: BedBench

    def repeat(self, number: int) -> Choice:
        """Return the run of this number."""
        return self._run(number, {})

    def next(self, now: Situation) -> Choice:
        """Return the next run; none after the last."""
        done = now.recordings
        if len(done) == len(protocol("rich", self.bench.robot)):
            return Choice(None, "expose", "The rich protocol is done.")
        return self._run(len(done) + 1, dict(done[-1].protocol.conditions))

    def _run(self, number: int, standing: dict[str, float]) -> Choice:
        runs = rich_protocols(self.bench)
        run = runs[number - 1]
        before = dict(runs[number - 2].conditions) if number > 1 else dict(run.conditions)
        return Choice(
            run, "decide", "the rich protocol", 0.0, minutes(run, standing or before, self.settings)
        )


def rich_protocols(bench: BedBench) -> list[BenchProtocol]:
    """Return the rich protocol for the bench."""
    runs = protocol("rich", bench.robot)
    new = [k > 0 and run.specimen != runs[k - 1].specimen for k, run in enumerate(runs)]
    return [protocol_from_bed(run, bench.robot, k + 1, new[k]) for k, run in enumerate(runs)]


def minutes(run: BenchProtocol, standing: dict[str, float], settings: ExperimentConfig) -> float:
    """Return the minutes of a run: motion, setting up, and a person's work, also for a new specimen."""
    visits = changed(run.conditions, standing) + run.new_specimen
    return settings.set_up_minutes + run.duration_s / 60.0 + settings.manual_minutes * visits


def rich_minutes(bench: BedBench, settings: ExperimentConfig) -> float:
    """Return the minutes of the whole rich protocol."""
    runs = rich_protocols(bench)
    before = [dict(runs[0].conditions), *(dict(one.conditions) for one in runs[:-1])]
    return sum(minutes(run, standing, settings) for run, standing in zip(runs, before, strict=True))
