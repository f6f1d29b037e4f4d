"""What the history and the conditions of a search say about its best design, in sentences."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pliant.formatting import quantities, quantity
from pliant.records.design import Array
from pliant.records.search import STATUSES, FoundDesign, SearchHistory
from pliant.search.metrics import unit_of_objective
from pliant.search.problem import SearchProblem

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


def conditions(problem: SearchProblem, best: FoundDesign) -> list[str]:
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


def branches(problem: SearchProblem, best: FoundDesign, history: SearchHistory) -> list[str]:
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


def budget(problem: SearchProblem, best: FoundDesign, history: SearchHistory) -> list[str]:
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
