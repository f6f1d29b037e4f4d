"""The planner that chosen runs are compared with, and the minutes of the fixed rich protocol."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.bench.bed_bench import BedBench, protocol_from_bed
from benchmarks.evidence.protocols import protocol

from pliant_bench.bench import BenchProtocol
from pliant_bench.choose import Choice
from pliant_bench.config import ExperimentConfig
from pliant_bench.loop.experiment import Situation
from pliant_bench.loop.planner import CONTROL, TellingPlanner
from pliant_bench.protocol_space import ProtocolSpace, changed

ARMS = ("chosen", "random")
# Share of random runs for which one condition changes: as many as of the rich protocol's runs.
ANOTHER_SETTING = 0.25


@dataclass(frozen=True)
class RandomRuns:
    """Random runs of the space, where one condition changes now and then; it ends when the chosen runs would end."""

    chosen: TellingPlanner
    settings: ExperimentConfig
    bench: BedBench

    def repeat(self, number: int) -> Choice:
        """Return a repeat of the first condition, as for chosen runs."""
        return self.chosen.repeat(number)

    def next(self, now: Situation) -> Choice:
        """Return a random run, or the choice of the other planner where that ends the experiment or is a control."""
        choice = self.chosen.next(now)
        if choice.protocol is None or not choice.splits or choice.why == CONTROL:
            return choice
        space = ProtocolSpace.from_settings(self.settings, self.bench.inputs)
        rng = np.random.default_rng([self.bench.seed, len(now.recordings)])
        standing = {name: now.recordings[-1].protocol.conditions[name] for name in self.settings.manual}
        near = [one for one in space.settings if changed(one, standing) == 1]
        another = rng.uniform() < ANOTHER_SETTING and bool(near)
        setting = near[int(rng.integers(len(near)))] if another else standing
        run = space.protocol(space.random(rng, setting), "random")
        taken = minutes(run, standing, self.settings)
        return Choice(run, choice.purpose, "a random run", 0.0, taken, exposes=choice.exposes)


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
