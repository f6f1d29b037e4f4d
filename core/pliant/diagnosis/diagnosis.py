"""Diagnosis of the missing physical effect: the whole path from a study and measurements to a verdict.

The result is described in sentences for experimenters.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pliant.diagnosis.candidates import EffectSet, candidate_kinds
from pliant.diagnosis.catalogue_view import CatalogueView
from pliant.diagnosis.classes import EffectClass, split_classes
from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.evidence_table import (
    LAW,
    NOTHING,
    THRESHOLDS,
    UNKNOWN,
    EvidenceTable,
    EvidenceThresholds,
    Kinds,
)
from pliant.diagnosis.excitation import (
    ConfoundedPair,
    Detectable,
    Excitation,
    applicable,
    confounded_with,
    detectable,
    excitations,
    not_excited,
)
from pliant.diagnosis.fitting import Fitter
from pliant.diagnosis.isolating_run import isolating_run
from pliant.diagnosis.law_discrepancy import LawReference
from pliant.diagnosis.law_off import LawOff, law_off
from pliant.diagnosis.law_posterior import LawErrorPrior, law_error_prior
from pliant.diagnosis.learned_term import LearnedTerm, learn
from pliant.diagnosis.learned_words import offer
from pliant.diagnosis.left_out import condition_indices, heldout_residual
from pliant.diagnosis.next_run import (
    Belief,
    NextRun,
    catalogue_view,
    done_before,
    run_that_excites,
    what_next,
)
from pliant.diagnosis.noise import LEAST_SQUARE, NoiseView, noise_view
from pliant.diagnosis.places import kinds_at_places
from pliant.diagnosis.readings import SHARE_OF_RANGE, ReadingVector, readings_over_floor
from pliant.diagnosis.search import HypothesisSearch, Tick
from pliant.diagnosis.uncertainty import Uncertainty, uncertainty
from pliant.diagnosis.verdict import Judgement, Verdict, judge
from pliant.errors import NotReachedError
from pliant.evidence.bookkeeping.findings import find_mistakes
from pliant.evidence.bookkeeping.mistake import Mistake
from pliant.evidence.compared import predict_knowing
from pliant.evidence.covariates import covariates
from pliant.evidence.error_bins import run_residuals
from pliant.evidence.importance import importance
from pliant.evidence.measured_model import MeasuredModel
from pliant.evidence.prediction import Predictor
from pliant.execution.executors import Executor, Workers, executor_for, own_threads
from pliant.experiments.planned_run import PlannedRun
from pliant.formatting import listed, percent, whole_percent
from pliant.measurements.floors import floor_remarks
from pliant.measurements.repeats import repeat_groups
from pliant.measurements.thinning import downsample
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.records.remark import Rank, Remark
from pliant.registry.discovery import Registry

MOST_PROFILED = 3
# A diagnosis is refused if the model has no equilibrium in a larger share of the samples.
MOST_WITHOUT = 0.5


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The result of a diagnosis and its grounds.

    Attributes:
        measurement: the readings that were judged: a part of long recordings, and none after unknown states.
        judgement: verdict, probabilities, selected effects, credible set, reasons.
        table, fits: every hypothesis that was fitted.
        scales: noise floor of each output, the unit of all residuals.
        noise: estimated from the residuals of the best hypothesis.
        not_excited: kinds that these runs could not show, each with the run that would.
        indistinguishable: pairs that these runs cannot separate.
        classes: excited effects that none of these runs distinguishes, by inputs and model alone; those with a
            remaining explanation have the run that would split them.
        detectable: smallest strengths that would be found.
        depends_on: covariates that explain the remaining residual, the most important first.
        next_run: the proposed next run, if the verdict is open.
        remarks: limitations of the verdict, in sentences.
        circumstances: names of covariates in words, as in `compare`.
        not_tried: candidates that could not be judged, and why, in sentences; also part of `remarks`.
        explained: the hypothesis whose residual `depends_on` describes.
        learned: the term that describes the error better than nothing if no listed effect explains it.
        law_off: the error of the law with the most probable listed hypothesis; None if the readings show none.
        law_alone: the error of the law if no effect is added, whatever the verdict; None if nothing shows one.
        bookkeeping: probable mistakes of the record, before any physics.
        law: the law's own error as it is part of the fits; None if the law is taken as exact.
        estimates: parameters of every hypothesis with their uncertainty; profile intervals for the credible ones.
    """

    measurement: Measurement
    judgement: Judgement
    table: EvidenceTable
    fits: Mapping[Kinds, EffectFit]
    readings: ReadingVector
    noise: NoiseView
    not_excited: Mapping[str, str]
    indistinguishable: tuple[ConfoundedPair, ...]
    classes: tuple[EffectClass, ...]
    detectable: tuple[Detectable, ...]
    depends_on: Mapping[str, float]
    circumstances: Mapping[str, str]
    next_run: NextRun | None
    remarks: tuple[str, ...]
    not_tried: tuple[str, ...]
    explained: Kinds
    estimates: Mapping[Kinds, Uncertainty]
    excitations: Mapping[str, Excitation]
    wall_s: float
    learned: LearnedTerm | None = None
    law_off: LawOff | None = None
    law_alone: LawOff | None = None
    bookkeeping: tuple[Mistake, ...] = ()
    law: LawReference | None = None

    @property
    def scales(self) -> Mapping[str, float]:
        return self.readings.scales

    @property
    def verdict(self) -> Verdict:
        return self.judgement.verdict

    @property
    def selected(self) -> Kinds:
        return self.judgement.selected

    def left_out_ratio(self, kinds: Kinds) -> float:
        """Return the RMS error on held-out runs over the floor; that of the noise for an effect outside the list."""
        if kinds == UNKNOWN:
            return self.table.over_floor(self.noise.floor_square)
        row = self.table.rows[kinds]
        return self.table.over_floor(row.heldout_square if kinds else row.as_it_is)

    def left_out_errors(self, kinds: Kinds) -> dict[str, float]:
        """Return the RMS error of each output on held-out runs, SI."""
        plain = self.fits[NOTHING].raw
        left = heldout_residual(self.fits[kinds], self.readings.fold, plain) if kinds else plain
        return {
            name: float(np.sqrt(np.mean(left[self.readings.output == k] ** 2))) * self.scales[name]
            for k, name in enumerate(self.readings.outputs)
        }


