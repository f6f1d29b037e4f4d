"""Choice of the next run: the run of a menu with the most expected information per minute.

The contenders are the hypotheses that are still probable, each at its fitted parameters with the uncertainty that the
measured runs leave. Readings of the new run are assumed to be as noisy and as autocorrelated as the measured ones.

A run is rated by its expected log Bayes factors between hypotheses and the probability of a right verdict.

Each hypothesis predicts the readings y of a run as m + G δ with its parameters' deviation δ ~ N(0, A⁻¹) from their
estimates, and noise of unit variance per independent reading:

    y | a ~ N(m_a, V_a),      V_a = 1 + f + G_a A_a⁻¹ G_aᵀ.

The differences that b cannot remove by changing its parameters, at the cost in the old data, distinguish it from a: the
expected log Bayes factor is the Kullback–Leibler divergence

    E_a ln p(y | a) / p(y | b) = ½ [tr(V_b⁻¹ V_a) − r + ln det V_b / det V_a + (m_a − m_b)ᵀ V_b⁻¹ (m_a − m_b)]

(Hunter and Reiner, Technometrics 7, 1965; Box and Hill, Technometrics 9, 1967). f is the effect of a slightly wrong
model on the readings: its sum of squares, spread over three of the r directions in which the hypotheses differ.
Outside these r directions all hypotheses are the same, so that the computation is restricted to them. Draws of y under
each hypothesis give the probability of a right verdict and the expected information (Lindley, Ann. Math. Statist. 27,
1956; Chaloner and Verdinelli, Statist. Sci. 10, 1995).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pliant.diagnosis.candidates import NINETY, EffectSet
from pliant.diagnosis.catalogue_view import CataloguePrediction, CatalogueView, seconds_per_reading
from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.evidence_table import NOTHING, THRESHOLDS, UNKNOWN, EvidenceThresholds, Kinds
from pliant.diagnosis.noise import LEAST_SQUARE, NoiseView
from pliant.diagnosis.verdict import named
from pliant.evidence.measured_model import MeasuredModel
from pliant.evidence.prediction import Predictor
from pliant.experiments.experiment_catalogue import static_catalogue, timed_catalogue
from pliant.experiments.planned_run import SET_UP, BenchScale, PlannedRun, unread_run
from pliant.experiments.system_catalogue import system_catalogue
from pliant.formatting import whole_percent
from pliant.interfaces.effect import EffectConfig
from pliant.measurements.repeats import repeat_groups
from pliant.records.design import Array
from pliant.records.measurement import Measurement

# Directions below this share of the largest are rounding.
FLAT = 1e-9
DRAWS = 256
# Errors of a form are smooth: they extend along few directions.
FORM_DIRECTIONS = 3


@dataclass(frozen=True, eq=False)
class Contender:
    """A hypothesis about a run.

    Attributes:
        probability: so far; those of all contenders need not sum to one.
        mean: (M,) readings over their noise, each times the root of the number of independent readings it counts for.
        slopes: (M, k) their slopes, likewise.
        information: (k, k) inverse covariance of the parameters.
        form: sum of squares that the inexactness of this hypothesis may add to the readings.
    """

    probability: float
    mean: Array
    slopes: Array
    information: Array
    form: float = 0.0


@dataclass(frozen=True, eq=False)
class ExpectedOutcome:
    """The expected result of a run for the contenders.

    Attributes:
        right: probability that the true one is then accepted.
        wrong: probability that another one is.
        information: expected fall of the entropy of the probabilities, in nats.
        factors: (K, K) expected log Bayes factor of row against column if the row is true.
    """

    right: float
    wrong: float
    information: float
    factors: Array


def expected(contenders: Sequence[Contender], temperature: float, accepted: float) -> ExpectedOutcome:
    """Return the expected outcome of a run, always with the same draws.

    Args:
        contenders: two or more.
        temperature: log Bayes factors are divided by this before they change a probability.
        accepted: probability from which a hypothesis is the verdict.
    """
    share = np.array([one.probability for one in contenders])
    share = share / share.sum()
    means, spreads = _reduced(contenders)
    roots: list[Array] = [np.asarray(np.linalg.cholesky(v), float) for v in spreads]
    log_det = np.array([2.0 * np.log(np.diag(root)).sum() for root in roots])
    factors = np.array(
        [
            [
                _divergence(means[a] - means[b], spreads[a], roots[b], log_det[b] - log_det[a])
                for b in range(len(share))
            ]
            for a in range(len(share))
        ]
    )
    rng = np.random.default_rng(0)
    before = -float(share @ np.log(np.maximum(share, 1e-300)))
    right = wrong = after = 0.0
    for a, probability in enumerate(share):
        drawn = means[a] + rng.standard_normal((DRAWS, means.shape[1])) @ roots[a].T
        odds = np.log(np.maximum(share, 1e-300)) + _log_density(drawn, means, roots, log_det) / temperature
        odds -= odds.max(axis=1, keepdims=True)
        posterior = np.exp(odds)
        posterior /= posterior.sum(axis=1, keepdims=True)
        sure = posterior >= accepted
        right += probability * float(sure[:, a].mean())
        wrong += probability * float(np.delete(sure, a, axis=1).any(axis=1).mean())
        after -= probability * float((posterior * np.log(np.maximum(posterior, 1e-300))).sum(axis=1).mean())
    return ExpectedOutcome(float(right), float(wrong), before - after, factors)


def _reduced(contenders: Sequence[Contender]) -> tuple[Array, list[Array]]:
    """Return means (K, r) and covariances (r, r) in the directions in which the contenders differ."""
    middle = np.mean([one.mean for one in contenders], axis=0)
    columns = [np.column_stack([one.mean - middle, one.slopes]) for one in contenders]
    left, sizes, _ = np.linalg.svd(np.column_stack(columns), full_matrices=False)
    basis = left[:, sizes > FLAT * max(float(sizes[0]), 1e-12)]
    r = min(max(basis.shape[1], 1), FORM_DIRECTIONS)
    spreads = []
    for one in contenders:
        slopes = basis.T @ one.slopes
        bent = slopes @ np.linalg.solve(one.information, slopes.T) if slopes.shape[1] else 0.0
        spreads.append((1.0 + one.form / r) * np.eye(basis.shape[1]) + bent)
    return np.array([basis.T @ (one.mean - middle) for one in contenders]), spreads


def _divergence(apart: Array, mine: Array, root: Array, log_ratio: float) -> float:
    """Return the Kullback–Leibler divergence to a normal distribution with this Cholesky root."""
    inverse = np.linalg.inv(root)
    scaled = inverse @ apart
    trace = float(np.sum((inverse @ mine) * inverse))
    return 0.5 * (trace - len(apart) + log_ratio + float(scaled @ scaled))


def _log_density(drawn: Array, means: Array, roots: Sequence[Array], log_det: Array) -> Array:
    """Return (draws, K) log densities up to a constant."""
    found = np.empty((len(drawn), len(means)))
    for b, root in enumerate(roots):
        scaled = np.linalg.solve(root, (drawn - means[b]).T)
        found[:, b] = -0.5 * (log_det[b] + (scaled**2).sum(axis=0))
    return found


# Contenders below this probability are ignored.
SMALL = 0.01
MOST_CONTENDERS = 8
REPEATING = "the medium run again, three times"
# A run with less expected information, in nats, does not help.
LEAST_INFORMATION = 0.02
# Runs with less than this share of the information of the best one are not chosen for being short.
TELLING = 0.5
# If the right verdict after a run is less likely than this, further runs will be needed.
LIKELY = 0.5
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
    """The recommended next run.

    Attributes:
        run, why: an order to the experimenter, and the reason.
        separates: pairs of hypotheses whose expected log Bayes factor, in either direction, is enough for a verdict.
        minutes: of motion and of setting up.
        name: of the menu's run.
        expected: probability that the verdict after it is right; NaN if it is unknown.
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
    """The state after the measured runs: hypotheses with their fits and probabilities, and the noise.

    Attributes:
        fits, probability: of every hypothesis.
        n_effective: independent readings among those that were measured.
        square: variance of one reading in units of the scales.
        thresholds: requirements of a verdict.
    """

    fits: Mapping[Kinds, EffectFit]
    probability: Mapping[Kinds, float]
    n_effective: float
    square: float
    thresholds: EvidenceThresholds = THRESHOLDS

    @staticmethod
    def from_fits(
        fits: Mapping[Kinds, EffectFit],
        probability: Mapping[Kinds, float],
        noise: NoiseView,
        thresholds: EvidenceThresholds = THRESHOLDS,
    ) -> Belief:
        """Return the state with the floor as the noise, or with the unit of the residuals if no floor is known."""
        known = math.isfinite(noise.floor_square) and noise.floor_square > LEAST_SQUARE
        square = noise.floor_square if known else 1.0
        return Belief(fits, probability, noise.n_effective, square, thresholds)

    @property
    def contenders(self) -> tuple[Kinds, ...]:
        """Return the hypotheses that predict something and are still probable, the most probable first."""
        found = [
            kinds
            for kinds, p in self.probability.items()
            if kinds != UNKNOWN and p >= SMALL and np.isfinite(self.fits[kinds].mean_square())
        ]
        return tuple(found[:MOST_CONTENDERS])

    @property
    def deciding(self) -> float:
        """Return the expected log Bayes factor that turns even odds into a verdict."""
        accepted = self.thresholds.accepted
        return self.thresholds.temperature * math.log(accepted / (1.0 - accepted))


