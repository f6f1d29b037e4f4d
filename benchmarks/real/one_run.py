"""Effects from a single run: forward steps, each judged by blocks of the run that its fit has not seen.

For recordings on which `pliant improve` rightly stops: one run repeats nothing, so its floor is not known. The law and
the effects are fitted in turn. An effect whose number ends on a bound is not taken: at its bound it is another effect
in disguise (see docs/which_effect.md). Blocks left out are those of `Fitter`'s linearised fit (Cook & Weisberg 1982).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from benchmarks.real.two_bellow_data import BLOCK_S, folds, rms

from pliant.calibration.law_of_runs import law_of_runs
from pliant.config.study import Study
from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.excitation import applicable, excitations, not_excited
from pliant.diagnosis.fitting import EffectFit, Fitter, ReadingVector, heldout_residual
from pliant.diagnosis.verdict import THRESHOLDS
from pliant.evidence.prediction import Predictor
from pliant.pipeline.workbench import Workbench
from pliant.records.measurement import Measurement

HELD = ("b_e",)
SCALE_RAD = 0.01  # unit of the residuals; it weighs nothing with one output
LEAST_GAIN = 0.01  # of the error on blocks left out, as `pliant improve` asks of runs left out
TURNS = 3  # law, effects, law, effects…
MOST_STEPS = 6


@dataclass(frozen=True, eq=False)
class Trial:
    """One effect more.

    Attributes:
        kind: the effect.
        training, blocked: rms error of the run, and of its blocks left out, rad.
        at_limit: parameters that ended on a bound.
        study: the model with it.
        fit: of all effects so far.
    """

    kind: str
    training: float
    blocked: float
    at_limit: tuple[str, ...]
    study: Study
    fit: EffectFit


@dataclass(frozen=True, eq=False)
class Step:
    """A model on the way, and what else was tried for it, the best on blocks left out first."""

    study: Study
    kinds: tuple[str, ...]
    training: float
    blocked: float
    values: Mapping[str, float]
    trials: tuple[Trial, ...]


class OneRun:
    """The loop on one run."""

    def __init__(
        self, bench: Workbench, measurement: Measurement, kinds: Sequence[str], block_s: float = BLOCK_S
    ) -> None:
        self.bench, self.measurement = bench, measurement
        self.asked = kinds
        history = measurement.runs[0].history
        self.readings = ReadingVector.of(measurement, ("angle_rad",), {"angle_rad": SCALE_RAD})
        self.folds = folds(history.time_s, block_s)

    def steps(self, study: Study) -> Iterator[Step]:
        """The law alone, then one effect more each; ends where no effect lowers the error on blocks left out."""
        study = law_of_runs(self.bench, study, self.measurement, held=HELD).study
        chosen: tuple[str, ...] = ()
        fit = self._fit(study, ())
        best = self._step(study, fit, ())
        yield best
        kinds = self.shown(study)
        while len(chosen) < MOST_STEPS:
            trials = self._trials(study, chosen, fit, [kind for kind in kinds if kind not in chosen])
            sound = [trial for trial in trials if not trial.at_limit]
            if not sound or sound[0].blocked > (1.0 - LEAST_GAIN) * best.blocked:
                yield Step(best.study, best.kinds, best.training, best.blocked, best.values, tuple(trials))
                return
            chosen = (*chosen, sound[0].kind)
            study, fit = self._in_turn(study, chosen, sound[0].fit)
            best = self._step(study, fit, tuple(trials))
            yield best

    def shown(self, study: Study) -> list[str]:
        """Kinds that this chain can have and this run could show."""
        registry = self.bench.registry
        fitter = Fitter(Predictor.of_study(self.bench, study, self.measurement), self.readings)
        able, _ = applicable(registry, fitter, self.asked)
        silent = not_excited(excitations(registry, fitter, self._fit(study, ()), able), THRESHOLDS)
        return [kind for kind in able if kind not in silent]

    def _trials(
        self, study: Study, chosen: tuple[str, ...], fit: EffectFit, kinds: Sequence[str]
    ) -> list[Trial]:
        trials = []
        for kind in kinds:
            tried = self._fit(study, (*chosen, kind), fit)
            if np.isfinite(tried.residual).all():
                ends = zip(tried.candidate.parameters, tried.at_limit, strict=True)
                stuck = tuple(k.name for k, at in ends if at and k.kind == kind)
                whole = study.model_copy(update={"effects": tried.candidate.configs(tried.x)})
                error = SCALE_RAD * rms(tried.residual)
                trials.append(Trial(kind, error, self._blocked(tried), stuck, whole, tried))
        return sorted(trials, key=lambda trial: trial.blocked)

    def _in_turn(self, study: Study, chosen: tuple[str, ...], fit: EffectFit) -> tuple[Study, EffectFit]:
        """The law with the effects in place, the effects with that law, a few times."""
        for _ in range(TURNS):
            with_effects = study.model_copy(update={"effects": fit.candidate.configs(fit.x)})
            law = law_of_runs(self.bench, with_effects, self.measurement, held=HELD).study
            study = law.model_copy(update={"effects": ()})
            fit = self._fit(study, chosen, fit)
        return study, fit

    def _fit(self, study: Study, kinds: tuple[str, ...], near: EffectFit | None = None) -> EffectFit:
        candidate = EffectSet.of(self.bench.registry, kinds)
        known: dict[str, float] = {}
        if near is not None:
            known = {k.name: float(x) for k, x in zip(near.candidate.parameters, near.x, strict=True)}
        predictor = Predictor.of_study(self.bench, study, self.measurement)
        return Fitter(predictor, self.readings).fit(candidate, candidate.starts(known))

    def _blocked(self, fit: EffectFit) -> float:
        return SCALE_RAD * rms(heldout_residual(fit, self.folds))

    def _step(self, study: Study, fit: EffectFit, trials: tuple[Trial, ...]) -> Step:
        whole = study.model_copy(update={"effects": fit.candidate.configs(fit.x)})
        training = SCALE_RAD * rms(fit.residual)
        return Step(whole, fit.candidate.kinds, training, self._blocked(fit), fit.values, trials)
