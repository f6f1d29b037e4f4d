"""A study open on the page: the model driven by the runs, the held-out runs, and the model's errors."""

from __future__ import annotations

import json
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pliant import api
from pliant.config.study import Study
from pliant.diagnosis.data_split import TrainTestSplit, extend_split, split_runs
from pliant.diagnosis.extension import Ground
from pliant.diagnosis.noise import NoiseView, noise_view
from pliant.diagnosis.readings import Score, score
from pliant.evidence.bookkeeping.findings import find_mistakes
from pliant.evidence.bookkeeping.mistake import Mistake
from pliant.evidence.comparison import Comparison, compare
from pliant.evidence.error_bins import run_residuals
from pliant.evidence.measured_model import RunReadings
from pliant.evidence.opening import measured_model, read_study_measurement
from pliant.interfaces.effect import EffectConfig
from pliant.measurements.repeats import repeat_groups
from pliant.pipeline.run_folder import FinishedRun, finished
from pliant.pipeline.self_check import model_checks
from pliant.pipeline.study import StudyRun, build_study_laws
from pliant.pipeline.workbench import RunContext
from pliant.records.measurement import Measurement
from pliant_app.own_files import own_code
from pliant_app.page_state import Effects

MOST_KEPT = 24  # predictions


class AnswerCache:
    """A cache of the most recent results by key; threads that ask for the same key share one computation."""

    def __init__(self, most: int = MOST_KEPT) -> None:
        self._most, self._lock = most, threading.Lock()
        self._found: OrderedDict[Hashable, Future[Any]] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """Return a key's cached value, else that of `make`; an error is raised to all waiting threads, not cached."""
        with self._lock:
            kept = self._found.get(key)
            mine: Future[Any] | None = None
            if kept is None:
                kept = mine = self._found[key] = Future()
            self._found.move_to_end(key)
            while len(self._found) > self._most:
                self._found.popitem(last=False)
        if mine is not None:
            try:
                mine.set_result(make())
            except BaseException as error:
                with self._lock:
                    if self._found.get(key) is mine:
                        del self._found[key]
                mine.set_exception(error)
        return kept.result()


class StoppedError(Exception):
    """Error raised when work is stopped on request."""


@dataclass(frozen=True)
class Errors:
    """Errors of one model in units of the floor.

    Attributes:
        fitted: on the training runs.
        aside: on the held-out runs; None without such runs.
        by_output: RMSE on the training runs, SI.
        aside_by_output: RMSE on the held-out runs, SI.
    """

    fitted: float
    aside: float | None
    by_output: Mapping[str, float]
    aside_by_output: Mapping[str, float]