def candidate_runs(predictor: MeasuredModel, own: Sequence[PlannedRun] = ()) -> tuple[PlannedRun, ...]:
    """Return a study's own runs, or the default menu at the measurement's scale; the static one without a clock."""
    if own:
        return tuple(own)
    if not isinstance(predictor, Predictor):
        return system_catalogue(predictor)
    scale = BenchScale.from_measurement(predictor.chain, predictor.measurement)
    timed = any(run.history.time_s is not None for run in predictor.measurement.runs)
    return timed_catalogue(scale) if timed else static_catalogue(scale)


def catalogue_view(
    predictor: MeasuredModel, scales: Mapping[str, float], n_effective: float, own: Sequence[PlannedRun] = ()
) -> CatalogueView:
    """Return the model in the menu, with as many independent readings per time as in the measurement."""
    slow = seconds_per_reading(predictor.measurement, len(scales), n_effective)
    return CatalogueView.from_predictor(predictor, candidate_runs(predictor, own), scales, slow)


def next_run(view: CatalogueView, belief: Belief, done: Collection[int] = ()) -> NextRun | None:
    """Return the best run; None with fewer than two contenders, or if no run would help."""
    runs = next_runs(view, belief, 1, done=done)
    return runs[0] if runs else None


def next_runs(
    view: CatalogueView,
    belief: Belief,
    count: int,
    minutes: float = math.inf,
    done: Collection[int] = (),
) -> tuple[NextRun, ...]:
    """Return up to `count` runs that fit into the minutes, each the best in addition to those before it.

    `done` are indices of runs that were measured (`done_before`); they are the last to be chosen.
    """
    contenders = belief.contenders
    if len(contenders) < 2:
        return ()
    looks = {kinds: view.evaluate(belief.fits[kinds].candidate, belief.fits[kinds].x) for kinds in contenders}
    if NOTHING not in looks:
        looks[NOTHING] = view.evaluate(EffectSet((), (), ()), np.zeros(0))
    chosen: list[int] = []
    found: list[NextRun] = []
    told = 0.0
    while len(found) < count:
        fit_in = [k for k, run in enumerate(view.runs) if run.minutes <= minutes]
        looked = {k: _outcome(view, belief, looks, [*chosen, k]) for k in fit_in}
        outcomes = {k: outcome for k, outcome in looked.items() if outcome is not None}
        ranked = _ranked(view, outcomes, told, {*done, *chosen})
        best = next((k for k in ranked if _helps(outcomes[k], told, belief)), None)
        if best is None:
            break
        found.append(_worded(view, belief, outcomes, ranked, best, told))
        chosen.append(best)
        told, minutes = outcomes[best].information, minutes - view.runs[best].minutes
    return tuple(found)


