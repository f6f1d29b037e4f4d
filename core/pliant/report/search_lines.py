"""What a search found, in lines for people."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pliant.formatting import quantity
from pliant.records.search import FoundDesign, SearchResult, Slope, VariableRecord
from pliant.search.problem.names import acts, unit_of_metric, unit_of_objective
from pliant.units import strip_unit_suffix

STEEPEST = 3
MOST_DESIGNS = 6
MOST_CAUSES = 4
# Metrics that say nothing where they have this value.
AS_IT_SHOULD = {"converged": 1.0, "outside_domain": 0.0, "unsettled_levels": 0.0}
MOST_METRICS = 4


def lines(result: SearchResult, engine: str) -> list[str]:
    """Everything worth a line; `engine` is the study's own."""
    found = []
    for design in result.best[:MOST_DESIGNS]:
        found += _design(result, design)
    if len(result.best) > MOST_DESIGNS:
        found.append(f"         and {len(result.best) - MOST_DESIGNS} more")
    found.append(f"search   {_effort(result)}")
    found += [*_causes("refused", result.refused), *_causes("failed", result.failed)]
    found += [f"slope    {_slope(result, slope)}" for slope in steepest(result.slopes)]
    found += [f"limit    {sentence}" for sentence in result.limits]
    return found + _robust(result) + _checked(result, engine)


def _causes(word: str, causes: Mapping[str, int]) -> list[str]:
    """The most frequent causes, and how many more there are."""
    listed = list(causes.items())
    found = [f"{word:<8} {count} × {cause}" for cause, count in listed[:MOST_CAUSES]]
    left = listed[MOST_CAUSES:]
    if left:
        found.append(f"         {sum(count for _, count in left)} × {len(left)} other causes")
    return found


def best_said(result: SearchResult, design: FoundDesign) -> str:
    """Objectives in words: rmse 1.2 mm."""
    return ", ".join(
        f"{name} {quantity(value, unit_of_objective(name, result.variables, design.metrics), 4)}"
        for name, value in design.objectives.items()
    )


def steepest(slopes: tuple[Slope, ...]) -> list[Slope]:
    """The variables that matter most."""
    known = [slope for slope in slopes if math.isfinite(slope.change)]
    return sorted(known, key=lambda slope: -abs(slope.change))[:STEEPEST]


def _design(result: SearchResult, design: FoundDesign) -> list[str]:
    known = {variable.name: variable for variable in result.variables}
    where = f" for {result.conditions[design.context]}" if design.context >= 0 and result.conditions else ""
    recommended = ", as the optimizer recommends" if design.number < 0 else ""
    found = [f"best     {best_said(result, design)}{where}{recommended}"]
    if design.first:
        before = replace(design, objectives=design.first)
        found.append(f"         {best_said(result, before)} in the search, before it was tried again")
    found += [
        f"         {name:<32} {_value(known.get(name), value)}"
        for name, value in design.values.items()
        if name not in known or acts(known[name], design)
    ]
    stated = {name.rpartition(".")[2] for name in design.objectives}
    numbers = [
        f"{strip_unit_suffix(name)} {quantity(value, unit_of_metric(name, design.metrics), 3)}"
        for name, value in design.metrics.items()
        if math.isfinite(value)
        and not {name, strip_unit_suffix(name)} & stated
        and AS_IT_SHOULD.get(name) != value
    ]
    return [*found, f"         {', '.join(numbers[:MOST_METRICS])}"] if numbers else found


def _value(variable: VariableRecord | None, value: Any) -> str:
    unit = variable.unit if variable is not None else ""
    if isinstance(value, int) and not unit:
        return str(value)
    return quantity(value, unit, 4)


def _effort(result: SearchResult) -> str:
    rate = result.evaluations / result.wall_s if result.wall_s > 0 else 0.0
    speed = f"{rate:.1f}/s" if rate >= 1 else f"{1 / rate:.1f} s each" if rate else ""
    of_many = f" in {len(result.branches)} searches" if len(result.branches) > 1 else ""
    ends = {
        "budget": "the budget is used up",
        "until": "'until' is reached",
        "exhausted": "ended early: nothing more to try",
    }
    return (
        f"{result.optimizer}, {result.evaluations} evaluations{of_many} with {result.simulations} simulations in "
        f"{_time(result.wall_s)} ({speed}); {ends.get(result.stopped, result.stopped)}"
    )


def _time(wall_s: float) -> str:
    return f"{wall_s:.1f} s" if wall_s < 120 else f"{wall_s / 60:.1f} min"


def _slope(result: SearchResult, slope: Slope) -> str:
    unit = unit_of_objective(result.objectives[0], result.variables, result.best[0].metrics)
    bound = f", at its {slope.at_bound} bound" if slope.at_bound else ""
    return f"{slope.name}: {quantity(slope.change, unit, 2)} for 1 % of its range{bound}"


def _robust(result: SearchResult) -> list[str]:
    found = result.robustness
    if found is None:
        return []
    unit = unit_of_objective(result.objectives[0], result.variables, result.best[0].metrics)
    measure = f"{found.measure} {found.level:g}" if found.measure == "cvar" else found.measure
    together = (
        f"robust   {measure} over {found.samples} scenarios {quantity(found.robust_of_robust, unit, 3)}"
    )
    alone = f"undisturbed {quantity(found.nominal_of_robust, unit, 3)}"
    if result.nominal_is_robust:
        return [f"{together}; {alone}: the best nominal design, nothing more robust was found"]
    return [
        f"{together} (nominal design {quantity(found.robust_of_nominal, unit, 3)}); {alone} (nominal design "
        f"{quantity(found.nominal_of_nominal, unit, 3)})"
    ]


def _checked(result: SearchResult, engine: str) -> list[str]:
    check = result.verification
    if check is None:
        return []
    found = []
    for name in dict.fromkeys((engine, *check.verified, *check.predicted)):
        verified, predicted = check.verified.get(name, {}), check.predicted.get(name, {})
        if not (verified or predicted):
            continue
        found.append(f"checked  {name}: {_beside(result, verified, predicted)}")
    found += [
        f"law      {law.get('name') or 'of the design'}: misses FEM by {100 * law['rmse_of_range']:.2g} % of the range "
        f"(rms), {100 * law['worst_of_range']:.2g} % at worst, {law['n_states']} states"
        for law in check.laws
        if "rmse_of_range" in law
    ]
    return found


def _beside(result: SearchResult, verified: Mapping[str, float], predicted: Mapping[str, float]) -> str:
    """Metrics of the objectives first: verified against predicted."""
    names = {**predicted, **verified}
    wanted = [
        name
        for name in names
        if any(_stem(name, unit_of_metric(name, names)) in text for text in result.objectives)
    ]
    parts = []
    others = [name for name in names if AS_IT_SHOULD.get(name) != verified.get(name, predicted.get(name))]
    for name in (wanted or others)[:MOST_METRICS]:
        unit = unit_of_metric(name, names)
        told = [quantity(verified[name], unit, 3) + " verified"] if name in verified else []
        told += [quantity(predicted[name], unit, 3) + " predicted"] if name in predicted else []
        parts.append(f"{_stem(name, unit)} {', '.join(told)}")
    return "; ".join(parts)


def _stem(name: str, unit: str) -> str:
    return strip_unit_suffix(name) if unit else name
