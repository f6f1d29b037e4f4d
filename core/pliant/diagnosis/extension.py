"""Put effects into a study's model: fit them, say how sure, and by how much the error falls.

A study with the effects of an extension, as a file: values with their units, uncertainty beside them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from pliant.config.measurements import MeasurementsConfig
from pliant.config.study import Study, written_name
from pliant.config.writing import StudyDraft
from pliant.diagnosis.candidates import StudyCandidate, candidate_kinds
from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.exploration import Exploration, explore, leaning
from pliant.diagnosis.fitting import Fitter
from pliant.diagnosis.kept_posterior import block_of
from pliant.diagnosis.law_posterior import prior_of
from pliant.diagnosis.learned_forms import KIND
from pliant.diagnosis.learned_term import LearnedTerm
from pliant.diagnosis.learned_words import depends_on
from pliant.diagnosis.left_out import blocks_of, condition_of_runs, heldout_residual
from pliant.diagnosis.noise import NoiseView, noise_view
from pliant.diagnosis.posterior import Posterior, posterior_of
from pliant.diagnosis.readings import ReadingVector, Score, readings_over_floor, score
from pliant.diagnosis.scatter import ReadingScatter, scatter_of
from pliant.diagnosis.uncertainty import Estimate, Uncertainty, rounded, square_per_reading, uncertainty
from pliant.evidence.places import Residuals, residuals_of
from pliant.evidence.prediction import Predictor
from pliant.interfaces.effect import EffectConfig
from pliant.measurements.repeats import RepeatGroup, repeat_groups
from pliant.pipeline.workbench import Workbench
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.registry.discovery import Registry

# Rounding may change the mean squared error by this share.
ROUNDING = 5e-4
DIGITS, MOST_DIGITS = 2, 8


@dataclass(frozen=True, eq=False)
class Extension:
    """Effects fitted on top of a study's own.

    Attributes:
        kinds: the effects that were fitted.
        effects: all effects of the extended model in their order.
        values: fitted values by ``kind.parameter``, rounded to their uncertainty as `effects` has them.
        candidate, fit, uncertainty: what was fitted, and how sure; the fit's own values are not rounded.
        noise: as the residuals of the extended model show it; its floors are those of all scores.
        before: the error of the model as it was, all readings.
        after: the same with the effects.
        residuals: (t,) per run by output, of the fitted model. The law's own error was part of the fit, so that
            values and intervals hold where the law is off; it is no part of the model, nor of the errors here.
        left_out: the same with the readings of each condition left out of the fit that predicts them; where a
            parameter would then not be known at all those of the model as it was, or of several kinds those of the
            best smaller extension, left out likewise. None with one condition only.
        left_out_runs: the same run by run; repeats of the run that is left out are then fitted. Of a single run,
            blocks are left out (`blocks_of`).
        posterior: of the fitted parameters, about `values`.
        scatter: of single readings about the model, by output.
        exploration: what draws of the posterior read; None for a fit without profile intervals.
    """

    kinds: tuple[str, ...]
    effects: tuple[EffectConfig, ...]
    values: Mapping[str, float]
    candidate: StudyCandidate
    fit: EffectFit
    uncertainty: Uncertainty
    noise: NoiseView
    before: Score
    after: Score
    residuals: Residuals
    left_out: Residuals | None
    left_out_runs: Residuals
    posterior: Posterior
    scatter: Mapping[str, ReadingScatter]
    exploration: Exploration | None = None

    @property
    def heldout(self) -> Score | None:
        """The error on conditions left out."""
        return None if self.left_out is None else score(self.left_out, self.noise.floors)

    @property
    def normal(self) -> bool | None:
        """Whether the posterior is close to a normal distribution; None where it was not looked at."""
        if self.exploration is None:
            return None
        return self.exploration.good and leaning(self.posterior, self.uncertainty) is None

    @property
    def absent(self) -> tuple[str, ...]:
        """Effects that these readings do not show: no strength is told from zero."""
        return tuple(kind for kind in self.kinds if self.uncertainty.absent(kind))


@dataclass(frozen=True, eq=False)
class Ground:
    """What effects are fitted on: the bare chain in its engine, driven by the measured histories."""

    predictor: Predictor
    measurement: Measurement
    groups: tuple[RepeatGroup, ...]

    @staticmethod
    def of(bench: Workbench, study: Study, measurement: Measurement) -> Ground:
        """The study without its effects.

        Raises:
            UserError: an engine that cannot follow histories, or no output that the model has.
        """
        bare = study.model_copy(update={"effects": ()})
        return Ground(Predictor.of_study(bench, bare, measurement), measurement, repeat_groups(measurement))

    def residuals(self, effects: Sequence[EffectConfig], measured: Measurement | None = None) -> Residuals:
        """Per run by output of the model; of other readings of the same runs where they are given."""
        return residuals_of(measured or self.measurement, self.predictor.predict(effects))

    def readings(self, effects: Sequence[EffectConfig]) -> ReadingVector:
        """The readings in units of the floor that the model with these effects leaves.

        Raises:
            UserError: no reading that the model has.
        """
        return readings_over_floor(self.measurement, self.residuals(effects), self.groups)[0]


def extend(
    ground: Ground,
    effects: Sequence[EffectConfig],
    kinds: Sequence[str],
    *,
    forms: Collection[str] = (),
    profiles: bool = True,
    smaller: Sequence[Extension] = (),
) -> Extension:
    """Fit effects of these kinds: in place those that are among `effects`, behind them the others.

    Args:
        ground: the bare model and the measurement.
        effects: what the model has already; those that are not fitted keep their values.
        kinds: what to fit, jointly.
        forms: those of them whose forms vary too.
        profiles: profile intervals, and draws of the posterior; without them ± 1.645 standard deviations.
        smaller: of several kinds, extensions by some of them, which this one shall not be worse than; those by each
            new kind alone by default.

    Raises:
        UserError: an unknown kind, or one that makes no sense for this chain.
    """
    registry = ground.predictor.bench.registry
    candidate = StudyCandidate.among(registry, effects, candidate_kinds(registry, kinds), forms)
    readings = ground.readings(effects)
    fitter = Fitter(ground.predictor, readings)
    present = StudyCandidate.among(registry, effects, ())
    parts = fitter.steps(effects)
    as_it_is = fitter.look(present, np.zeros(0), parts)
    plain = as_it_is.raw
    before = readings.unpack(plain)
    prior = prior_of(ground.predictor.law_error)
    seen = noise_view(ground.measurement, before, readings.scales, ground.groups)
    fitter = fitter.with_law_error(as_it_is, prior, seen.n_effective)
    fit = fitter.fit(candidate, _starts(candidate, effects), parts)
    if len(kinds) > 1:
        smaller = smaller or _alone(ground, candidate, effects)
        had = _had(candidate, effects)
        fit = fitter.no_worse(fit, [had, *({**had, **one.fit.named} for one in smaller)])
    without = _StandIn.of(readings, fitter, plain, smaller)
    after = readings.unpack(fit.raw)
    noise = noise_view(ground.measurement, readings.unpack(fit.residual), readings.scales, ground.groups)
    fit = fit.with_law(prior, noise.n_effective)
    condition = condition_of_runs(readings.n_runs, [group.runs for group in ground.groups])
    found = uncertainty(fitter, fit, noise.n_effective, profiles)
    values = _rounded(fitter, fit, candidate, found)
    posterior = posterior_of(fit, fitter.weights, noise.n_effective)
    scale = square_per_reading(fitter.weights, fit, noise.n_effective)
    return Extension(
        kinds=candidate.kinds,
        effects=candidate.with_values(values),
        values=values,
        candidate=candidate,
        fit=fit,
        uncertainty=found,
        noise=noise,
        before=score(before, noise.floors),
        after=score(after, noise.floors),
        residuals=after,
        left_out=_left_out(readings, fit, without.conditions, condition),
        left_out_runs=_left_out(readings, fit, without.runs, np.arange(readings.n_runs))
        or readings.unpack(heldout_residual(fit, blocks_of(readings), without.runs, exact_law=True)),
        posterior=posterior.about(values),
        scatter=scatter_of(noise, after, len(fit.x)),
        exploration=explore(fitter, posterior, scale, fit.parts, law=fit.law) if profiles else None,
    )


def _had(candidate: StudyCandidate, effects: Sequence[EffectConfig]) -> dict[str, float]:
    """x by name of the values that effects of the study have now."""
    had = {effect.kind for effect in effects}
    return {
        parameter.name: float(x)
        for parameter, x in zip(candidate.parameters, candidate.present(), strict=True)
        if parameter.kind in had and np.isfinite(x)
    }


def _starts(candidate: StudyCandidate, effects: Sequence[EffectConfig]) -> list[Array]:
    """The usual starts, and the values that effects of the study have now."""
    known = _had(candidate, effects)
    return [*candidate.starts(known), *(candidate.starts() if known else [])]


def _alone(ground: Ground, candidate: StudyCandidate, effects: Sequence[EffectConfig]) -> list[Extension]:
    """By each kind that the effects do not have yet, where there are several."""
    had = {effect.kind for effect in effects}
    new = [kind for kind in candidate.kinds if kind not in had]
    forms = set(candidate.forms)
    if len(new) < 2:
        return []
    return [extend(ground, effects, [kind], forms=forms & {kind}, profiles=False) for kind in new]


@dataclass(frozen=True, eq=False)
class _StandIn:
    """(N,) residuals that stand where a parameter is not known without the readings: conditions, runs left out."""

    conditions: Array
    runs: Array

    @staticmethod
    def of(readings: ReadingVector, fitter: Fitter, plain: Array, smaller: Sequence[Extension]) -> _StandIn:
        """Of the model as it was (`plain`), or of the smaller extension that fits best if that fits better.

        What one effect is cannot be known without some runs; what the others beside it are can be.
        """
        best = min(smaller, key=lambda one: one.fit.mean_square(fitter.weights), default=None)
        if best is None or not best.fit.mean_square(fitter.weights) < float(np.mean(plain**2)):
            return _StandIn(plain, plain)
        runs = readings.pack(best.left_out_runs)
        return _StandIn(runs if best.left_out is None else readings.pack(best.left_out), runs)


def _left_out(
    readings: ReadingVector, fit: EffectFit, plain: Array, number: NDArray[np.intp]
) -> Residuals | None:
    """Residuals with the runs of one number (runs,) left out after another; None where all have the same."""
    groups = number[readings.run]
    if len(np.unique(groups)) < 2:
        return None
    return readings.unpack(heldout_residual(fit, groups, plain, exact_law=True))


def _rounded(
    fitter: Fitter, fit: EffectFit, candidate: StudyCandidate, found: Uncertainty
) -> dict[str, float]:
    """Values at the decimals of their uncertainty, with more digits where the fit would feel the rounding."""
    wanted = fit.mean_square(fitter.weights)
    values: dict[str, float] = {}
    for digits in range(DIGITS, MOST_DIGITS + 1):
        values = {
            one.name: float(np.clip(rounded(one.value, one.sd, digits), *one.parameter.bounds))
            for one in found.estimates
        }
        effects = candidate.with_values(values)
        at = fitter.look(StudyCandidate((), (), (), effects), np.zeros(0), fit.parts, fit.law)
        there = at.mean_square(fitter.weights)
        if abs(there - wanted) <= ROUNDING * wanted:
            break
    return values


def write_extended_study(
    source: Path,
    target: Path,
    study: Study,
    overrides: Sequence[str],
    found: Extension | None,
    note: str,
    registry: Registry,
    *,
    notes_by_kind: Mapping[str, str] | None = None,
    learned: LearnedTerm | None = None,
    data: Sequence[Path] | None = None,
    full: bool = False,
) -> None:
    """Write the study with the effects of an extension, under a name of its own.

    Args:
        source: the study's file.
        target: the new file.
        study: as it was read from `source` with `overrides`.
        found: the fitted effects; None where none was added.
        note: where they come from, one line.
        registry: as it was before the study's own plugin files were read.
        notes_by_kind: more words behind the note, by kind of effect.
        learned: a learned term behind them.
        data: the files that were fitted where they are not the study's; they become the new study's.
        full: whether the file shall stand alone.

    Raises:
        UserError: the file cannot be written, or what was written does not read back as the same study.
    """
    draft = StudyDraft(source, overrides)
    effects = study.effects if found is None else found.effects
    every = (*effects, *(() if learned is None else (learned.effect,)))
    meant = {**study.canonical(), "name": draft.name_after(target)}
    meant["effects"] = [effect.canonical() for effect in every]
    if data:
        files = tuple(str(file.absolute()) for file in data)
        named: str | tuple[str, ...] = files[0] if len(files) == 1 else files
        draft.set(("measurements", "file"), named if isinstance(named, str) else list(named))
        block = study.measurements or MeasurementsConfig(file=named)
        meant["measurements"] = {**block.canonical(), "file": named}
    if found is not None:
        _set_fitted(draft, found, note, notes_by_kind or {})
    if (
        found is not None and learned is None
    ):  # the scatter that it holds is of the model without a learned term
        kept = block_of(found.posterior, found.scatter).canonical()
        draft.set(("posterior",), kept, "how sure; 'pliant compare' draws its bands from it")
        meant["posterior"] = kept
    if learned is not None:
        at = ("effects", len(effects))
        draft.set((*at, "kind"), KIND, f"{note}; {depends_on(learned)}: a description, no cause")
        for key, value in learned.form.block(learned.value, learned.sd).items():
            if key != "kind":
                draft.set((*at, key), value)
    draft.write(target, meant, registry, full)


def _set_fitted(draft: StudyDraft, found: Extension, note: str, notes_by_kind: Mapping[str, str]) -> None:
    """The fitted effects with their uncertainty."""
    for slot, kind in sorted(zip(found.candidate.slots, found.kinds, strict=True)):
        at = ("effects", slot)
        draft.set((*at, "kind"), kind, note + notes_by_kind.get(kind, ""))
        for estimate in found.uncertainty.estimates:
            if estimate.kind == kind:
                key, value = _written(found.effects[slot], estimate, found.values[estimate.name])
                draft.set((*at, key), value, estimate.words)


def _written(config: EffectConfig, estimate: Estimate, value: float) -> tuple[str, str | float]:
    """Key and value as a study has them: with its unit where the config reads one, else the bare SI number."""
    field = estimate.parameter.name
    key = written_name(type(config), field)
    text = f"{repr(float(value)).removesuffix('.0')} {estimate.unit}"
    if key != field and estimate.unit:
        try:
            read = type(config).model_validate({**config.model_dump(), field: text})
        except ValidationError:
            return field, float(value)
        if abs(getattr(read, field) - value) <= 1e-12 * abs(value):
            return key, text
    return field, float(value)
