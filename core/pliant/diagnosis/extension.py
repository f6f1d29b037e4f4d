"""Extension of a study's model by effects: fits, uncertainties, and the reduction of the error.

The extended study is written to a file: values with their units and uncertainties.
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
from pliant.diagnosis.exploration import Exploration, asymmetric_parameter, explore
from pliant.diagnosis.fitting import Fitter
from pliant.diagnosis.kept_posterior import posterior_block
from pliant.diagnosis.law_posterior import law_error_prior
from pliant.diagnosis.learned_forms import KIND
from pliant.diagnosis.learned_term import LearnedTerm
from pliant.diagnosis.learned_words import depends_on
from pliant.diagnosis.left_out import assign_blocks, condition_indices, heldout_residual, specimen_indices
from pliant.diagnosis.noise import NoiseView, noise_view
from pliant.diagnosis.posterior import Posterior, laplace_posterior
from pliant.diagnosis.readings import ReadingVector, Score, readings_over_floor, score
from pliant.diagnosis.scatter import ReadingScatter, reading_scatter
from pliant.diagnosis.uncertainty import Estimate, Uncertainty, rounded, square_per_reading, uncertainty
from pliant.evidence.error_bins import Residuals, run_residuals
from pliant.evidence.measured_model import MeasuredModel
from pliant.evidence.opening import measured_model
from pliant.interfaces.effect import EffectConfig
from pliant.measurements.repeats import RepeatGroup, repeat_groups
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.registry.discovery import Registry

# Rounding may change the mean squared error by this share.
ROUNDING = 5e-4
DIGITS, MOST_DIGITS = 2, 8


@dataclass(frozen=True, eq=False)
class Extension:
    """Effects fitted in addition to a study's own.

    Attributes:
        kinds: the effects that were fitted.
        effects: all effects of the extended model in their order.
        values: fitted values by ``kind.parameter``, rounded to their uncertainty as in `effects`.
        candidate, fit, uncertainty: what was fitted, and its uncertainty; the fit's own values are not rounded.
        noise: estimated from the residuals of the extended model; its floors are those of all scores.
        before: the error of the original model, all readings.
        after: the same with the effects.
        residuals: (t,) per run by output, of the fitted model. The law's own error was part of the fit, so that
            values and intervals are valid with a wrong law; it is not part of the model, nor of the errors here.
        left_out: the same with the readings of each condition held out of the fit that predicts them. If a
            parameter were then unknown, those of the original model; for several kinds, those of the best smaller
            extension, held out likewise. None with one condition only.
        left_out_runs: the same run by run; repeats of the held-out run are then fitted. Of a single run,
            blocks are held out (`assign_blocks`).
        left_out_specimens: the same with all runs of a specimen held out; None with one specimen only.
        posterior: of the fitted parameters, about `values`.
        scatter: of single readings about the model, by output.
        exploration: of the posterior by draws; None for a fit without profile intervals.
        remarks: limits of the model, in sentences.
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
    left_out_specimens: Residuals | None
    posterior: Posterior
    scatter: Mapping[str, ReadingScatter]
    exploration: Exploration | None = None
    remarks: tuple[str, ...] = ()

    @property
    def heldout(self) -> Score | None:
        """Return the error on held-out conditions, or None."""
        return None if self.left_out is None else score(self.left_out, self.noise.floors)

    @property
    def normal(self) -> bool | None:
        """Return whether the posterior is close to a normal distribution; None if it was not explored."""
        if self.exploration is None:
            return None
        return self.exploration.good and asymmetric_parameter(self.posterior, self.uncertainty) is None

    @property
    def absent(self) -> tuple[str, ...]:
        """Return effects that these readings do not show: no strength differs significantly from zero."""
        return tuple(kind for kind in self.kinds if self.uncertainty.absent(kind))


