"""What to measure next: the run of a menu from which most is expected per minute of bench time.

The contenders are the hypotheses that are still probable, each at its fitted parameters and as unsure of them as the
measured runs leave it (`separation.py`). Readings of the new run are as noisy, and as much alike among neighbours, as
those that were measured.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pliant.diagnosis.candidates import NINETY, EffectSet
from pliant.diagnosis.catalogue_view import CataloguePrediction, CatalogueView, seconds_per_reading
from pliant.diagnosis.fitting import EffectFit, ReadingVector
from pliant.diagnosis.noise import NoiseView
from pliant.diagnosis.separation import Contender, ExpectedOutcome, expected
from pliant.diagnosis.verdict import (
    LEAST_SQUARE,
    NOTHING,
    THRESHOLDS,
    UNKNOWN,
    EvidenceThresholds,
    Kinds,
    named,
)
from pliant.evidence.prediction import Predictor
from pliant.experiments.experiment_catalogue import static_catalogue, timed_catalogue
from pliant.experiments.planned_run import SET_UP, PlannedRun
from pliant.experiments.scale import BenchScale
from pliant.interfaces.effect import EffectConfig
from pliant.measurements.repeats import repeat_groups
from pliant.records.design import Array
from pliant.records.measurement import MeasuredRun, Measurement

# Contenders below this probability are not asked.
SMALL = 0.01
MOST_CONTENDERS = 8
REPEATING = "the medium run again, three times"
# A run from which less is expected, in nats, does not help.
LEAST_INFORMATION = 0.02
# Runs that tell less than this share of what the most telling one tells are not chosen for being short.
TELLING = 0.5
NO_RUN = (
    "No run of the menu would decide between the explanations that are left: {words} predict the same in all of them, "
    "within the noise. Add other runs under 'protocols:' in the study, or another sensor."
)


@dataclass(frozen=True)
class RankedRun:
    """One run of the menu: nats of information expected per minute, probability of a right verdict after it."""

    name: str
    run: str
    minutes: float
    gain_per_minute: float
    expected: float


@dataclass(frozen=True)
class NextRun:
    """The run to do next.

    Attributes:
        run, why: an order to the bench, and the reason.
        separates: pairs of hypotheses whose expected log Bayes factor, either way, is enough for a verdict.
        minutes: of motion and of setting up.
        name: of the menu's run.
        expected: probability that the verdict after it is the right one; NaN where it is not known.
        ranked: all runs of the menu, the best first.
        planned: the run itself, for its file.
    """

    run: str
    why: str
    separates: tuple[tuple[Kinds, Kinds], ...]
    minutes: float
    name: str = ""
    expected: float = math.nan
    ranked: tuple[RankedRun, ...] = ()
    planned: PlannedRun | None = field(default=None, compare=False)


@dataclass(frozen=True, eq=False)
class Belief:
    """What the measured runs leave: hypotheses with their fits and probabilities, and the noise.

    Attributes:
        fits, probability: of every hypothesis.
        readings: the measured readings, for their number.
        n_effective: independent readings among them.
        square: variance of one reading in units of the scales.
        thresholds: what a verdict asks for.
    """

    fits: Mapping[Kinds, EffectFit]
    probability: Mapping[Kinds, float]
    readings: ReadingVector
    n_effective: float
    square: float
    thresholds: EvidenceThresholds = THRESHOLDS

    @staticmethod
    def of(
        fits: Mapping[Kinds, EffectFit],
        probability: Mapping[Kinds, float],
        readings: ReadingVector,
        noise: NoiseView,
        thresholds: EvidenceThresholds = THRESHOLDS,
    ) -> Belief:
        """The noise is the floor; the unit of the residuals where nothing tells one."""
        known = math.isfinite(noise.floor_square) and noise.floor_square > LEAST_SQUARE
        square = noise.floor_square if known else 1.0
        return Belief(fits, probability, readings, noise.n_effective, square, thresholds)

    @property
    def contenders(self) -> tuple[Kinds, ...]:
        """Hypotheses that predict something and are still probable, the most probable first."""
        found = [
            kinds
            for kinds, p in self.probability.items()
            if kinds != UNKNOWN and p >= SMALL and np.isfinite(self.fits[kinds].mean_square())
        ]
        return tuple(found[:MOST_CONTENDERS])

    @property
    def deciding(self) -> float:
        """Expected log Bayes factor that turns even odds into a verdict."""
        return self.thresholds.temperature * math.log(
            self.thresholds.believed / (1.0 - self.thresholds.believed)
        )


def catalogue_of(predictor: Predictor, own: Sequence[PlannedRun] = ()) -> tuple[PlannedRun, ...]:
    """A study's own runs, or the default menu at the measurement's scale; without a clock, one without time."""
    if own:
        return tuple(own)
    scale = BenchScale.of_measurement(predictor.chain, predictor.measurement)
    timed = any(run.history.time_s is not None for run in predictor.measurement.runs)
    return timed_catalogue(scale) if timed else static_catalogue(scale)


def view_of(
    predictor: Predictor, scales: Mapping[str, float], n_effective: float, own: Sequence[PlannedRun] = ()
) -> CatalogueView:
    """The model in the menu, its readings worth as much as the measured ones."""
    slow = seconds_per_reading(predictor.measurement, len(scales), n_effective)
    return CatalogueView.of(predictor, catalogue_of(predictor, own), scales, slow)


def next_run(view: CatalogueView, belief: Belief, done: Collection[int] = ()) -> NextRun | None:
    """The best run; None with fewer than two contenders, or where no run would help."""
    runs = next_runs(view, belief, 1, done=done)
    return runs[0] if runs else None


def next_runs(
    view: CatalogueView,
    belief: Belief,
    count: int,
    minutes: float = math.inf,
    done: Collection[int] = (),
) -> tuple[NextRun, ...]:
    """Up to `count` runs that fit into the minutes, each the best beside those before it.

    `done` are places of runs that were measured (`done_before`); they are the last to be chosen.
    """
    contenders = belief.contenders
    if len(contenders) < 2:
        return ()
    looks = _looks(view, belief, contenders)
    chosen: list[int] = []
    found: list[NextRun] = []
    told = 0.0
    while len(found) < count:
        outcomes = {
            index: outcome
            for index, run in enumerate(view.runs)
            if run.minutes <= minutes
            and (outcome := _outcome(view, belief, looks, [*chosen, index])) is not None
        }
        ranked = _ranked(view, outcomes, told, {*done, *chosen})
        helpful = [index for index in ranked if _helps(outcomes[index], told, belief)]
        if not helpful:
            break
        best = helpful[0]
        found.append(_worded(view, belief, contenders, outcomes, ranked, best, told))
        chosen.append(best)
        told, minutes = outcomes[best].information, minutes - view.runs[best].minutes
    return tuple(found)


def what_next(
    view: CatalogueView, belief: Belief, verdict: str, measurement: Measurement
) -> tuple[NextRun | None, str]:
    """The next run, and a sentence where several explanations are left that no run of the menu would part.

    A bench that does not repeat is asked to repeat.
    """
    if verdict == "not_repeatable":
        return repeating(measurement), ""
    found = next_run(view, belief, done_before(view, measurement))
    return found, "" if found is not None else undecidable(belief)


def repeating(measurement: Measurement) -> NextRun:
    """The longest run again, three times."""
    history = max(measurement.runs, key=len).history
    seconds = 0.0 if history.time_s is None else float(history.time_s[-1] - history.time_s[0])
    why = "only runs with the same inputs show whether the bench repeats, and what moves between them"
    minutes = round(3 * seconds / 60, 1)
    planned = PlannedRun("repeat", REPEATING, history, round(SET_UP + seconds / 60, 1))
    return NextRun(REPEATING, why, (), minutes, planned.name, planned=planned)


def undecidable(belief: Belief) -> str:
    """That several explanations are left and no run of the menu parts any of them; empty where one is left."""
    contenders = belief.contenders
    return NO_RUN.format(words=_either(contenders, " and ")) if len(contenders) > 1 else ""


def run_that_excites(view: CatalogueView, configs: Mapping[str, Sequence[EffectConfig]]) -> dict[str, str]:
    """For each effect the run of the menu in which it changes the readings most, in words; where any does."""
    plain = view.readings.pack(view.predictor.evaluate().runs)
    found = {}
    for kind, effects in configs.items():
        change = (view.readings.pack(view.predictor.evaluate(effects).runs) - plain) ** 2
        felt = [change[view.rows([k]) & np.isfinite(change)] for k in range(len(view.runs))]
        sizes = [float(np.mean(values)) if len(values) else 0.0 for values in felt]
        best = int(np.argmax(sizes))
        if sizes[best] > 0.0:
            found[kind] = view.runs[best].words
    return found


def information_of(fit: EffectFit, n_effective: float, square: float) -> Array:
    """(k, k) inverse covariance of a fit's parameters: what the readings say, and the plausible ranges."""
    spans = [high - low for low, high in (parameter.plausible for parameter in fit.candidate.parameters)]
    prior = np.diag([(2.0 * NINETY / span) ** 2 for span in spans])
    known: Array = n_effective / (len(fit.residual) * square) * fit.slopes.T @ fit.slopes + prior.reshape(
        len(spans), len(spans)
    )
    return known


