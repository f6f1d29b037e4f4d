"""Which number would explain counts: every candidate's binomial likelihood at a few levels, and what follows.

A hypothesis moves one number, or several at once, over a grid of levels of their plausible ranges; each level is
equally likely before the counts. Its evidence is the mean of its likelihoods over the grid: a hypothesis pays for every
level that does not fit, and needs no further price for its parameters (MacKay, *Information Theory, Inference, and
Learning Algorithms*, chapter 28). Trial k draws the same random numbers at every level (common random numbers), so that
levels differ by what was moved and not by luck.

"Nothing is missing" is the model as it is; "outside the list" gives each condition a probability of its own, uniform.
The three kinds of explanation (nothing, something listed, something else) are equally probable before the counts, and
what is listed shares its third: the price of looking at many (Scott and Berger, *Ann. Statist.* 38 (2010) 2587).
What changes no simulated count takes no part. Evidences are divided by 2, as in every diagnosis: no simulation is
exact. Repeats that scatter more than binomially divide them again.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import scipy
from pydantic import ValidationError

from pliant.config.measurements import PlausibleRange
from pliant.config.problems import sentences
from pliant.config.task_keys import TaskKey, changed_task, need_key, value_at
from pliant.diagnosis.evidence_table import NOTHING, UNKNOWN, Kinds, credible_set
from pliant.diagnosis.evidence_table import probabilities as verdict_probabilities
from pliant.diagnosis.verdict import NOT_PREDICTIVE, Judgement, Verdict, named
from pliant.errors import UserError
from pliant.evidence.binomial import Count, fisher_p, holm, log_own, log_predictive
from pliant.evidence.counts import (
    ConditionResult,
    CountComparison,
    CountedStudy,
    Setting,
    compare_counts,
    simulate_trials,
)
from pliant.evidence.excess import Excess
from pliant.execution.executors import Workers
from pliant.interfaces.effect import EffectConfig
from pliant.pipeline.workbench import Workbench
from pliant.records.counts import CountCondition
from pliant.records.design import Array
from pliant.registry.discovery import Registry
from pliant.tabular.units import ENDINGS
from pliant.units import UnitError, parse_quantity

STEPS = 4  # levels over a plausible range


@dataclass(frozen=True)
class VariedParameter:
    """One number that may be wrong.

    Attributes:
        kind: the effect's kind, or the dotted key of the task.
        name: ``stiffness.factor``, ``task.friction``, ``task.friction where cylinder``.
        unit: SI unit.
        levels: values to try, without the present one.
        neutral: the present value; None where it differs between conditions or is not stated.
        model: config of the effect, None for a key of the task.
        field: of the effect's config.
        where: conditions to which it is limited: (dotted key, value) pairs.
    """

    kind: str
    name: str
    unit: str
    levels: tuple[float, ...]
    neutral: float | None = None
    model: type[EffectConfig] | None = None
    field: str = ""
    where: tuple[tuple[str, Any], ...] = ()

    def moved(self, setting: Setting, condition: CountCondition, level: float) -> Setting:
        """The setting of a condition with this number at a level."""
        if any(condition.changes.get(key) != value for key, value in self.where):
            return setting
        if self.model is None:
            return replace(setting, task=changed_task(setting.task, {self.kind: level}))
        effect = self.model.model_validate({"kind": self.kind, self.field: level})
        return replace(setting, effects=(*setting.effects, effect))


def effect_parameters(
    registry: Registry, kinds: Sequence[str] | None, steps: int = STEPS
) -> list[VariedParameter]:
    """Each strength of the kinds; by default of all effects with one parameter that act before the sensor.

    Effects of rate and memory have several parameters and are tried only where they are asked for: their other
    parameters stay at typical values.
    """
    varied = []
    for kind in kinds if kinds is not None else registry.kinds("effect"):
        component = registry.get("effect", kind)
        effect = component.implementation_class()
        model = cast(type[EffectConfig], component.config_model())
        parameters = model.fit_parameters()
        strengths = [p for p in parameters if p.role == "strength"]
        if kinds is None and (effect.place == "output" or len(parameters) != 1):
            continue
        for p in strengths:
            levels = levels_of(p.plausible[0], p.plausible[1], p.neutral, steps)
            varied.append(VariedParameter(kind, f"{kind}.{p.name}", p.unit, levels, p.neutral, model, p.name))
    return varied


def task_parameters(
    counted: CountedStudy, ranges: Sequence[PlausibleRange], steps: int = STEPS
) -> list[VariedParameter]:
    """A parameter for each plausible range of the study.

    Raises:
        UserError: a range of a key that the task does not have, whose ends are no such quantity, or which the task
            does not allow; a `where` that no condition of the file has.
    """
    return [_task_parameter(counted, one, steps) for one in ranges]


def levels_of(low: float, high: float, neutral: float | None, steps: int) -> tuple[float, ...]:
    """`steps` levels from low to high: half on each side of the present value where it is known and inside."""
    if neutral is None:
        return tuple(np.linspace(low, high, steps).tolist())
    if not low < neutral < high:
        found = np.linspace(low, high, steps + 1)
        return tuple(float(v) for v in found if v != neutral)[-steps:]
    below, above = steps // 2, steps - steps // 2
    down = neutral + (low - neutral) * np.arange(below, 0, -1) / below
    up = neutral + (high - neutral) * np.arange(1, above + 1) / above
    return tuple(float(v) for v in (*down, *up))


def _task_parameter(counted: CountedStudy, one: PlausibleRange, steps: int) -> VariedParameter:
    place = "'measurements.plausible' names"
    key = need_key(type(counted.task), one.key, ENDINGS, place)
    low, high = (_si(value, key, one) for value in (one.low, one.high))
    where = {
        need_key(type(counted.task), name, ENDINGS, f"{place} in 'where'").dotted: value
        for name, value in one.where.items()
    }
    meant = [c for c in counted.counts.conditions if all(c.changes.get(k) == v for k, v in where.items())]
    if not meant:
        raise UserError(
            f"'measurements.plausible' has {one.key} only where {_said(one.where)}, and no condition of "
            f"{counted.counts.source} is that."
        )
    present = {value_at(counted.task_of(c), key) for c in meant}
    neutral = float(present.pop()) if len(present) == 1 and None not in present else None
    for level in (low, high):
        try:
            changed_task(counted.task_of(meant[0]), {key.dotted: level})
        except ValidationError as error:
            text = sentences(error, type(counted.task), lambda at: "", ("task",))
            raise UserError(f"'measurements.plausible' of {one.key}: {text}") from None
    name = f"{key.dotted} where {_said(one.where)}" if where else key.dotted
    levels = levels_of(low, high, neutral, steps)
    return VariedParameter(key.dotted, name, key.si or "1", levels, neutral, where=tuple(where.items()))


def _si(value: float | str, key: TaskKey, one: PlausibleRange) -> float:
    if not isinstance(value, str):
        return float(value)
    try:
        return parse_quantity(value, key.si or "dimensionless")
    except UnitError as error:
        raise UserError(f"'measurements.plausible' of {one.key}: {error}.") from None


def _said(where: Mapping[str, Any]) -> str:
    return " and ".join(f"{key.removeprefix('task.')} is {value}" for key, value in where.items())


TEMPERATURE = 2.0
Point = tuple[tuple[VariedParameter, ...], tuple[float, ...]]  # what is moved, and its levels


@dataclass(frozen=True, eq=False)
class Explanation:
    """One hypothesis after the scan.

    Attributes:
        parameters: what it moves; empty for the model as it is.
        grid: levels of the parameters, one tuple per point.
        simulated: counts of every point, by condition.
        log_likelihood: (points, conditions) of the measured counts.
    """

    parameters: tuple[VariedParameter, ...]
    grid: tuple[tuple[float, ...], ...]
    simulated: tuple[tuple[Count, ...], ...]
    log_likelihood: Array

    @property
    def kinds(self) -> Kinds:
        """Its name in a table: the parameters' names."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def total(self) -> Array:
        """(points,) log-likelihood of all conditions together."""
        return np.asarray(self.log_likelihood.sum(axis=1))

    @property
    def log_evidence(self) -> float:
        """log of the mean likelihood over the grid."""
        return float(scipy.special.logsumexp(self.total) - np.log(len(self.total)))

    @property
    def best(self) -> int:
        """The point of the largest likelihood."""
        return int(np.argmax(self.total))

    @property
    def weights(self) -> Array:
        """(points,) posterior probability of each point."""
        return np.asarray(np.exp(self.total - scipy.special.logsumexp(self.total)))

    @property
    def shares(self) -> Array:
        """(conditions,) probability of success, mean over the points by their weights."""
        s, m = np.moveaxis(np.array(self.simulated, float), 2, 0)
        return np.asarray(self.weights @ ((s + 1) / (m + 2)))

    @property
    def unseen(self) -> Array:
        """(conditions,) log probability of each condition's count when the others alone choose the point."""
        total = self.total[:, None]
        left = scipy.special.logsumexp(total, axis=0)
        return np.asarray(left - scipy.special.logsumexp(total - self.log_likelihood, axis=0))


