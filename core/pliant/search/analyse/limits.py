"""What keeps the best design from being better, in sentences; each rule says nothing where it does not apply."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pliant.formatting import quantities, quantity
from pliant.records.design import Array
from pliant.records.search import STATUSES, FoundDesign, SearchHistory, Slope, VariableRecord
from pliant.search.analyse.sensitivity import STEP, sides
from pliant.search.problem.names import unit_of_metric, unit_of_objective
from pliant.search.problem.search_problem import SearchProblem

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
        *outside_data(best),
        *hardest_condition(problem, best),
        *lead_of_structure(problem, best, history),
        *unfinished(problem, best, history),
        *turned_away(history, causes or {}),
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


OUTSIDE = "outside_domain"  # metric: how many joints left the data of their law
HALF = 0.5
LAST = 0.2  # of a search's candidates
LATE = 0.05
STILL = 0.01  # of the objective: a fall that is worth more candidates


def outside_data(best: FoundDesign) -> list[str]:
    """Conditions in which joints leave the data of their laws."""
    left = [name for name, metrics in best.conditions.items() if metrics.get(OUTSIDE, 0.0) > 0]
    if not left and not best.metrics.get(OUTSIDE, 0.0) > 0:
        return []
    where = f"In {_listed(left)} joints" if len(best.conditions) > 1 and left else "Joints"
    return [
        f"{where} leave the data of their laws, where the laws are extrapolated: give them data there, or constrain "
        f"'{OUTSIDE}'."
    ]


def hardest_condition(problem: SearchProblem, best: FoundDesign) -> list[str]:
    """The worst condition, and how far it is from the best."""
    if len(best.conditions) < 2:
        return []
    unit = unit_of_objective(problem.objective_names[0], problem.records(), best.metrics)
    sign = -1.0 if problem.maximised[0] else 1.0
    found = {
        name: problem.objective_values(best.values, metrics)[0] for name, metrics in best.conditions.items()
    }
    found = {name: value for name, value in found.items() if np.isfinite(value)}
    if len(found) < 2 or np.ptp(list(found.values())) == 0.0:
        return []
    worst, easiest = max(found, key=lambda name: found[name]), min(found, key=lambda name: found[name])
    return [
        f"The hardest condition is {worst} ({problem.objective_names[0]} "
        f"{quantity(sign * found[worst], unit, 3)}), the easiest {easiest} "
        f"({quantity(sign * found[easiest], unit, 3)})."
    ]


def lead_of_structure(problem: SearchProblem, best: FoundDesign, history: SearchHistory) -> list[str]:
    """By how much the best structure leads."""
    listed = problem.branches()
    if len(listed) < 2:
        return []
    own = history.context == best.context
    found = {k: _lowest(history.objectives[own & (history.branch == k), 0]) for k in range(len(listed))}
    score = best.objectives[problem.objective_names[0]] * (-1.0 if problem.maximised[0] else 1.0)
    found[best.branch] = score  # a recommendation is no row of the history
    order = sorted((k for k in found if np.isfinite(found[k])), key=lambda k: found[k])
    without = len(listed) - len(order)
    empty = f" {without} of {len(listed)} structures gave no design at all." if without else ""
    if len(order) < 2:
        return [empty.strip()] if empty else []
    units = {record.name: record.unit for record in problem.records()}
    first, second = (quantities(listed[k], units) for k in order[:2])
    unit = unit_of_objective(problem.objective_names[0], problem.records(), best.metrics)
    margin = quantity(found[order[1]] - found[order[0]], unit, 3)
    return [f"The best structure ({first}) leads the next one ({second}) by {margin}.{empty}"]


def unfinished(problem: SearchProblem, best: FoundDesign, history: SearchHistory) -> list[str]:
    """Whether the best design's search was still getting better when it ended."""
    if problem.reached(best.values, best.metrics):
        return ["The search ended at its goal ('until'), not where nothing better is found."]
    rows = (history.branch == best.branch) & (history.context == best.context)
    objective = history.objectives[rows, 0]
    if len(objective) < 2 or not np.isfinite(objective).any():
        return []
    so_far = np.fmin.accumulate(objective)
    at, count = int(np.nanargmin(objective)) + 1, len(objective)
    before = so_far[max(int((1.0 - LAST) * count), 1) - 1]
    fell = float(before - so_far[-1])
    late = at > (1.0 - LATE) * count
    if not (np.isnan(before) or fell > STILL * abs(so_far[-1])):
        return []
    unit = unit_of_objective(problem.objective_names[0], problem.records(), best.metrics)
    much = f"improved by {quantity(fell, unit, 3)} in" if np.isfinite(fell) else "was first found in"
    found = f"; the best is candidate {at} of {count}" if late else ""
    return [f"The objective {much} the last fifth of the candidates{found}: more of them would help."]


def turned_away(history: SearchHistory, causes: Mapping[str, int]) -> list[str]:
    """Whether most candidates were refused or failed, and why."""
    status = np.asarray(history.status)
    if not len(status):
        return []
    refused = float(np.mean(status == STATUSES.index("refused")))
    failed = float(np.mean((status != STATUSES.index("ok")) & (status != STATUSES.index("refused"))))
    if refused + failed <= HALF:
        return []
    most = max(causes, key=lambda cause: causes[cause]) if causes else ""
    why = f", most often because of: {most} ({causes[most]} times)" if most else ""
    lost = (
        "A narrower range or a constraint on the variables would leave more of the budget for designs."
        if failed > 0.0
        else "Refused candidates cost no budget, but the optimizer learns little from them: a narrower range helps it."
    )
    return [
        f"{100 * (refused + failed):.0f} % of the candidates gave nothing ({100 * refused:.0f} % refused, "
        f"{100 * failed:.0f} % failed){why}. {lost}"
    ]


def _lowest(values: Array) -> float:
    return float(np.nanmin(values)) if np.isfinite(values).any() else float("nan")


def _listed(names: list[str], most: int = 4) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{', '.join(names[:most])}{more}"
