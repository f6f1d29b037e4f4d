"""How the objective changes about the best design, one variable at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from pliant.execution.progress import Progress, bar_of
from pliant.interfaces.optimizer import OK, Trial, Value, Variable
from pliant.records.design import Array
from pliant.records.search import FoundDesign, Slope
from pliant.search.problem.search_problem import SearchProblem

STEP = 0.01  # of the range: what a change is stated for
NEAR = (STEP, 5 * STEP)
OVER_THE_RANGE = 9
MOST_INTEGERS = 11
ROUNDING = 1e-9  # of the range

# Evaluates many candidates, in their order.
Many = Callable[[Sequence[Trial]], Iterable[Trial]]


def slopes(problem: SearchProblem, best: FoundDesign, many: Many, progress: Progress) -> tuple[Slope, ...]:
    """The objective along each variable of the best design, everything else held.

    Objectives are as they are minimised, of several the first. A real variable is tried at nine places over its
    range and at ±1 % and ±5 % of it, an integer at up to eleven values and its neighbours, choices one by one.
    Left out are variables of one value or that act in other conditions only, and `each` variables of which no other
    value fits the rest of the structure.

    Args:
        problem: the `SearchProblem`.
        best: the design; a contextual one is tried in its own context only.
        many: evaluates candidates without scenarios.
        progress: gets one bar.
    """
    acting = [one for one in problem.variables if best.context < 0 or best.context in one.conditions]
    probes = [
        (one, probes_of(one.variable, best.values[one.name])) for one in sorted(acting, key=lambda v: v.each)
    ]
    probes = [(one, tried) for one, tried in probes if tried]
    candidates = [dict(best.values)]
    candidates += [{**best.values, one.name: value} for one, tried in probes for _, value in tried]
    trials = [Trial(number, values, best.context) for number, values in enumerate(candidates)]
    objectives = []
    with bar_of(progress, "about the best design", len(trials)) as bar:
        for trial in many(trials):
            bar.advance()
            allowed = trial.state == OK and not trial.violation > 0.0
            objectives.append(float(trial.objectives[0]) if allowed else float("nan"))
    made, at = [], 1
    for one, tried in probes:
        around, at = objectives[at : at + len(tried)], at + len(tried)
        if (
            np.isfinite(around).any() or not one.each
        ):  # some structure differs from this one in this number only
            shares = [share_of(one.variable, best.values[one.name]), *(share for share, _ in tried)]
            made.append(_slope(one.variable, np.array(shares), np.array([objectives[0], *around])))
    return tuple(made)


def share_of(axis: Variable, value: Value) -> float:
    """Where a value stands in its variable's range, 0 to 1; of choices the index."""
    if axis.type == "categorical":
        return float(axis.choices.index(value))
    return (float(value) - axis.low) / ((axis.high - axis.low) or 1.0)


def probes_of(variable: Variable, at: Value) -> list[tuple[float, Value]]:
    """The values to try besides the present one, ascending, each behind its share of the range; see `share_of`."""
    if variable.type == "categorical":
        return [(float(k), choice) for k, choice in enumerate(variable.choices) if choice != at]
    low, width, here = variable.low, variable.high - variable.low, float(at)
    if width <= 0:
        return []
    if variable.type == "integer":
        first, last, own = int(low), int(variable.high), int(here)
        tried = set(range(first, last + 1))
        if last - first >= MOST_INTEGERS:
            tried = {round(n) for n in np.linspace(first, last, MOST_INTEGERS)} | {own - 1, own + 1}
        return [((n - low) / width, n) for n in sorted(tried) if first <= n <= last and n != own]
    share = (here - low) / width
    grid = [one for one in np.linspace(0.0, 1.0, OVER_THE_RANGE).tolist() if abs(one - share) > STEP]
    near = [share + side * step for step in NEAR for side in (-1, 1)]
    shares = sorted({one for one in (*grid, *near) if 0.0 <= one <= 1.0})
    return [(one, min(low + one * width, variable.high)) for one in shares]


def _slope(variable: Variable, shares: Array, values: Array) -> Slope:
    """What was found along one variable; the best design itself comes first."""
    share, order = float(shares[0]), np.argsort(shares, kind="stable")
    shares, values = shares[order], values[order]
    if variable.type == "categorical":
        return Slope(variable.name, shares, values, float("nan"))
    change = np.abs(sides(shares, values, share)) * STEP
    mean = float(np.mean(change[np.isfinite(change)])) if np.isfinite(change).any() else float("nan")
    room = STEP if variable.type == "real" else ROUNDING  # a bound leaves less room than a step
    bound = "low" if share < room else "high" if share > 1.0 - room else ""
    return Slope(variable.name, shares, values, mean, bound)


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