@dataclass(frozen=True, eq=False)
class CountEvidence:
    """The table.

    Attributes:
        comparison: of the model as it is.
        rows: by the names of what is moved; NOTHING among them.
        comparisons: of every row at its best point.
        log_evidence: of every row that moves a count and of UNKNOWN, before tempering.
        probability: of the same, the largest first, one in sum.
    """

    comparison: CountComparison
    rows: Mapping[Kinds, Explanation]
    comparisons: Mapping[Kinds, CountComparison]
    log_evidence: Mapping[Kinds, float]
    probability: Mapping[Kinds, float]


def count_evidence(
    bench: Workbench,
    counted: CountedStudy,
    hypotheses: Sequence[Sequence[VariedParameter]],
    workers: Workers = 1,
) -> CountEvidence:
    """Simulate every hypothesis at every level under all conditions, and weigh them.

    Args:
        bench: plugins, store, progress; every setting is an artifact of the store, so that the scan can be resumed.
        counted: the study and the counts.
        hypotheses: parameters that are moved together; the model as it is takes part always.
        workers: see `executor_for`.
    """
    points: list[Point] = [((), ())]
    for moved in hypotheses:
        points += [(tuple(moved), levels) for levels in itertools.product(*(one.levels for one in moved))]
    conditions = counted.counts.conditions
    settings = []
    for parameters, levels in points:
        for condition in conditions:
            setting = Setting(counted.task_of(condition), counted.study.effects)
            for parameter, level in zip(parameters, levels, strict=True):
                setting = parameter.moved(setting, condition, level)
            settings.append(setting)
    counts = simulate_trials(bench, counted.study, settings, workers)
    by_point = [tuple(counts[i : i + len(conditions)]) for i in range(0, len(counts), len(conditions))]
    return weighed(counted, points, by_point)