def _looks(
    view: CatalogueView, belief: Belief, contenders: Sequence[Kinds]
) -> dict[Kinds, CataloguePrediction]:
    fits = {kinds: belief.fits[kinds] for kinds in contenders}
    looks = {kinds: view.look(fit.candidate, fit.x) for kinds, fit in fits.items()}
    plain = belief.fits.get(NOTHING)
    if NOTHING not in looks:
        looks[NOTHING] = view.look(EffectSet((), (), ()) if plain is None else plain.candidate, np.zeros(0))
    return looks


def _outcome(
    view: CatalogueView, belief: Belief, looks: Mapping[Kinds, CataloguePrediction], chosen: Sequence[int]
) -> ExpectedOutcome | None:
    """What these runs together are expected to tell; None where a contender has no equilibrium in them."""
    rows = view.rows(chosen)
    for look in looks.values():
        rows = rows & np.isfinite(look.values) & np.isfinite(look.slopes).all(axis=1)
    if not rows.any():
        return None
    root = np.sqrt(view.worth[rows] / belief.square)
    plain = looks[NOTHING].values[rows] * root
    law = belief.thresholds.excited**2 * float(root @ root)
    contenders = []
    for kinds in belief.contenders:
        mean = looks[kinds].values[rows] * root
        form = law + belief.thresholds.model_form_tolerance * float(np.sum((mean - plain) ** 2))
        known = information_of(belief.fits[kinds], belief.n_effective, belief.square)
        slopes = looks[kinds].slopes[rows] * root[:, None]
        contenders.append(Contender(belief.probability[kinds], mean, slopes, known, form))
    return expected(contenders, belief.thresholds.temperature, belief.thresholds.believed)