def what_next(
    view: CatalogueView, belief: Belief, verdict: str, measurement: Measurement
) -> tuple[NextRun | None, str]:
    """Return the next run, and a sentence if several explanations remain that no run of the menu would separate.

    Without repeatability, a repetition is recommended.
    """
    if verdict == "not_repeatable":
        return repeating(measurement), ""
    found = next_run(view, belief, done_before(view, measurement))
    return found, "" if found is not None else undecidable(belief)


def repeating(measurement: Measurement) -> NextRun:
    """Return the longest run again, three times."""
    history = max(measurement.runs, key=len).history
    seconds = 0.0 if history.time_s is None else float(history.time_s[-1] - history.time_s[0])
    why = "only runs with the same inputs show whether the bench repeats, and what moves between them"
    minutes = round(3 * seconds / 60, 1)
    planned = PlannedRun("repeat", REPEATING, history, round(SET_UP + seconds / 60, 1))
    return NextRun(REPEATING, why, (), minutes, planned.name, planned=planned)


def undecidable(belief: Belief) -> str:
    """Return a sentence if several explanations remain and no run of the menu separates them, else an empty text."""
    contenders = belief.contenders
    return NO_RUN.format(words=_either(contenders, " and ")) if len(contenders) > 1 else ""


def run_that_excites(view: CatalogueView, configs: Mapping[str, Sequence[EffectConfig]]) -> dict[str, str]:
    """Return for each effect the run of the menu in which it changes the readings most, in words, if any does."""
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


