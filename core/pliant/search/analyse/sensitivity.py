"""How the objective changes about the best design, one variable at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.execution.progress import Progress, Silent
from pliant.interfaces.optimizer import Trial, Value, Variable
from pliant.records.design import Array
from pliant.records.search import FoundDesign, Slope
from pliant.search.evaluate.evaluator import Evaluates
from pliant.search.problem.search_problem import SearchProblem

STEP = 0.01  # of the range: what a change is stated for
NEAR = (STEP, 5 * STEP)
OVER_THE_RANGE = 9
MOST_INTEGERS = 11
ROUNDING = 1e-9  # of the range


# Evaluates many candidates in one context, in their order; an executor's map, for example.
Many = Callable[[Sequence[Mapping[str, Value]], int], Iterable[Trial]]


@dataclass(frozen=True)
class Probe:
    """One value of one variable.

    Attributes:
        share: of the variable's range, 0 to 1; of choices the index.
        value: as the study gets it.
    """

    share: float
    value: Value


def slopes(
    evaluator: Evaluates, problem: SearchProblem, best: FoundDesign, many: Many | None = None
) -> tuple[Slope, ...]:
    """The objective along each variable of the best design, everything else held.

    Objectives are as they are minimised, of several the first. A real variable is tried at nine places over its
    range and at ±1 % and ±5 % of it, an integer at up to eleven values and its neighbours, choices one by one.
    Left out are variables of one value, and `each` variables of which no other value fits the rest of the structure.

    Args:
        evaluator: the nominal one.
        problem: the `SearchProblem`.
        best: the design; a contextual one is tried in its own context only.
        many: how candidates are evaluated; one after another by default.
    """
    varied = varied_at(problem, best)
    probes = [probes_of(variable, best.values[variable.name]) for variable in varied]
    candidates = [dict(best.values)]
    for variable, tried in zip(varied, probes, strict=True):
        candidates += [{**best.values, variable.name: probe.value} for probe in tried]
    found = list(_evaluated(evaluator, candidates, best.context, many))
    at_best, rest, made = found[0], found[1:], []
    each = {one.name for one in problem.variables if one.each}
    for variable, tried in zip(varied, probes, strict=True):
        around, rest = rest[: len(tried)], rest[len(tried) :]
        if variable.name in each and not np.isfinite(around).any():
            continue  # no structure differs from this one in this number only
        made.append(_slope(variable, best.values[variable.name], at_best, tried, around))
    return tuple(made)


def varied_at(problem: SearchProblem, best: FoundDesign) -> tuple[Variable, ...]:
    """The variables that act on a design: not those of other conditions than its own."""
    acting = [one for one in problem.variables if best.context < 0 or best.context in one.conditions]
    ordered = sorted(acting, key=lambda one: one.each)
    return tuple(one.variable for one in ordered if _can_vary(one.variable))


def _can_vary(variable: Variable) -> bool:
    if variable.type == "categorical":
        return len(variable.choices) > 1
    return variable.high > variable.low


def probes_of(variable: Variable, at: Value) -> tuple[Probe, ...]:
    """The values to try besides the present one, ascending."""
    if variable.type == "categorical":
        return tuple(Probe(float(k), c) for k, c in enumerate(variable.choices) if c != at)
    low, width, here = variable.low, variable.high - variable.low, float(at)
    if width <= 0:
        return ()
    if variable.type == "integer":
        return tuple(Probe((n - low) / width, n) for n in _integers(int(low), int(variable.high), int(here)))
    share = (here - low) / width
    grid = [one for one in np.linspace(0.0, 1.0, OVER_THE_RANGE).tolist() if abs(one - share) > STEP]
    near = [share + side * step for step in NEAR for side in (-1, 1)]
    tried = sorted({one for one in (*grid, *near) if 0.0 <= one <= 1.0})
    return tuple(Probe(one, min(low + one * width, variable.high)) for one in tried)


def _integers(low: int, high: int, here: int) -> list[int]:
    if high - low < MOST_INTEGERS:
        tried = set(range(low, high + 1))
    else:
        tried = {round(n) for n in np.linspace(low, high, MOST_INTEGERS)} | {here - 1, here + 1}
    return sorted(n for n in tried if low <= n <= high and n != here)


def _evaluated(
    evaluator: Evaluates, candidates: Sequence[Mapping[str, Value]], context: int, many: Many | None
) -> Iterable[float]:
    """The objective of each candidate, NaN where it is refused, fails or breaks a constraint."""
    progress: Progress = getattr(getattr(evaluator, "bench", None), "progress", None) or Silent()
    bar = progress.begin("about the best design", len(candidates))
    try:
        one_by_one = (evaluator.evaluate(values, context) for values in candidates)
        for evaluation in many(candidates, context) if many else one_by_one:
            bar.advance()
            allowed = evaluation.state == "ok" and not evaluation.violation > 0.0
            yield float(evaluation.objectives[0]) if allowed else float("nan")
    finally:
        bar.finish()


def _slope(
    variable: Variable, at: Value, best: float, tried: Sequence[Probe], objectives: Sequence[float]
) -> Slope:
    """What was found along one variable, the best design itself included."""
    if variable.type == "categorical":
        share = float(variable.choices.index(at))
    else:
        width = variable.high - variable.low
        share = (float(at) - variable.low) / width if width > 0 else 0.0
    shares = np.array([share, *(probe.share for probe in tried)])
    values = np.array([best, *objectives])
    order = np.argsort(shares, kind="stable")
    shares, values = shares[order], values[order]
    if variable.type == "categorical":
        return Slope(variable.name, shares, values, float("nan"))
    change = np.abs(sides(shares, values, share)) * STEP
    mean = float(np.mean(change[np.isfinite(change)])) if np.isfinite(change).any() else float("nan")
    room = STEP if variable.type == "real" else ROUNDING
    return Slope(variable.name, shares, values, mean, _bound(share, room))


def sides(shares: Array, objective: Array, share: float) -> Array:
    """(2,) d objective / d share below and above a design, by its nearest neighbours that were evaluated; else NaN."""
    here = int(np.argmin(np.abs(shares - share)))
    found = np.full(2, np.nan)
    for side, rows in ((0, range(here - 1, -1, -1)), (1, range(here + 1, len(shares)))):
        for k in rows:
            # a real variable's nearest 5 %, an integer's next value: further away it is no slope
            near = abs(shares[k] - shares[here]) <= NEAR[-1] + ROUNDING or abs(k - here) == 1
            if near and np.isfinite(objective[k]):
                found[side] = (objective[k] - objective[here]) / (shares[k] - shares[here])
                break
    return found


def _bound(share: float, room: float) -> str:
    """The bound that leaves less room than a step."""
    if share < room:
        return "low"
    return "high" if share > 1.0 - room else ""
