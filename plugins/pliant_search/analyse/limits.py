"""Sentences that state what limits the best design; a rule that does not apply adds no sentence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pliant.formatting import quantities, quantity
from pliant_search.analyse.sensitivity import STEP, range_position, sides
from pliant_search.optimizer import POLISHED, Variable
from pliant_search.problem.names import metric_unit, objective_unit
from pliant_search.problem.search_problem import SearchProblem
from pliant_search.records import STATUSES, FoundDesign, SearchHistory, Slope

NOTHING = 1e-5  # of the objective
NEARLY = 0.01  # of its scale: a constraint that a step of this size breaks is active
FREE = "No bound and no constraint limits it: the best design lies inside the searched ranges."
OUTSIDE = "outside_domain"  # metric: number of joints outside the data of their law
HALF = 0.5
LAST = 0.2  # of a search's candidates
LATE = 0.05
STILL = 0.01  # of the objective: a decrease that justifies more candidates
NAMED = 4  # conditions


def limits(
    problem: SearchProblem,
    best: FoundDesign,
    slopes: Sequence[Slope],
    history: SearchHistory,
    causes: Mapping[str, int] | None = None,
) -> tuple[str, ...]:
    """Return sentences that state what limits the best design.

    Args:
        problem: the `SearchProblem`.
        best: the design.
        slopes: of the objective around it; without them no bound is reported as limiting.
        history: every candidate.
        causes: why candidates were refused or failed, and how often.
    """
    held = [
        *at_bounds(problem, best, slopes),
        *at_constraints(problem, best, slopes),
        *at_metrics(problem, best),
    ]
    return (
        *(held or ([FREE] if slopes else [])),
        *outside_data(best),
        *hardest_condition(problem, best),
        *structure_lead(problem, best, history),
        *unfinished(problem, best, history),
        *turned_away(history, causes or {}),
    )


def at_bounds(problem: SearchProblem, best: FoundDesign, slopes: Sequence[Slope]) -> list[str]:
    """Return a sentence for each variable on a bound beyond which the objective would still improve."""
    found = []
    for slope in slopes:
        axis, upper = _axis(problem, slope), slope.at_bound == "high"
        gain = _gain(slope, axis, best, 1 if upper else -1) if slope.at_bound else 0.0
        if gain > 0.0:
            unit = next(record.unit for record in problem.records() if record.name == slope.name)
            bound = quantity(float(axis.high if upper else axis.low), unit, 4)
            found.append(
                f"{slope.name} stands at its {'upper' if upper else 'lower'} bound of {bound}, and the objective "
                f"still improves toward it, by {_amount(problem, best, axis, gain)}: a wider range would help."
            )
    return found


def at_constraints(problem: SearchProblem, best: FoundDesign, slopes: Sequence[Slope]) -> list[str]:
    """Return a sentence for each constraint that a step of 1 % of a variable's range breaks, with its cost."""
    before = {*problem.violated(best.values, best.context), *problem.structural}
    active: dict[str, tuple[float, Variable]] = {}
    for slope in slopes:
        axis = _axis(problem, slope)
        for side in (-1, 1) if axis.type != "categorical" else ():
            here, width = float(best.values[slope.name]), axis.high - axis.low
            stepped = round(here + side) if axis.type == "integer" else here + side * (STEP * width)
            for text in problem.violated({**best.values, slope.name: stepped}, best.context):
                gain = _gain(slope, axis, best, side)
                if text not in before and (text not in active or gain > active[text][0]):
                    active[text] = (gain, axis)
    found = []
    for text, (gain, axis) in active.items():
        if gain > 0.0:
            amount = _amount(problem, best, axis, gain)
            found.append(
                f"The constraint '{text}' limits it: beyond it the objective would improve by {amount}."
            )
        elif np.isfinite(gain):
            found.append(f"The constraint '{text}' is active; the objective does not improve beyond it.")
        else:
            found.append(f"The constraint '{text}' is active; the objective beyond it is not known.")
    return found


def at_metrics(problem: SearchProblem, best: FoundDesign) -> list[str]:
    """Return a sentence for each constraint that a change of 1 % of a metric breaks, in the first such condition."""
    broken: dict[str, float] = {}
    active: dict[str, str] = {}
    for condition, metrics in best.conditions.items():
        before = problem.metric_violations(best.values, metrics)
        broken.update({text: max(amount, broken.get(text, 0.0)) for text, amount in before.items()})
        where = f" in {condition}" if len(best.conditions) > 1 else ""
        for name, value in metrics.items():
            said = f"{quantity(value, metric_unit(name, metrics), 3)}{where}"
            for factor in (1.0 - NEARLY, 1.0 + NEARLY):
                for text in problem.metric_violations(best.values, {**metrics, name: factor * value}):
                    active.setdefault(text, said)
    found = [f"The constraint '{text}' is broken, by {amount:.3g}." for text, amount in broken.items()]
    return found + [
        f"The constraint '{text}' is active: 1 % of {said} more or less would break it."
        for text, said in active.items()
        if text not in broken
    ]


def _axis(problem: SearchProblem, slope: Slope) -> Variable:
    return next(one.variable for one in problem.variables if one.name == slope.name)