def weighed(
    counted: CountedStudy,
    points: Sequence[Point],
    simulated: Sequence[tuple[Count, ...]],
) -> CountEvidence:
    """The table of simulated counts: `points` are (parameters, levels), NOTHING's with no parameters."""
    measured = [(c.successes, c.trials) for c in counted.counts.conditions]
    rows: dict[Kinds, Explanation] = {}
    for parameters in dict.fromkeys(parameters for parameters, _ in points):
        of = [k for k, (moved, _) in enumerate(points) if moved == parameters]
        counts = tuple(simulated[k] for k in of)
        likelihood = [[log_predictive(a, b) for a, b in zip(measured, one, strict=True)] for one in counts]
        row = Explanation(parameters, tuple(points[k][1] for k in of), counts, np.array(likelihood))
        rows[row.kinds] = row
    comparisons = {
        kinds: compare_counts(counted.counts, row.simulated[row.best]) for kinds, row in rows.items()
    }
    still = set(rows[NOTHING].simulated)
    moving = {kinds: row for kinds, row in rows.items() if kinds == NOTHING or set(row.simulated) != still}
    evidence = {kinds: row.log_evidence for kinds, row in moving.items()}
    evidence[UNKNOWN] = sum(log_own(a) for a in measured)
    plain = comparisons[NOTHING]
    return CountEvidence(plain, rows, comparisons, evidence, probabilities(evidence, plain.scatter))