def diagnose(
    predictor: MeasuredModel,
    *,
    kinds: Sequence[str] | None = None,
    thresholds: EvidenceThresholds = THRESHOLDS,
    runs: Sequence[PlannedRun] = (),
    tick: Tick | None = None,
    workers: Workers = 1,
    law_prior: LawErrorPrior | None = None,
) -> Diagnosis:
    """Fit every candidate, weigh the evidence, and return the verdict with its grounds.

    Args:
        predictor: a study's model, driven by the measured histories.
        kinds: candidates; all effects applicable to this chain by default.
        thresholds: thresholds.
        runs: runs that are possible next; the default menu without them.
        tick: called with the name of each hypothesis when it has been fitted.
        workers: where hypotheses are fitted: processes, the scheduler of a dask cluster, an executor.
        law_prior: prior of the laws' error; the study's by default.

    Raises:
        UserError: an unknown kind, or no reading can be used.
        NotReachedError: the model has no equilibrium in most of the measured states.
    """
    started = time.perf_counter()
    registry = predictor.context.registry
    asked = (
        predictor.default_kinds(candidate_kinds(registry))
        if kinds is None
        else candidate_kinds(registry, kinds)
    )
    known, unknown = predictor.with_known_states()
    short, shortened = downsample(known, predictor.spatial)
    if shortened:
        predictor = predictor.for_runs(short)
    mistakes = find_mistakes(predictor)
    plain = predict_knowing(predictor, mistakes)
    measurement, lost = _followed(short, plain, isinstance(predictor, Predictor))
    readings, floors = readings_over_floor(measurement, run_residuals(measurement, plain))
    fitter = Fitter(predictor, readings)
    nothing = fitter.fit(EffectSet.from_kinds(registry, NOTHING))
    seen = noise_view(
        measurement, readings.unpack(nothing.residual), readings.scales, repeat_groups(measurement)
    )
    law_prior = law_prior or law_error_prior(predictor.law_error)
    fitter = fitter.with_law_error(nothing, law_prior, seen.n_effective)
    law = fitter.joint_law
    threads = own_threads() if predictor.threads else 1
    with executor_for(workers, threads=threads) as executor:
        if executor.remote:
            fitter.checked()
        chosen, left_out = applicable(registry, fitter, asked, executor)
        shown = excitations(registry, fitter, nothing, chosen, executor)
        search = HypothesisSearch(
            registry, measurement, readings, fitter, thresholds, shown, executor=executor
        )
        search.tick = tick or search.tick
        search.fit_singles(chosen)
        at_places, search.shown = _with_places(search, predictor, executor)
        chosen += at_places
        table = search.run(chosen)
        shown = search.shown
    unexcited = not_excited(shown, thresholds)
    not_tried: list[str] = [
        Remark(f"'{kind}' was left out: {reason}", Rank.DETAIL, kind) for kind, reason in left_out.items()
    ]
    not_tried += [
        f"'{kind}' could not be judged: with it the model finds no equilibrium at any start of its fit; "
        f"'pliant check effect {kind}' may show the cause."
        for kind in chosen
        if not np.all(np.isfinite(search.fits[(kind,)].residual))
    ]
    bare = law_off(predictor, measurement, readings, law, search.fits[NOTHING], table.noise)
    judgement = judge(table, thresholds, len(chosen) - len(unexcited), f" {bare.words}" if bare else "")
    explained = next(kinds for kinds in judgement.probability if kinds != UNKNOWN)
    off = None
    if table.law_is_off(explained):
        fit = search.fits[explained]
        off = law_off(predictor, measurement, readings, law, fit, table.noise) if explained else bare
    noiseless = Remark(
        f"The readings have no noise: errors are weighed against {SHARE_OF_RANGE:.0%} of each output's range.",
        Rank.FLOOR,
    )
    residuals = readings.unpack(search.fits[explained].residual)
    found = covariates(measurement, readings.unpack(readings.values - search.fits[explained].residual))
    n = table.noise.n_effective
    view = catalogue_view(predictor, readings.scales, n, runs).with_law_error(law)
    belief = Belief.from_fits(search.fits, judgement.probability, table.noise, thresholds)
    ahead, undecided = what_next(view, belief, judgement.verdict, measurement)
    reasons = importance(residuals, found, dict(readings.scales))
    if ahead is None and judgement.verdict == "unknown_effect" and not isinstance(predictor, Predictor):
        ahead = isolating_run(view.runs, reasons, done_before(view, measurement))
    excited = {kind: one for kind, one in shown.items() if kind not in unexcited}
    return Diagnosis(
        measurement=measurement,
        judgement=judgement,
        table=table,
        fits=search.fits,
        readings=readings,
        noise=table.noise,
        not_excited=_ways_to_excite(view, registry, shown, unexcited),
        indistinguishable=confounded_with(shown, search.fits, n, law),
        classes=split_classes(registry, view, excited, n, judgement.credible, law),
        detectable=detectable(shown, n, thresholds, law),
        depends_on=reasons,
        circumstances={item.name: item.shown.label for item in found.items},
        next_run=ahead,
        remarks=(
            *measurement.remarks,
            *unknown,
            *shortened,
            *lost,
            *floor_remarks({name: floors[name] for name in predictor.outputs}),
            *not_tried,
            *predictor.remarks,
            *([noiseless] if table.noise.floor_square <= LEAST_SQUARE else []),
            *([undecided] if undecided else []),
        ),
        explained=explained,
        not_tried=tuple(not_tried),
        estimates=_estimates(fitter, search.fits, judgement, n),
        excitations=shown,
        learned=_learned(predictor, readings, table) if judgement.verdict == "unknown_effect" else None,
        wall_s=time.perf_counter() - started,
        law_off=off,
        law_alone=bare,
        bookkeeping=mistakes,
        law=law,
    )


