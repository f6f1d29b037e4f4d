"""MeasuredModel: a model with the runs that it is compared with, the interface of comparison, diagnosis and plans.

They ask for a `Predictor` only for what a chain alone has: an error of its joint law, bookkeeping at equilibrium, the
laboratory's menu of runs.
A chain of modules in an engine is one (`pliant.evidence.prediction.Predictor`), a user's own model another
(`pliant.evidence.driven_model.DrivenModel`).
"""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from pliant.errors import NotReachedError
from pliant.interfaces.effect import Effect, EffectConfig
from pliant.interfaces.model import Channel
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.measurement import Measurement

RunReadings = dict[str, Array]


@dataclass(frozen=True, eq=False)
class Prediction:
    """Readings of each run by output, (t,) each; NaN where the model has no state.

    `n_failed` is the number of such samples.
    """

    runs: tuple[RunReadings, ...]
    n_failed: int


class MeasuredModel(ABC):
    """A model, its effects, and the measured runs.

    Attributes:
        context: plugins and store; its registry has the effects of this kind of model.
        measurement: the runs.
        outputs, missing: measured outputs that the model has, and those that it lacks.
        law_error: stated error of the joint laws, as a share of their torque range, or of the numbers of one's own
            model, as a share of each; None where nothing is stated.
        parts: steps of the integration from sample to sample.
        heed: called before every prediction; it may raise to stop the work.
    """

    context: RunContext
    measurement: Measurement
    outputs: tuple[str, ...]
    missing: tuple[str, ...]
    law_error: float | None = None
    parts: int = 1
    heed: Callable[[], object] = staticmethod(lambda: None)

    def watched(self, heed: Callable[[], object]) -> Self:
        """Return the same model, which calls `heed` before every prediction."""
        other = copy.copy(self)
        other.heed = heed
        return other

    @property
    def threads(self) -> bool:
        """Return whether `evaluate` may run in several threads at once."""
        return False

    @property
    def has_derivatives(self) -> bool:
        """Return whether `vary` costs less than as many predictions, so that a search may ask for many derivatives."""
        return False

    @property
    def costly_slopes(self) -> bool:
        """Return whether every slope costs a prediction of its own, so that a search asks for few of them."""
        return False

    @property
    def modules(self) -> tuple[str, ...]:
        """Return the modules whose code determines a prediction, besides Pliant's."""
        return ()

    @property
    def spatial(self) -> bool:
        """Return whether a sample costs as much as with joints of several coordinates."""
        return False

    @property
    @abstractmethod
    def inputs(self) -> tuple[Channel, ...]:
        """Return what drives the model."""

    @property
    def attachments(self) -> Mapping[str, tuple[str, ...]]:
        """Return the names of the places where effects can act, by kind of place."""
        return {"input": tuple(channel.name for channel in self.inputs), "output": self.outputs}

    @property
    def remarks(self) -> list[str]:
        """Return sentences on what limits a comparison: outputs that the model lacks, fitted zeros."""
        return [f"The model has no {', '.join(self.missing)}: left out."] if self.missing else []

    @abstractmethod
    def for_runs(self, measurement: Measurement) -> Self:
        """Return the same model, driven by other runs. They may have other outputs."""

    def for_planned_runs(self, measurement: Measurement) -> Self:
        """Return the same model, driven by runs that were not done yet, whose readings are no readings."""
        return self.for_runs(measurement)

    def with_known_states(self) -> tuple[Measurement, tuple[str, ...]]:
        """Return the measurement without readings that depend on unknown states, and sentences about them."""
        return self.measurement, ()

    def unsuited(self, effect: Effect) -> str:
        """Return why these runs cannot show an effect, whatever its strength; "" if they can."""
        return ""

    def default_kinds(self, kinds: Sequence[str]) -> list[str]:
        """Return the kinds of effects that a diagnosis tries, among all kinds for this kind of model."""
        return list(kinds)

    def places_of_kind(self, kind: str) -> list[str]:
        """Return the kinds of effects that act at one of several places of a kind each; empty for a single place."""
        return []

    def number_sensitivities(self, share: float) -> tuple[tuple[RunReadings, ...], ...]:
        """Return for each of the model's own numbers the change of the readings by a small share of it; () if exact."""
        return ()

    @property
    def is_conditioned(self) -> bool:
        """Return whether a specimen is cycled before a planned run, because it remembers its first load."""
        return False

    def least_noise(self, output: str) -> float:
        """Return the smallest noise of an output that was not measured, in its unit."""
        return 0.0

    def refined(self, parts: int) -> Self:
        """Return the same model, integrated in `parts` steps from each sample to the next."""
        return self

    def steps_between_samples(
        self, effects: Sequence[EffectConfig] = (), least: int = 1, close: Mapping[str, float] | None = None
    ) -> int:
        """Return the steps from sample to sample after which more of them hardly change the outputs."""
        return least

    def predict(self, effects: Sequence[EffectConfig] = ()) -> tuple[RunReadings, ...]:
        """Return the predicted outputs of each run, in as many steps as they need.

        Raises:
            NotReachedError: no sample of any run has a state.
        """
        prediction = self.refined(self.steps_between_samples(effects)).evaluate(effects)
        if prediction.n_failed == sum(map(len, self.measurement.runs)):
            raise NotReachedError(self.no_state)
        return prediction.runs

    @property
    def no_state(self) -> str:
        """Return the sentence on a model that reaches none of the measured states."""
        return "the model diverges in every measured run"

    @abstractmethod
    def evaluate(
        self, effects: Sequence[EffectConfig] = (), histories: Sequence[History] | None = None
    ) -> Prediction:
        """Return the prediction, for `histories` instead of the measured ones if they are given."""

    def vary(
        self, effects: Sequence[EffectConfig], towards: Sequence[Sequence[EffectConfig]]
    ) -> tuple[Prediction, tuple[tuple[RunReadings, ...], ...]]:
        """Return the prediction, and its first-order changes under small changes of the effects' parameters."""
        base = self.evaluate(effects)
        return base, tuple(differences(base.runs, self.evaluate(other).runs) for other in towards)

    def check(self, effects: Sequence[EffectConfig]) -> None:
        """Raise `UserError` for effects that this model refuses."""
        self.evaluate(effects)


def differences(base: Sequence[RunReadings], there: Sequence[RunReadings]) -> tuple[RunReadings, ...]:
    """Return the differences of readings to those of the base, run by run."""
    return tuple({name: b[name] - a[name] for name in a} for a, b in zip(base, there, strict=True))


def failed_samples(runs: Sequence[Mapping[str, Array]]) -> int:
    """Return the number of samples at which some reading is not finite."""
    return sum(int(np.any([~np.isfinite(v) for v in run.values()], axis=0).sum()) for run in runs if run)