def _ranked(
    view: CatalogueView, outcomes: Mapping[int, ExpectedOutcome], told: float, done: Collection[int]
) -> list[int]:
    """Runs by what they tell per minute; those that tell less than a share of what the best one tells come later.

    A short run that hardly tells anything is no bargain. Runs that were done come last: a model that is slightly off
    is off there in the same way again.
    """
    told_now = {index: outcome.information - told for index, outcome in outcomes.items()}
    enough = TELLING * max((told_now[k] for k in told_now if k not in done), default=0.0)
    return sorted(
        outcomes,
        key=lambda k: (k not in done, told_now[k] >= enough, told_now[k] / view.runs[k].minutes),
        reverse=True,
    )


def done_before(view: CatalogueView, measurement: Measurement) -> tuple[int, ...]:
    """Places of the menu's runs whose inputs are those of a run that was measured."""
    planned = [MeasuredRun(run.history, {}, {}, np.ones(len(run.history)), np.zeros(0)) for run in view.runs]
    n = len(measurement.runs)
    groups = repeat_groups(replace(measurement, runs=(*measurement.runs, *planned)))
    return tuple(sorted(k - n for group in groups if min(group.runs) < n for k in group.runs if k >= n))


def _helps(outcome: ExpectedOutcome, told: float, belief: Belief) -> bool:
    parted = np.minimum(outcome.factors, outcome.factors.T).max() >= belief.deciding
    return outcome.information - told >= LEAST_INFORMATION and (bool(parted) or outcome.right > 0.0)


def _worded(
    view: CatalogueView,
    belief: Belief,
    contenders: Sequence[Kinds],
    outcomes: Mapping[int, ExpectedOutcome],
    ranked: Sequence[int],
    best: int,
    told: float,
) -> NextRun:
    outcome, run = outcomes[best], view.runs[best]
    factors = np.minimum(outcome.factors, outcome.factors.T)
    pairs = tuple(
        (a, b)
        for j, b in enumerate(contenders)
        for i, a in enumerate(contenders[:j])
        if factors[i, j] >= belief.deciding
    )
    why = (
        f"the explanations that are left predict different readings there: {_either(contenders, ' or ')}; the "
        f"verdict after it is expected to be right with {outcome.right:.0%}"
    )
    order = tuple(
        RankedRun(
            view.runs[k].name,
            view.runs[k].words,
            view.runs[k].minutes,
            (outcomes[k].information - told) / view.runs[k].minutes,
            outcomes[k].right,
        )
        for k in ranked
    )
    return NextRun(run.words, why, pairs, run.minutes, run.name, outcome.right, order, run)


def _either(contenders: Sequence[Kinds], between: str) -> str:
    return between.join(named(kinds) for kinds in contenders[:3])