def _with_places(
    search: HypothesisSearch, predictor: MeasuredModel, executor: Executor
) -> tuple[list[str], dict[str, Excitation]]:
    """Return further kinds at single places, and the excitations of all kinds."""
    kinds, shown = kinds_at_places(search, predictor, executor)
    return kinds, {**search.shown, **shown}


def _learned(predictor: MeasuredModel, readings: ReadingVector, table: EvidenceTable) -> LearnedTerm | None:
    """Return a learned term on the unchanged model, or None."""
    groups = [group.runs for group in repeat_groups(predictor.measurement)]
    return learn(predictor, readings, table.noise, condition_indices(readings.n_runs, groups)[readings.run])


def _followed(
    measurement: Measurement, plain: Sequence[Mapping[str, Array]], has_law: bool
) -> tuple[Measurement, tuple[str, ...]]:
    """Return the readings at which the unchanged model has a state, and a sentence about the others.

    A chain with a law may have no equilibrium there; a user's own model diverges or returns NaN.
    """
    runs, without = [], {}
    for run, model in zip(measurement.runs, plain, strict=True):
        lost = np.any([~np.isfinite(values) for values in model.values()], axis=0)
        if lost.any():
            without[run.name] = int(lost.sum())
            run = run.with_outputs({name: np.where(lost, np.nan, v) for name, v in run.outputs.items()})
        runs.append(run)
    if not without:
        return measurement, ()
    worst, n = max(without, key=lambda name: without[name]), sum(without.values())
    of = sum(map(len, runs))
    if not has_law:
        where = f"The model has no finite reading in {n} of {of} samples, most of them in run '{worst}'"
        return replace(measurement, runs=tuple(runs)), (f"{where}: these readings are left out.",)
    if n > MOST_WITHOUT * of:
        raise NotReachedError(
            f"{measurement.source}: the model has no equilibrium in {n} of {of} measured states, most of them in run "
            f"'{worst}'; look at the loads and their units, and at the law's domain."
        )
    return replace(measurement, runs=tuple(runs)), (
        f"The model has no equilibrium in {n} of {of} samples, most of them in run '{worst}': these readings are left "
        "out. Look at their loads, and at the law's domain.",
    )


