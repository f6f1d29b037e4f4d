"""Sensitivity of the objective around the best design, one variable at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from pliant.execution.progress import Progress, open_progress_bar
from pliant.records.design import Array
from pliant_search.optimizer import OK, Trial, Value, Variable
from pliant_search.problem.search_problem import SearchProblem
from pliant_search.records import FoundDesign, Slope

STEP = 0.01  # of the range: the step that a change is stated for
NEAR = (STEP, 5 * STEP)
OVER_THE_RANGE = 9
MOST_INTEGERS = 11
ROUNDING = 1e-9  # of the range

# Evaluates many candidates, in their order.
Many = Callable[[Sequence[Trial]], Iterable[Trial]]


def slopes(problem: SearchProblem, best: FoundDesign, many: Many, progress: Progress) -> tuple[Slope, ...]:
    """Return the objective along each variable of the best design, with all other variables fixed.

    Objectives are as minimised; of several the first is used. A real variable is evaluated at nine places over its
    range and at ±1 % and ±5 % of it, an integer at up to eleven values and its neighbours, choices one by one.
    Variables that have a single value or act in other conditions only are omitted, and so are `each` variables of
    which no other value fits the rest of the structure.

    Args:
        problem: the `SearchProblem`.
        best: the design; a contextual design is evaluated in its own context only.
        many: evaluates candidates without scenarios.
        progress: gets one bar.
    """
    acting = [one for one in problem.variables if best.context < 0 or best.context in one.conditions]
    probes = [
        (one, probe_values(one.variable, best.values[one.name]))
        for one in sorted(acting, key=lambda v: v.each)
    ]
    probes = [(one, tried) for one, tried in probes if tried]
    candidates = [dict(best.values)]
    candidates += [{**best.values, one.name: value} for one, tried in probes for _, value in tried]
    trials = [Trial(number, values, best.context) for number, values in enumerate(candidates)]
    objectives = []
    with open_progress_bar(progress, "about the best design", len(trials)) as bar:
        for trial in many(trials):
            bar.advance()
            allowed = trial.state == OK and not trial.violation > 0.0
            objectives.append(float(trial.objectives[0]) if allowed else float("nan"))
    made, at = [], 1
    for one, tried in probes:
        around, at = objectives[at : at + len(tried)], at + len(tried)
        if (
            np.isfinite(around).any() or not one.each
        ):  # some structure differs from this one only in this variable
            shares = [range_position(one.variable, best.values[one.name]), *(share for share, _ in tried)]
            made.append(_slope(one.variable, np.array(shares), np.array([objectives[0], *around])))
    return tuple(made)


def range_position(axis: Variable, value: Value) -> float:
    """Return the position of a value in its variable's range, 0 to 1; for a choice its index."""
    if axis.type == "categorical":
        return float(axis.choices.index(value))
    return (float(value) - axis.low) / ((axis.high - axis.low) or 1.0)


def probe_values(variable: Variable, at: Value) -> list[tuple[float, Value]]:
    """Return pairs (share of the range, value) to evaluate besides the present one, ascending; see `range_position`."""
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
    """Return the `Slope` of one variable from its evaluations, of which the first is the best design itself."""
    share, order = float(shares[0]), np.argsort(shares, kind="stable")
    shares, values = shares[order], values[order]
    if variable.type == "categorical":
        return Slope(variable.name, shares, values, float("nan"))
    change = np.abs(sides(shares, values, share)) * STEP
    mean = float(np.mean(change[np.isfinite(change)])) if np.isfinite(change).any() else float("nan")
    room = STEP if variable.type == "real" else ROUNDING  # closer to a bound than one step
    bound = "low" if share < room else "high" if share > 1.0 - room else ""
    return Slope(variable.name, shares, values, mean, bound)


def sides(shares: Array, objective: Array, share: float) -> Array:
    """Return (2,) d objective / d share below and above a design, from its nearest evaluated neighbours; else NaN."""
    here = int(np.argmin(np.abs(shares - share)))
    found = np.full(2, np.nan)
    for side, rows in ((0, range(here - 1, -1, -1)), (1, range(here + 1, len(shares)))):
        for k in rows:
            # a real variable's nearest 5 %, an integer's next value: a larger distance gives no local slope
            near = abs(shares[k] - shares[here]) <= NEAR[-1] + ROUNDING or abs(k - here) == 1
            if near and np.isfinite(objective[k]):
                found[side] = (objective[k] - objective[here]) / (shares[k] - shares[here])
                break
    return found