def probabilities(log_evidence: Mapping[Kinds, float], scatter: float = 1.0) -> dict[Kinds, float]:
    """Posterior probabilities: a third each for nothing, unknown and the listed ones before the counts."""
    temperature = TEMPERATURE * scatter
    listed = max(1, sum(kinds not in (NOTHING, UNKNOWN) for kinds in log_evidence))
    price = temperature * float(np.log(listed))  # tempered like the evidence, it is the prior's share
    weighed = {k: v - (0.0 if k in (NOTHING, UNKNOWN) else price) for k, v in log_evidence.items()}
    return verdict_probabilities(weighed, temperature)


BELIEVED = 0.9
FEWEST_TRIALS, FEWEST_CONDITIONS = 12, 3
LEVEL = 0.05
ALIKE = 0.2  # unexplained share below which two explanations move the conditions alike
WORTH = 0.01  # disagreement about a probability, squared and weighted, below which no condition decides


@dataclass(frozen=True)
class NextCount:
    """The measured condition in which the explanations differ most, by words, and the shares that they expect."""

    condition: str
    expected: Mapping[Kinds, float]


@dataclass(frozen=True)
class CountJudgement(Judgement):
    """A verdict with what it rests on, as `Judgement`.

    Attributes:
        not_excited: explanations that change no simulated count beyond chance at any level tried.
        smallest: explanation → the smallest change that these conditions would show.
        alike: pairs of explanations that move the conditions alike, and the share that one leaves of the other.
        next_count: what to count next; None where the explanations agree everywhere.
    """

    not_excited: tuple[Kinds, ...]
    smallest: Mapping[Kinds, float]
    alike: tuple[tuple[Kinds, Kinds, float], ...]
    next_count: NextCount | None


def judge_counts(found: CountEvidence) -> CountJudgement:
    """Weigh the table of evidences."""
    credible = credible_set(found.probability, BELIEVED)
    verdict, reasons = _verdict(found)
    selected = next(iter(found.probability)) if verdict == "missing_effect" else NOTHING
    best = next((kinds for kinds in found.probability if kinds not in (NOTHING, UNKNOWN)), NOTHING)
    smallest = {kinds: _smallest(found, row) for kinds, row in found.rows.items() if len(row.parameters) == 1}
    return CountJudgement(
        verdict=verdict,
        probability=found.probability,
        selected=selected,
        credible=credible,
        reasons=reasons,
        as_it_is=_excess(found.comparison),
        best=_excess(found.comparisons[best]),
        not_excited=tuple(kinds for kinds, level in smallest.items() if not np.isfinite(level)),
        smallest={kinds: level for kinds, level in smallest.items() if np.isfinite(level)},
        alike=_alike(found, credible),
        next_count=_next(found, credible),
    )