def _estimates(
    fitter: Fitter, fits: Mapping[Kinds, EffectFit], judgement: Judgement, n: float
) -> dict[Kinds, Uncertainty]:
    leading = judgement.credible[:MOST_PROFILED]
    return {
        kinds: uncertainty(fitter, fit, n, profiles=kinds in leading)
        for kinds, fit in fits.items()
        if len(fit.x) and np.isfinite(fit.mean_square())
    }


def _ways_to_excite(
    view: CatalogueView, registry: Registry, shown: Mapping[str, Excitation], unexcited: Sequence[str]
) -> dict[str, str]:
    """Return for each kind not excited the run that its plugin names, or the one of the menu that shows it most."""
    words = {kind: registry.get("effect", kind).implementation_class().notes.excitation for kind in unexcited}
    unnamed = [kind for kind, text in words.items() if not text]
    if unnamed:
        configs = {kind: EffectSet.from_kinds(registry, (kind,)).configs(shown[kind].x) for kind in unnamed}
        words.update(run_that_excites(view, configs))
    return words


MOST_NAMED = 4


def explanation(diagnosis: Diagnosis, registry: Registry, reasons: bool = True) -> list[str]:
    """Return the reasons, the consequences, and the next run; `reasons`: include those of the verdict."""
    proposed = next_words(diagnosis)
    return [*why(diagnosis, registry, reasons), *([proposed] if proposed else [])]


def next_words(diagnosis: Diagnosis) -> str:
    """Return the next run in words; empty if the verdict needs none."""
    if diagnosis.next_run is None or diagnosis.verdict == "missing_effect":
        return ""
    return f"Next: {diagnosis.next_run.run} ({diagnosis.next_run.minutes:g} min): {diagnosis.next_run.why}."