def information_matrix(fit: EffectFit, n_effective: float, square: float) -> Array:
    """Return (k, k) inverse covariance of a fit's parameters, from the readings and the plausible ranges.

    (k + m, k + m) with the m coefficients of the law's own error appended, if that is part of the hypothesis.
    """
    spans = np.array([high - low for low, high in (p.plausible for p in fit.candidate.parameters)])
    prior = (2.0 * NINETY / spans) ** 2
    slopes = fit.slopes
    if fit.law is not None:
        slopes = np.column_stack([slopes, fit.law.columns])
        prior = np.r_[prior, np.full(len(fit.law.coefficient), fit.law.size**-2.0)]
    seen = n_effective / (len(fit.residual) * square) * slopes.T @ slopes
    return np.asarray(seen + np.diag(prior))


def _outcome(
    view: CatalogueView, belief: Belief, looks: Mapping[Kinds, CataloguePrediction], chosen: Sequence[int]
) -> ExpectedOutcome | None:
    """Return the expected outcome of these runs together; None if a contender has no equilibrium in them."""
    rows = view.rows(chosen)
    for look in looks.values():
        rows = rows & np.isfinite(look.values) & np.isfinite(look.slopes).all(axis=1)
    if not rows.any():
        return None
    root = np.sqrt(view.worth[rows] / belief.square)
    plain = looks[NOTHING].values[rows] * root
    contenders = []
    for kinds in belief.contenders:
        fit, mean, slopes = belief.fits[kinds], looks[kinds].values[rows], looks[kinds].slopes[rows]
        if fit.law is not None and view.law_columns.shape[1]:
            mean = mean + view.law_columns[rows] @ fit.law.coefficient
            slopes = np.column_stack([slopes, view.law_columns[rows]])
        else:
            fit = replace(fit, residual=fit.raw, law=None)
        mean, slopes = mean * root, slopes * root[:, None]
        form = belief.thresholds.excited**2 * float(root @ root)
        form += belief.thresholds.model_form_tolerance * float(np.sum((mean - plain) ** 2))
        known = information_matrix(fit, belief.n_effective, belief.square)
        contenders.append(Contender(belief.probability[kinds], mean, slopes, known, form))
    return expected(contenders, belief.thresholds.temperature, belief.thresholds.accepted)


def _ranked(
    view: CatalogueView, outcomes: Mapping[int, ExpectedOutcome], told: float, done: Collection[int]
) -> list[int]:
    """Return runs by information per minute, after them those with less than a share of the best one's information.

    A short run with almost no information is not worthwhile. Runs that were done come last, because a slightly wrong
    model has the same error there again.
    """
    told_now = {index: outcome.information - told for index, outcome in outcomes.items()}
    enough = TELLING * max((told_now[k] for k in told_now if k not in done), default=0.0)
    return sorted(
        outcomes,
        key=lambda k: (k not in done, told_now[k] >= enough, told_now[k] / view.runs[k].minutes),
        reverse=True,
    )


def done_before(view: CatalogueView, measurement: Measurement) -> tuple[int, ...]:
    """Return indices of the menu's runs whose inputs are those of a run that was measured."""
    planned = [unread_run(run.history) for run in view.runs]
    n = len(measurement.runs)
    groups = repeat_groups(replace(measurement, runs=(*measurement.runs, *planned)))
    return tuple(sorted(k - n for group in groups if min(group.runs) < n for k in group.runs if k >= n))


def _helps(outcome: ExpectedOutcome, told: float, belief: Belief) -> bool:
    parted = np.minimum(outcome.factors, outcome.factors.T).max() >= belief.deciding
    return outcome.information - told >= LEAST_INFORMATION and (bool(parted) or outcome.right > 0.0)


def _worded(
    view: CatalogueView,
    belief: Belief,
    outcomes: Mapping[int, ExpectedOutcome],
    ranked: Sequence[int],
    best: int,
    told: float,
) -> NextRun:
    outcome, run, contenders = outcomes[best], view.runs[best], belief.contenders
    parted = np.minimum(outcome.factors, outcome.factors.T) >= belief.deciding
    after = "after it" if told == 0.0 else "after it and the runs above"
    pairs = [(contenders[i], b) for j, b in enumerate(contenders) for i in range(j) if parted[i, j]]
    why = (
        f"the explanations that are left predict different readings there: {_either(contenders, ' or ')}; the "
        f"verdict {after} names the right one with a chance of {whole_percent(outcome.right)}"
    )
    if outcome.right < LIKELY:
        why += ", so that more runs will be needed than this one"
    order = []
    for k in ranked:
        one, minutes = view.runs[k], view.runs[k].minutes
        gain = (outcomes[k].information - told) / minutes
        order.append(RankedRun(one.name, one.words, minutes, gain, outcomes[k].right))
    return NextRun(run.words, why, tuple(pairs), run.minutes, run.name, outcome.right, tuple(order), run)


def _either(contenders: Sequence[Kinds], between: str) -> str:
    return between.join(named(kinds) for kinds in contenders[:3])