def _verdict(found: CountEvidence) -> tuple[Verdict, tuple[str, ...]]:
    plain = found.comparison
    first = next(iter(found.probability))
    if plain.contradictory:
        return "not_repeatable", (
            f"Sets of one condition contradict each other ({_named(plain.contradictory)}): something changed that no "
            "column says.",
        )
    if plain.n_samples < FEWEST_TRIALS or len(plain.conditions) < FEWEST_CONDITIONS:
        return "insufficient_data", (
            f"There are {plain.n_samples} trials under {len(plain.conditions)} conditions; a verdict needs at least "
            f"{FEWEST_TRIALS} under {FEWEST_CONDITIONS}.",
        )
    allowed = ("The differences are what counting allows, and nothing listed does better.",)
    if first == NOTHING and not plain.disagreeing:
        return "nothing_missing", allowed
    if found.probability[first] < BELIEVED:
        return "ambiguous", ()
    if first == UNKNOWN:
        return "unknown_effect", (
            "No listed explanation predicts these counts better than giving each condition a probability of its own.",
        )
    if left := found.comparisons[first].disagreeing:
        what = " + ".join(first) or "the model as it is"
        return "unknown_effect", (
            f"Of what is listed, {what} explains these counts best, and it is wrong beyond chance in {_named(left)}.",
        )
    if first == NOTHING:
        return "nothing_missing", allowed
    if found.rows[first].unseen.sum() <= found.rows[NOTHING].unseen.sum():
        return "ambiguous", (NOT_PREDICTIVE.format(kinds=named(first), what="conditions"),)
    return "missing_effect", ()


def _excess(compared: CountComparison) -> Excess:
    """Over what chance alone would give; whether it is more than chance, exact tests say."""
    return Excess(compared.ratio_to_floor)


def _named(conditions: Sequence[ConditionResult]) -> str:
    return "; ".join(one.condition.words for one in conditions[:4])


def _smallest(found: CountEvidence, row: Explanation) -> float:
    """The level nearest to the present value that would be seen if it were true, as often counted; NaN for none."""
    plain = found.comparison
    seen = []
    for levels, counts in zip(row.grid, row.simulated, strict=True):
        p = [
            fisher_p((round(one.measured[1] * s / m), one.measured[1]), one.simulated)
            for one, (s, m) in zip(plain.conditions, counts, strict=True)
        ]
        if min(holm(p)) < LEVEL:
            seen.append(levels[0])
    parameter = row.parameters[0]
    present = float(np.mean(parameter.levels)) if parameter.neutral is None else parameter.neutral
    return min(seen, key=lambda level: abs(level - present)) if seen else np.nan


def _alike(found: CountEvidence, credible: tuple[Kinds, ...]) -> tuple[tuple[Kinds, Kinds, float], ...]:
    """Pairs among the credible ones; the share is 1 − cos² of what they change in the shares of success."""
    base = found.rows[NOTHING].shares
    moves = {k: found.rows[k].shares - base for k in credible if k not in (NOTHING, UNKNOWN)}
    pairs = []
    for number, (a, x) in enumerate(moves.items()):
        for b, y in list(moves.items())[number + 1 :]:
            size = float((x @ x) * (y @ y))
            share = 1.0 - float(x @ y) ** 2 / size if size > 0 else 0.0
            if share < ALIKE:
                pairs.append((a, b, share))
    return tuple(pairs)


def _next(found: CountEvidence, credible: tuple[Kinds, ...]) -> NextCount | None:
    """Where the credible explanations expect the most different shares, weighted by their probabilities."""
    rivals = [kinds for kinds in credible if kinds != UNKNOWN]
    if len(rivals) < 2:
        return None
    weights = np.array([found.probability[kinds] for kinds in rivals])
    weights = weights / weights.sum()
    shares = np.array([found.rows[kinds].shares for kinds in rivals])
    scatter = weights @ (shares - weights @ shares) ** 2
    worst = int(np.argmax(scatter))
    if scatter[worst] < WORTH:
        return None
    words = found.comparison.conditions[worst].condition.words
    return NextCount(words, dict(zip(rivals, shares[:, worst].tolist(), strict=True)))