def _gain(slope: Slope, axis: Variable, best: FoundDesign, side: int) -> float:
    """Return the decrease of the objective for a step of 1 % of the range to one side; 0 if negligible, NaN if unknown.

    The slope is that of the opposite side, which is inside the range; values beyond the bound are not evaluated.
    """
    share = range_position(axis, best.values[slope.name])
    other = sides(slope.shares, slope.objective, share)[0 if side > 0 else 1]
    gain = float(-side * other * STEP)
    scale = float(np.nanmax(np.abs(slope.objective), initial=0.0))
    return gain if not abs(gain) <= NOTHING * scale else 0.0


def _unit(problem: SearchProblem, best: FoundDesign) -> str:
    return objective_unit(problem.objective_names[0], problem.records(), best.metrics)


def _amount(problem: SearchProblem, best: FoundDesign, axis: Variable, gain: float) -> str:
    """Return the gain of a step as text: ``0.12 mm per 1 % of the range of wall``."""
    unit = _unit(problem, best)
    if axis.type == "integer":
        steps = gain / STEP / max(axis.high - axis.low, 1.0)
        return f"{quantity(steps, unit, 3)} for one more step of {axis.name}"
    return f"{quantity(gain, unit, 3)} per 1 % of the range of {axis.name}"


def outside_data(best: FoundDesign) -> list[str]:
    """Return a sentence on the conditions in which joints leave the data of their laws."""
    left = [name for name, metrics in best.conditions.items() if metrics.get(OUTSIDE, 0.0) > 0]
    if not left and not best.metrics.get(OUTSIDE, 0.0) > 0:
        return []
    more = f" and {len(left) - NAMED} more" if len(left) > NAMED else ""
    several = len(best.conditions) > 1 and left
    where = f"In {', '.join(left[:NAMED])}{more} joints" if several else "Joints"
    return [
        f"{where} leave the data of their laws, where the laws are extrapolated: give them data there, or constrain "
        f"'{OUTSIDE}'."
    ]


def hardest_condition(problem: SearchProblem, best: FoundDesign) -> list[str]:
    """Return the worst condition, and how far it is from the best."""
    if len(best.conditions) < 2:
        return []
    each = {name: problem.objective_values(best.values, one)[0] for name, one in best.conditions.items()}
    found = {name: value for name, value in each.items() if np.isfinite(value)}
    if len(found) < 2 or np.ptp(list(found.values())) == 0.0:
        return []
    worst, easiest = max(found, key=found.__getitem__), min(found, key=found.__getitem__)
    sign, unit = -1.0 if problem.maximised[0] else 1.0, _unit(problem, best)
    high, low = (quantity(sign * found[name], unit, 3) for name in (worst, easiest))
    return [
        f"The hardest condition is {worst} ({problem.objective_names[0]} {high}), the easiest {easiest} ({low})."
    ]


def structure_lead(problem: SearchProblem, best: FoundDesign, history: SearchHistory) -> list[str]:
    """Return a sentence on the lead of the best structure over the next one."""
    listed = problem.branches()
    if len(listed) < 2:
        return []
    found, own = {}, (history.context == best.context) & np.isfinite(history.objectives[:, 0])
    for k in range(len(listed)):
        found[k] = float(np.min(history.objectives[own & (history.branch == k), 0], initial=np.inf))
    score = best.objectives[problem.objective_names[0]] * (-1.0 if problem.maximised[0] else 1.0)
    found[best.branch] = score  # recommendations are not in the history
    order = sorted((k for k in found if np.isfinite(found[k])), key=found.__getitem__)
    without = len(listed) - len(order)
    empty = f" {without} of {len(listed)} structures gave no design at all." if without else ""
    if len(order) < 2:
        return [empty.strip()] if empty else []
    units = {record.name: record.unit for record in problem.records()}
    first, second = (quantities(listed[k], units) for k in order[:2])
    margin = quantity(found[order[1]] - found[order[0]], _unit(problem, best), 3)
    return [f"The best structure ({first}) leads the next one ({second}) by {margin}.{empty}"]


def unfinished(problem: SearchProblem, best: FoundDesign, history: SearchHistory) -> list[str]:
    """Return a sentence if the search of the best design was still improving when it ended."""
    if problem.reached(best.values, best.metrics):
        return ["The search ended at its goal ('until'), not where nothing better is found."]
    if best.number == POLISHED:
        return []
    rows = (history.branch == best.branch) & (history.context == best.context)
    objective = history.objectives[rows, 0]
    if len(objective) < 2 or not np.isfinite(objective).any():
        return []
    so_far = np.fmin.accumulate(objective)
    at, count = int(np.nanargmin(objective)) + 1, len(objective)
    before = so_far[max(int((1.0 - LAST) * count), 1) - 1]
    fell = float(before - so_far[-1])
    if not (np.isnan(before) or fell > STILL * abs(so_far[-1])):
        return []
    much = "was first found in"
    if np.isfinite(fell):
        much = f"improved by {quantity(fell, _unit(problem, best), 3)} in"
    found = f"; the best is candidate {at} of {count}" if at > (1.0 - LATE) * count else ""
    return [f"The objective {much} the last fifth of the candidates{found}: more of them would help."]


def turned_away(history: SearchHistory, causes: Mapping[str, int]) -> list[str]:
    """Return a sentence if most candidates were refused or failed, with the most frequent cause."""
    status = np.asarray(history.status)
    if not len(status):
        return []
    refused = float(np.mean(status == STATUSES.index("refused")))
    failed = float(np.mean((status != STATUSES.index("ok")) & (status != STATUSES.index("refused"))))
    if refused + failed <= HALF:
        return []
    most = max(causes, key=causes.__getitem__, default="")
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