@dataclass(frozen=True, eq=False)
class Ground:
    """The basis on which effects are fitted: the bare chain in its engine, driven by the measured histories."""

    predictor: MeasuredModel
    measurement: Measurement
    groups: tuple[RepeatGroup, ...]

    @staticmethod
    def from_study(context: RunContext, study: Study, measurement: Measurement) -> Ground:
        """Return the study without its effects.

        Raises:
            UserError: an engine that cannot simulate histories, or no output that the model has.
        """
        bare = study.model_copy(update={"effects": ()})
        return Ground(measured_model(context, bare, measurement), measurement, repeat_groups(measurement))

    def residuals(self, effects: Sequence[EffectConfig], measured: Measurement | None = None) -> Residuals:
        """Return residuals per run by output; of other readings of the same runs if they are given."""
        return run_residuals(measured or self.measurement, self.predictor.predict(effects))

    def readings(self, effects: Sequence[EffectConfig]) -> ReadingVector:
        """Return the readings in units of the floor, estimated from the residuals of the model with these effects.

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
    """Fit effects of these kinds: existing ones among `effects` in place, others appended.

    Args:
        ground: the bare model and the measurement.
        effects: the model's present effects; those that are not fitted keep their values.
        kinds: what to fit, jointly.
        forms: those of them whose forms also vary.
        profiles: profile intervals, and draws of the posterior; without them ± 1.645 standard deviations.
        smaller: of several kinds, extensions by some of them, which this one must not be worse than; those by each
            new kind alone by default.

    Raises:
        UserError: an unknown kind, or one that is not applicable to this chain.
    """
    registry = ground.predictor.context.registry
    candidate = StudyCandidate.among(registry, effects, candidate_kinds(registry, kinds), forms)
    readings = ground.readings(effects)
    fitter = Fitter(ground.predictor, readings)
    present = StudyCandidate.among(registry, effects, ())
    parts = fitter.steps(effects)
    as_it_is = fitter.evaluate(present, np.zeros(0), parts)
    plain = as_it_is.raw
    before = readings.unpack(plain)
    prior = law_error_prior(ground.predictor.law_error)
    seen = noise_view(ground.measurement, before, readings.scales, ground.groups)
    fitter = fitter.with_law_error(as_it_is, prior, seen.n_effective)
    fit = fitter.fit(candidate, _starts(candidate, effects), parts)
    if len(kinds) > 1:
        smaller = smaller or _alone(ground, candidate, effects)
        had = _had(candidate, effects)
        fit = fitter.refit_from(fit, [had, *({**had, **one.fit.named} for one in smaller)])
    without = _StandIn.from_extensions(readings, fitter, plain, smaller)
    after = readings.unpack(fit.raw)
    noise = noise_view(ground.measurement, readings.unpack(fit.residual), readings.scales, ground.groups)
    fit = fit.with_law(prior, noise.n_effective)
    condition = condition_indices(readings.n_runs, [group.runs for group in ground.groups])
    found = uncertainty(fitter, fit, noise.n_effective, profiles)
    values = _rounded(fitter, fit, candidate, found)
    posterior = laplace_posterior(fit, fitter.weights, noise.n_effective)
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
        or readings.unpack(heldout_residual(fit, assign_blocks(readings), without.runs, exact_law=True)),
        left_out_specimens=_left_out(readings, fit, without.runs, specimen_indices(ground.measurement.runs)),
        posterior=posterior.about(values),
        scatter=reading_scatter(noise, after, len(fit.x)),
        exploration=explore(fitter, posterior, scale, fit.parts, law=fit.law) if profiles else None,
        remarks=tuple(ground.predictor.remarks),
    )


def _had(candidate: StudyCandidate, effects: Sequence[EffectConfig]) -> dict[str, float]:
    """Return x by name of the present values of the study's effects."""
    had = {effect.kind for effect in effects}
    return {
        parameter.name: float(x)
        for parameter, x in zip(candidate.parameters, candidate.present(), strict=True)
        if parameter.kind in had and np.isfinite(x)
    }


def _starts(candidate: StudyCandidate, effects: Sequence[EffectConfig]) -> list[Array]:
    """Return the usual starts, and the present values of the study's effects."""
    known = _had(candidate, effects)
    return [*candidate.starts(known), *(candidate.starts() if known else [])]


def _alone(ground: Ground, candidate: StudyCandidate, effects: Sequence[EffectConfig]) -> list[Extension]:
    """Return extensions by each new kind alone, if there are several."""
    had = {effect.kind for effect in effects}
    new = [kind for kind in candidate.kinds if kind not in had]
    forms = set(candidate.forms)
    if len(new) < 2:
        return []
    return [extend(ground, effects, [kind], forms=forms & {kind}, profiles=False) for kind in new]


@dataclass(frozen=True, eq=False)
class _StandIn:
    """(N,) residuals that replace those of readings without which a parameter is unknown: conditions, runs held out."""

    conditions: Array
    runs: Array

    @staticmethod
    def from_extensions(
        readings: ReadingVector, fitter: Fitter, plain: Array, smaller: Sequence[Extension]
    ) -> _StandIn:
        """Return those of the original model (`plain`), or of the best-fitting smaller extension if it fits better.

        Some runs may be needed to identify one effect, while the other effects are identified without them.
        """
        best = min(smaller, key=lambda one: one.fit.mean_square(fitter.weights), default=None)
        if best is None or not best.fit.mean_square(fitter.weights) < float(np.mean(plain**2)):
            return _StandIn(plain, plain)
        runs = readings.pack(best.left_out_runs)
        return _StandIn(runs if best.left_out is None else readings.pack(best.left_out), runs)


