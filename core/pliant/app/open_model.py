"""A study open on the page: the model driven by the runs, which of them are put aside, and its errors."""

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
from pliant.app.own_files import own_code
from pliant.app.page_state import Effects
from pliant.config.study import Study
from pliant.diagnosis.extension import Ground
from pliant.diagnosis.noise import NoiseView, noise_view
from pliant.diagnosis.readings import Score, score
from pliant.diagnosis.test_split import TrainTestSplit, lock, lock_more
from pliant.evidence.bookkeeping.findings import find_mistakes
from pliant.evidence.bookkeeping.mistake import Mistake
from pliant.evidence.comparison import Comparison, compare
from pliant.evidence.places import residuals_of
from pliant.evidence.prediction import Prediction, Predictor, RunReadings, measurement_of_study
from pliant.interfaces.effect import EffectConfig
from pliant.measurements.beginnings import with_known_states
from pliant.measurements.repeats import repeat_groups
from pliant.pipeline.study import StudyRun, laws_of_study
from pliant.pipeline.workbench import Workbench
from pliant.records.measurement import Measurement
from pliant.report.folder import FinishedRun, finished

MOST_KEPT = 24  # predictions


class AnswerCache:
    """The results asked for last, by key; several threads may ask, and each result is worked out once."""

    def __init__(self, most: int = MOST_KEPT) -> None:
        self._most, self._lock = most, threading.Lock()
        self._found: OrderedDict[Hashable, Future[Any]] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """What is kept under the key, else what `make` gives; an error is raised to all who wait, and not kept."""
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
    """Work was stopped on request."""


class WatchedPredictor(Predictor):
    """A predictor whose work can be stopped between two predictions."""

    stopped: Callable[[], bool] = staticmethod(lambda: False)

    def evaluate(self, *args: Any, **named: Any) -> Prediction:
        self._heed()
        return super().evaluate(*args, **named)

    def vary(self, *args: Any, **named: Any) -> tuple[Prediction, tuple[tuple[RunReadings, ...], ...]]:
        self._heed()
        return super().vary(*args, **named)

    def _heed(self) -> None:
        if self.stopped():
            raise StoppedError


@dataclass(frozen=True)
class Errors:
    """Errors of one model in units of the floor.

    Attributes:
        fitted: on the runs that fits may see.
        aside: on the runs put aside; None where none is.
        by_output: of the first, SI.
        aside_by_output: of the second, SI.
    """

    fitted: float
    aside: float | None
    by_output: Mapping[str, float]
    aside_by_output: Mapping[str, float]


@dataclass(eq=False)
class OpenModel:
    """What the page compares.

    Attributes:
        path: of the study.
        study, bench: as it was read.
        data: recordings instead of the study's own.
        measurement: all runs that were read, without readings after unknown states.
        off: runs whose readings are switched off.
        unknown: what the readings after unknown states are, in sentences.
        earlier: what was open before runs were added; what it put aside stays aside.
    """

    path: Path
    study: Study
    bench: Workbench
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
            UserError: what cannot be read, or what cannot be followed.
        """
        opened = api.open_study(path, store=store)
        measurement = measurement_of_study(opened.bench, opened.study, tuple(data) or None)
        known, unknown = with_known_states(measurement)
        return OpenModel(path, opened.study, opened.bench, tuple(data), known, (), unknown, earlier)

    def without(self, off: Sequence[str]) -> OpenModel:
        """The same with the readings of these runs switched off; specimens still live through them."""
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
        """Which runs are put aside, by `pliant improve`'s rule on all runs: switching some off moves none."""
        if self.earlier is None:
            return lock(self.measurement).of(self.read)
        return lock_more(self.measurement, self.earlier.without(()).split).of(self.read)

    @cached_property
    def ground(self) -> Ground:
        """What effects are fitted on: the training runs, as `pliant improve` has them."""
        bare = self.study.model_copy(update={"effects": ()})
        plain = Predictor.of_study(self.bench, bare, self.split.training)
        watched = WatchedPredictor(
            plain.bench, plain.backend, plain.chain, self.split.training, law_error=plain.law_error
        )
        return Ground(watched, self.split.training, repeat_groups(self.split.training))

    def effects(self, values: Effects) -> tuple[EffectConfig, ...]:
        """Effects from their JSON values; raises `ValidationError` for values out of bounds."""
        found = []
        for one in values:
            model = self.bench.registry.get("effect", str(one["kind"])).config_model()
            made = model.model_validate(dict(one))
            assert isinstance(made, EffectConfig)
            found.append(made)
        return tuple(found)

    @property
    def own_effects(self) -> Effects:
        """Those of the study."""
        return tuple(effect.canonical() for effect in self.study.effects)

    def predicted(self, effects: Effects) -> tuple[RunReadings, ...]:
        """What the model with these effects reads in each run."""
        key = json.dumps(effects, sort_keys=True)
        found: tuple[RunReadings, ...] = self._predicted.get(
            key, lambda: self.ground.predictor.predict(self.effects(effects))
        )
        return found

    def quick(self, effects: Effects, parts: int) -> tuple[RunReadings, ...]:
        """The same in a given number of steps between samples: for a slider on its way."""
        return self.ground.predictor.refined(parts).evaluate(self.effects(effects)).runs

    def parts(self, effects: Effects) -> int:
        """The steps between samples that this model needs."""
        return self.ground.predictor.steps_between_samples(self.effects(effects))

    def noise(self, predicted: Sequence[RunReadings]) -> NoiseView:
        """Noise as a model's residuals show it over all runs that are on."""

        def seen() -> tuple[Sequence[RunReadings], NoiseView]:  # held with what it is kept under
            scales = dict.fromkeys(self.outputs, 1.0)
            residuals = residuals_of(self.read, predicted)
            return predicted, noise_view(self.read, residuals, scales, repeat_groups(self.read))

        found: NoiseView = self._noise.get(id(predicted), seen)[1]
        return found

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """Outputs that both have, with a reading."""
        return tuple(
            name
            for name in self.ground.predictor.outputs
            if any(np.isfinite(run.outputs[name]).any() for run in self.read.runs)
        )

    def errors(self, predicted: Sequence[RunReadings], noise: NoiseView) -> Errors:
        """Errors over the floors of a noise: of the training runs, and of those put aside."""
        residuals = residuals_of(self.read, predicted)
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
        """`pliant compare` of the training runs: what is put aside is not looked at for a choice."""
        return compare(self.split.training, self.predicted(effects), bookkeeping=self.mistakes)

    @cached_property
    def mistakes(self) -> tuple[Mistake, ...]:
        """What is probably written down wrongly in the training runs, by the study's own model."""
        return find_mistakes(Predictor.of_study(self.bench, self.study, self.split.training))

    @cached_property
    def as_a_run(self) -> FinishedRun:
        """The study with its laws as what a report reads, before an engine ran."""
        return finished(StudyRun(self.study, laws_of_study(self.bench, self.study)), {})

    @property
    def key(self) -> list[Any]:
        """What results depend on, as JSON values."""
        names = [(run.name, len(run)) for run in self.measurement.runs]
        study = self.study.canonical()
        read = [study, self.measurement.sha256, self.measurement.source, names, list(self.off)]
        own = own_code(self.bench.registry)
        return [*read, own] if own else read
