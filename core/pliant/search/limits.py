"""What keeps the best design from being better, in sentences; each rule says nothing where it does not apply."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pliant.formatting import quantity
from pliant.records.search import FoundDesign, SearchHistory, Slope, VariableRecord
from pliant.search import limits_of_the_run as run
from pliant.search.metrics import unit_of_metric, unit_of_objective
from pliant.search.problem import SearchProblem
from pliant.search.sensitivity import STEP, sides

NOTHING = 1e-5  # of the objective
NEARLY = 0.01  # of its scale: a constraint that so small a step breaks is active
FREE = "No bound and no constraint holds it: the best design lies inside everything that was searched."


def limits(
    problem: SearchProblem,
    best: FoundDesign,
    slopes: Sequence[Slope],
    history: SearchHistory,
    causes: Mapping[str, int] | None = None,
) -> tuple[str, ...]:
    """What limits the best design.

    Args:
        problem: the `SearchProblem`.
        best: the design.
        slopes: the objective about it; without them no bound is said to hold it.
        history: every candidate.
        causes: why candidates were refused or failed, and how often.
    """
    held = [
        *at_bounds(problem, best, slopes),
        *at_constraints(problem, best, slopes),
        *at_metrics(problem, best),
    ]
    if slopes and not held:
        held = [FREE]
    return (
        *held,
        *run.outside_data(best),
        *run.conditions(problem, best),
        *run.branches(problem, best, history),
        *run.budget(problem, best, history),
        *run.turned_away(history, causes or {}),
    )


def at_bounds(problem: SearchProblem, best: FoundDesign, slopes: Sequence[Slope]) -> list[str]:
    """Variables on a bound beyond which the objective would still get better."""
    found = []
    for slope in slopes:
        variable = _variable(problem, slope.name)
        side_to = -1 if slope.at_bound == "low" else 1
        gain = _gain(slope, _share(variable, best), side_to) if slope.at_bound else 0.0
        if not gain > 0.0:
            continue
        bound = variable.low if slope.at_bound == "low" else variable.high
        side = "lower" if slope.at_bound == "low" else "upper"
        found.append(
            f"{slope.name} stands at its {side} bound of {quantity(bound, variable.unit, 4)}, and the objective still "
            f"improves toward it, by {_amount(problem, best, variable, gain)}: a wider range would help."
        )
    return found


def at_constraints(problem: SearchProblem, best: FoundDesign, slopes: Sequence[Slope]) -> list[str]:
    """Constraints that a step of 1 % of a variable's range breaks, and what they cost."""
    before = {*problem.violated(best.values, best.context), *problem.structural}
    active: dict[str, tuple[float, VariableRecord]] = {}
    for slope in slopes:
        variable = _variable(problem, slope.name)
        if variable.type == "categorical":
            continue
        for side in (-1, 1):
            moved = float(best.values[slope.name]) + side * _step(variable)
            stepped = round(moved) if variable.type == "integer" else moved
            for text in problem.violated({**best.values, slope.name: stepped}, best.context):
                gain = _gain(slope, _share(variable, best), side)
                if text not in before and (text not in active or gain > active[text][0]):
                    active[text] = (gain, variable)
    return [_constraint(problem, best, text, gain, variable) for text, (gain, variable) in active.items()]


def _constraint(
    problem: SearchProblem, best: FoundDesign, text: str, gain: float, variable: VariableRecord
) -> str:
    if gain > 0.0:
        amount = _amount(problem, best, variable, gain)
        return f"The constraint '{text}' holds it: across it the objective would improve by {amount}."
    if np.isfinite(gain):
        return f"The constraint '{text}' is touched, and nothing is to be had across it."
    return f"The constraint '{text}' is active; what lies across it cannot be told."


def at_metrics(problem: SearchProblem, best: FoundDesign) -> list[str]:
    """Constraints on metrics that a change of 1 % of a metric would break, in the first condition that it would."""
    broken: dict[str, float] = {}
    active: dict[str, str] = {}
    for condition, metrics in best.conditions.items():
        before = problem.metric_violations(best.values, metrics)
        broken.update({text: max(amount, broken.get(text, 0.0)) for text, amount in before.items()})
        where = f" in {condition}" if len(best.conditions) > 1 else ""
        for name, value in metrics.items():
            said = f"{quantity(value, unit_of_metric(name, metrics), 3)}{where}"
            for factor in (1.0 - NEARLY, 1.0 + NEARLY):
                for text in problem.metric_violations(best.values, {**metrics, name: factor * value}):
                    active.setdefault(text, said)
    return [
        *(f"The constraint '{text}' is broken, by {amount:.3g}." for text, amount in broken.items()),
        *(
            f"The constraint '{text}' is active: 1 % of {said} more or less would break it."
            for text, said in active.items()
            if text not in broken
        ),
    ]


def _gain(slope: Slope, share: float, side: int) -> float:
    """By how much the objective falls with 1 % of the range to a side, 0 where it is nothing; NaN if unknown.

    Taken from the other side, where the design can go: what lies across is not evaluated.
    """
    other = sides(slope.shares, slope.objective, share)[0 if side > 0 else 1]
    gain = float(-side * other * STEP)
    scale = float(np.nanmax(np.abs(slope.objective), initial=0.0))
    return gain if not abs(gain) <= NOTHING * scale else 0.0


def _share(variable: VariableRecord, best: FoundDesign) -> float:
    """Where the best design stands in the range."""
    return (float(best.values[variable.name]) - variable.low) / ((variable.high - variable.low) or 1.0)


def _variable(problem: SearchProblem, name: str) -> VariableRecord:
    """The variable's record."""
    return next(record for record in problem.records() if record.name == name)


def _step(variable: VariableRecord) -> float:
    return 1.0 if variable.type == "integer" else STEP * (variable.high - variable.low)


def _amount(problem: SearchProblem, best: FoundDesign, variable: VariableRecord, gain: float) -> str:
    """What a step is worth: ``0.12 mm per 1 % of its range``."""
    unit = unit_of_objective(problem.objective_names[0], problem.records(), best.metrics)
    if variable.type == "integer":
        steps = gain / STEP / max(variable.high - variable.low, 1.0)
        return f"{quantity(steps, unit, 3)} for one more step of {variable.name}"
    return f"{quantity(gain, unit, 3)} per 1 % of the range of {variable.name}"
