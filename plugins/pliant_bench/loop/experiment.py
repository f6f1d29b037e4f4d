"""What the loop of an experiment works with: study, bench, folder, planner, person and view."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from pliant import api
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.execution.executors import Workers
from pliant.records.measurement import Measurement
from pliant_bench.bench import Bench, BenchProtocol, BenchRecording, Watch
from pliant_bench.choose import Choice
from pliant_bench.config import ExperimentConfig
from pliant_bench.loop.fit_progress import FitProgress
from pliant_bench.loop.folder import ExperimentFolder
from pliant_bench.loop.person import Person
from pliant_bench.loop.view import View
from pliant_bench.watchdog import Expectation, Watchdog, WatchdogConfig


@dataclass(frozen=True, eq=False)
class Situation:
    """What a planner chooses the next run from.

    Attributes:
        data: all readings so far.
        diagnosis: of these.
        recordings: of all runs.
        minutes_left: of the budget.
        met: once a verdict is stable, the further effects that runs since then would have shown; None before.
        controlled: the first condition was repeated since the verdict was reached.
    """

    data: Measurement
    diagnosis: Diagnosis
    recordings: Sequence[BenchRecording]
    minutes_left: float
    met: Collection[str] | None = None
    controlled: bool = False


class Planner(Protocol):
    """Who chooses the runs."""

    def repeat(self, number: int) -> Choice:
        """Return a repeat of the first condition; `number` from 1."""
        ...

    def next(self, now: Situation) -> Choice:
        """Return the run with the most expected information per minute; without a protocol where none helps.

        A verdict that is stable gets a run that could contradict it.
        """
        ...


@dataclass(frozen=True, eq=False)
class Experiment:
    """What a loop works with; `inputs` are those of the model, `kinds` the candidates of the diagnoses."""

    opened: api.OpenStudy
    settings: ExperimentConfig
    bench: Bench
    folder: ExperimentFolder
    inputs: Sequence[str]
    kinds: Sequence[str]
    planner: Planner
    person: Person
    view: View = field(default_factory=View)
    workers: Workers = None

    def progress(
        self, doing: str, earlier: Mapping[str, Any] | None = None, diagnoses: int = 1
    ) -> FitProgress:
        """Return the progress of a diagnosis or an improvement, which this experiment's view and folder show.

        `earlier` is the verdict before it, whose number of fits and duration are expected again.
        """
        fits = 1 + len(self.kinds) if earlier is None else max(earlier["fits"], 1)
        each_s = 0.0 if earlier is None else earlier["wall_s"] / fits
        run, since = len(self.folder.rounds()), time.time()
        self.folder.write_status(doing=doing, run=run, since=since)

        def publish(progress: FitProgress) -> None:
            self.view.fitting(progress)
            if progress.is_due():
                self.folder.write_status(doing=doing, run=run, since=since, **progress.status())

        return FitProgress(doing, fits, diagnoses, each_s, publish)

    def watches(self, protocol: BenchProtocol, expected: Expectation, is_compared: bool) -> list[Watch]:
        """Return what looks at every sample of a run; a prediction is judged once the model was compared."""
        config = WatchdogConfig(
            self.settings.silence_s,
            {name: envelope.limits(name) for name, envelope in self.settings.outputs.items()},
            self.settings.missed_prediction if is_compared else None,
        )
        return [self.view.sample, Watchdog(protocol, config, expected)]