def _left_out(
    readings: ReadingVector, fit: EffectFit, plain: Array, number: NDArray[np.intp]
) -> Residuals | None:
    """Return residuals with the runs of one number (runs,) held out after another; None if all share one."""
    groups = number[readings.run]
    if len(np.unique(groups)) < 2:
        return None
    return readings.unpack(heldout_residual(fit, groups, plain, exact_law=True))


def _rounded(
    fitter: Fitter, fit: EffectFit, candidate: StudyCandidate, uncertainty: Uncertainty
) -> dict[str, float]:
    """Return values at the decimals of their uncertainty, with more digits if rounding affects the fit."""
    wanted = fit.mean_square(fitter.weights)
    values: dict[str, float] = {}
    for digits in range(DIGITS, MOST_DIGITS + 1):
        values = {
            one.name: float(np.clip(rounded(one.value, one.sd, digits), *one.parameter.bounds))
            for one in uncertainty.estimates
        }
        effects = candidate.with_values(values)
        at = fitter.evaluate(StudyCandidate((), (), (), effects), np.zeros(0), fit.parts, fit.law)
        there = at.mean_square(fitter.weights)
        if abs(there - wanted) <= ROUNDING * wanted:
            break
    return values


def write_extended_study(
    source: Path,
    target: Path,
    study: Study,
    overrides: Sequence[str],
    extension: Extension | None,
    note: str,
    registry: Registry,
    *,
    notes_by_kind: Mapping[str, str] | None = None,
    learned: LearnedTerm | None = None,
    data: Sequence[Path] | None = None,
    full: bool = False,
) -> None:
    """Write the study with the effects of an extension, under a new name.

    Args:
        source: the study's file.
        target: the new file.
        study: as read from `source` with `overrides`.
        extension: the fitted effects; None where none was added.
        note: their origin, one line.
        registry: before the study's own plugin files were read.
        notes_by_kind: more words behind the note, by kind of effect.
        learned: a learned term, appended.
        data: the fitted files if they are not the study's; they become the new study's.
        full: whether the file must be self-contained.

    Raises:
        UserError: the file cannot be written, or what was written does not read back as the same study.
    """
    draft = StudyDraft(source, overrides)
    effects = study.effects if extension is None else extension.effects
    every = (*effects, *(() if learned is None else (learned.effect,)))
    meant = {**study.canonical(), "name": draft.name_after(target)}
    meant["effects"] = [effect.canonical() for effect in every]
    if data:
        files = tuple(str(file.absolute()) for file in data)
        named: str | tuple[str, ...] = files[0] if len(files) == 1 else files
        draft.set(("measurements", "file"), named if isinstance(named, str) else list(named))
        block = study.measurements or MeasurementsConfig(file=named)
        meant["measurements"] = {**block.canonical(), "file": named}
    if extension is not None:
        _set_fitted(draft, extension, note, notes_by_kind or {})
    if extension is not None and learned is None:  # its scatter is of the model without a learned term
        kept = posterior_block(extension.posterior, extension.scatter).canonical()
        draft.set(("posterior",), kept, "uncertainty; 'pliant compare' draws its bands from it")
        meant["posterior"] = kept
    if learned is not None:
        at = ("effects", len(effects))
        draft.set((*at, "kind"), KIND, f"{note}; {depends_on(learned)}: a description, no cause")
        for key, value in learned.form.block(learned.value, learned.sd).items():
            if key != "kind":
                draft.set((*at, key), value)
    draft.write(target, meant, registry, full)


def _set_fitted(draft: StudyDraft, extension: Extension, note: str, notes_by_kind: Mapping[str, str]) -> None:
    """Set the fitted effects with their uncertainty."""
    for slot, kind in sorted(zip(extension.candidate.slots, extension.kinds, strict=True)):
        at = ("effects", slot)
        draft.set((*at, "kind"), kind, note + notes_by_kind.get(kind, ""))
        for estimate in extension.uncertainty.estimates:
            if estimate.kind == kind:
                key, value = _written(extension.effects[slot], estimate, extension.values[estimate.name])
                draft.set((*at, key), value, estimate.words, spelled=True)


def _written(config: EffectConfig, estimate: Estimate, value: float) -> tuple[str, str | float]:
    """Return key and value as written in a study: with its unit if the config reads one, else the bare SI number."""
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