@dataclass(eq=False)
class OpenModel:
    """The model and the runs that the page compares.

    Attributes:
        path: of the study.
        study, bench: of the file.
        data: recordings used instead of the study's.
        measurement: all runs that were read, without readings after unknown states.
        off: runs whose readings are switched off.
        unknown: sentences on the readings after unknown states.
        earlier: the model before runs were added; its held-out runs stay held out.
    """

    path: Path
    study: Study
    context: RunContext
    data: tuple[Path, ...]
    measurement: Measurement
    off: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    earlier: OpenModel | None = None
    _predicted: AnswerCache = field(default_factory=lambda: AnswerCache())
    _noise: AnswerCache = field(default_factory=lambda: AnswerCache())

    @staticmethod
    def open(path: Path, data: Sequence[Path], store: Path, earlier: OpenModel | None = None) -> OpenModel:
        """Read the study and its recordings.

        Raises:
            UserError: files that cannot be read, or runs that the model cannot follow.
        """
        opened = api.open_study(path, store=store)
        measurement = read_study_measurement(opened.context, opened.study, tuple(data) or None)
        known, unknown = measured_model(opened.context, opened.study, measurement).with_known_states()
        return OpenModel(path, opened.study, opened.context, tuple(data), known, (), unknown, earlier)

    def without(self, off: Sequence[str]) -> OpenModel:
        """Return the model with the readings of these runs switched off; their histories still act on the specimens."""
        names = tuple(run.name for run in self.measurement.runs if run.name in set(off))
        return (
            self
            if names == self.off
            else replace(self, off=names, _predicted=AnswerCache(), _noise=AnswerCache())
        )

    @cached_property
    def read(self) -> Measurement:
        """The measurement without the readings that are switched off."""
        runs = tuple(
            run.with_outputs({name: np.full(len(run), np.nan) for name in run.outputs})
            if run.name in self.off
            else run
            for run in self.measurement.runs
        )
        return replace(self.measurement, runs=runs)

    @cached_property
    def split(self) -> TrainTestSplit:
        """The held-out runs, by `pliant improve`'s rule on all runs: switching runs off does not change the split."""
        if self.earlier is None:
            return split_runs(self.measurement).restricted_to(self.read)
        return extend_split(self.measurement, self.earlier.without(()).split).restricted_to(self.read)

    @cached_property
    def ground(self) -> Ground:
        """The training runs on which effects are fitted, as in `pliant improve`."""
        bare = self.study.model_copy(update={"effects": ()})
        return Ground.from_study(self.context, bare, self.split.training)

    def effects(self, values: Effects) -> tuple[EffectConfig, ...]:
        """Return effects from their JSON values; raises `ValidationError` for values out of bounds."""
        found = []
        for one in values:
            model = self.context.registry.get("effect", str(one["kind"])).config_model()
            made = model.model_validate(dict(one))
            assert isinstance(made, EffectConfig)
            found.append(made)
        return tuple(found)

    @property
    def own_effects(self) -> Effects:
        """The effects of the study."""
        return tuple(effect.canonical() for effect in self.study.effects)

    def predicted(self, effects: Effects) -> tuple[RunReadings, ...]:
        """Return the predicted readings of each run with these effects."""
        key = json.dumps(effects, sort_keys=True)
        found: tuple[RunReadings, ...] = self._predicted.get(
            key, lambda: self.ground.predictor.predict(self.effects(effects))
        )
        return found

    def quick(self, effects: Effects, parts: int) -> tuple[RunReadings, ...]:
        """Return the prediction with a given number of steps between samples, for a slider while it moves."""
        return self.ground.predictor.refined(parts).evaluate(self.effects(effects)).runs

    def parts(self, effects: Effects) -> int:
        """Return the number of steps between samples that the model with these effects needs."""
        return self.ground.predictor.steps_between_samples(self.effects(effects))

    def noise(self, predicted: Sequence[RunReadings]) -> NoiseView:
        """Return the noise estimated from a model's residuals over all runs that are on."""

        def seen() -> tuple[Sequence[RunReadings], NoiseView]:  # keeps `predicted` alive, whose id is the key
            scales = dict.fromkeys(self.outputs, 1.0)
            residuals = run_residuals(self.read, predicted)
            return predicted, noise_view(self.read, residuals, scales, repeat_groups(self.read))

        found: NoiseView = self._noise.get(id(predicted), seen)[1]
        return found

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """The outputs that model and measurement both have, with a reading."""
        return tuple(
            name
            for name in self.ground.predictor.outputs
            if any(np.isfinite(run.outputs[name]).any() for run in self.read.runs)
        )

    def errors(self, predicted: Sequence[RunReadings], noise: NoiseView) -> Errors:
        """Return the errors over the floors of a noise, on the training runs and on the held-out runs."""
        residuals = run_residuals(self.read, predicted)
        residuals = [{name: run[name] for name in self.outputs} for run in residuals]
        aside = set(self.split.runs)
        fitted = score(residuals, noise.floors, [k for k in range(len(residuals)) if k not in aside])
        unseen: Score | None = score(residuals, noise.floors, aside) if aside else None
        return Errors(
            fitted.over_floor,
            None if unseen is None else unseen.over_floor,
            fitted.rmse,
            {} if unseen is None else unseen.rmse,
        )

    def comparison(self, effects: Effects) -> Comparison:
        """Return `pliant compare` of the training runs; the held-out runs do not influence choices."""
        return compare(self.split.training, self.predicted(effects), bookkeeping=self.mistakes)

    @cached_property
    def mistakes(self) -> tuple[Mistake, ...]:
        """Probable bookkeeping mistakes in the training runs, by the study's own model."""
        return find_mistakes(measured_model(self.context, self.study, self.split.training))

    @cached_property
    def doubts(self) -> tuple[str, ...]:
        """Doubts about the study's numbers; the other checks are those of `pliant doctor`."""
        stages = build_study_laws(self.context, self.study)
        checks = model_checks(self.context, self.study, stages)
        return tuple(check.sentence for check in checks if check.status == "doubtful")

    @cached_property
    def as_a_run(self) -> FinishedRun:
        """The study with its laws in the form that reports read, before an engine ran."""
        return finished(StudyRun(self.study, build_study_laws(self.context, self.study)), {})

    @property
    def key(self) -> list[Any]:
        """The JSON values that results depend on."""
        names = [(run.name, len(run)) for run in self.measurement.runs]
        study = self.study.canonical()
        read = [study, self.measurement.sha256, self.measurement.source, names, list(self.off)]
        own = own_code(self.context.registry)
        return [*read, own] if own else read