def why(diagnosis: Diagnosis, registry: Registry, reasons: bool = True) -> list[str]:
    """Return the verdict's reasons, the signatures of the selected effects, and the covariates of the residual."""
    lines = list(diagnosis.judgement.reasons) if reasons else []
    if diagnosis.law_off is not None:
        lines.append(law_words(diagnosis.law_off, diagnosis.explained))
    for kind in diagnosis.selected:
        lines += in_plain_words(registry, kind)
        twins = [pair.b for pair in diagnosis.indistinguishable if pair.a == kind][:MOST_NAMED]
        if twins:  # look-alikes that these runs cannot exclude
            lines.append(f"Under these runs {kind} can hardly be distinguished from {' or '.join(twins)}.")
    if diagnosis.verdict != "missing_effect":  # a selected effect is distinguished from its class
        left = {kind for kinds in diagnosis.judgement.credible for kind in kinds}
        next_run = diagnosis.next_run.name if diagnosis.next_run is not None else ""
        lines += [class_words(one, left, next_run) for one in diagnosis.classes if left & set(one.kinds)]
    if diagnosis.verdict == "ambiguous":  # an inspection may decide what the readings do not
        left_kinds = dict.fromkeys(kind for kinds in diagnosis.judgement.credible for kind in kinds)
        for kind in [kind for kind in left_kinds if kind not in (UNKNOWN[0], LAW)][:MOST_NAMED]:
            lines += [" ".join(in_plain_words(registry, kind, signature=False))]
    if diagnosis.verdict in ("unknown_effect", "nothing_missing", "insufficient_data"):
        lines += _dependence(diagnosis)
    if diagnosis.learned is not None:
        lines.append(offer(diagnosis.learned))
    return lines


def law_words(off: LawOff, beside: Kinds) -> str:
    """Return a sentence on the law's error with the best explanation, and on how to correct it."""
    more = f"Beside {' + '.join(beside)} the" if beside else "The"
    return (
        f"{more} law is off {off.words}, by {percent(off.size)} of its torque range, which explains "
        f"{whole_percent(off.share)} of the squared error{' that is left' if beside else ''}. Solve FEM states there, "
        "try another surrogate or material, or let 'pliant improve' add the correction."
    )


def in_plain_words(registry: Registry, kind: str, signature: bool = True) -> list[str]:
    """Return an effect's plain name with its signature, and what to inspect, as far as its notes state them."""
    component = registry.get("effect", kind)
    notes = component.implementation_class().notes
    known = f" {notes.signature}" if signature and notes.signature else ""
    lines = [f"{kind}, {component.summary}:{known}"] if known else [f"{kind}: {component.summary}."]
    if is_record_mistake(registry, kind):
        lines.append(f"{kind} is a mistake of the record: correct the file, not the physics.")
    return [*lines, *([f"On the bench: {notes.inspection}"] if notes.inspection else [])]


def is_record_mistake(registry: Registry, kind: str) -> bool:
    """Return whether an effect is a mistake of the record, which is corrected in the file."""
    return bool(registry.get("effect", kind).implementation_class().notes.origin == "bench")


def class_words(one: EffectClass, first: Collection[str] = (), next_run: str = "") -> str:
    """Return which effects look the same, those of `first` named first, and the run that distinguishes them.

    If a `next_run` is proposed for the whole diagnosis, no other run is named: the report lists those.
    """
    kinds = sorted(one.kinds, key=lambda kind: (kind not in first, kind))
    kinds = ["the law's own shape" if kind == LAW else kind for kind in kinds]
    more = len(kinds) - MOST_NAMED
    names = kinds if more <= 1 else [*kinds[:MOST_NAMED], f"{more} more"]
    alike = f"At twice the noise these runs do not distinguish {listed(names)}"
    if not one.run:
        return f"{alike}, and no run of the menu would."
    if next_run and one.run != next_run:
        return f"{alike}."
    would = "would" if len(one.parts) == len(kinds) else f"would split them into {len(one.parts)} groups"
    return f"{alike}; the run '{one.run}' {would} ({one.words}, {one.minutes:g} min)."


def _dependence(diagnosis: Diagnosis) -> list[str]:
    """Return a sentence on the covariates of the best explanation's residual."""
    most = [(name, value) for name, value in diagnosis.depends_on.items() if value >= 0.1][:3]
    if not most:
        return []
    words = ", ".join(f"{circumstance(diagnosis, name)} ({whole_percent(value)})" for name, value in most)
    return [f"What is unexplained depends on {words}: shares of its variance on runs left out."]


def circumstance(diagnosis: Diagnosis, name: str) -> str:
    """Return a covariate, or a pair of them, in words."""
    return " × ".join(diagnosis.circumstances.get(part, part) for part in name.split(" × "))
