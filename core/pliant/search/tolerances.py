"""Tolerances of a robust search beside the range of its meta-model, before the search begins."""

from __future__ import annotations

from collections.abc import Iterator

from pliant.errors import UserError
from pliant.pipeline.meta_model.designs import solved_designs
from pliant.pipeline.meta_model.parameters import ROUNDING, shown
from pliant.pipeline.workbench import Workbench
from pliant.search.keys import KeyPath, written_path
from pliant.search.problem import SearchProblem
from pliant.search.scenarios import Deviation, Scenario
from pliant.search.study_values import number_at, overridden

Range = tuple[float, float]


def tolerance_notes(bench: Workbench, problem: SearchProblem, scenarios: tuple[Scenario, ...]) -> list[str]:
    """Which tolerances take candidates out of the meta-model's range, where they fail, and what to do about it.

    Args:
        bench: plugins and store; designs of a sweep that are not solved yet are solved now.
        problem: of the robust search.
        scenarios: of it; all have the same keys.

    Raises:
        UserError: no candidate stays inside.
    """
    block = problem.study.meta_model
    deviations = [one for one, _ in scenarios[0].deviations if one.parameter]
    if block is None or block.extrapolate or not deviations:
        return []
    designs = solved_designs(bench, problem.study).designs
    boxes = dict(zip(designs.names, designs.box.tolist(), strict=True))
    return [
        note
        for deviation in deviations
        if deviation.parameter in boxes
        for path in _paths(problem, deviation)
        if (note := _note(problem, deviation, path, boxes[deviation.parameter]))
    ]


def _note(problem: SearchProblem, deviation: Deviation, path: KeyPath, box: Range) -> str:
    """A sentence where the key at a path leaves the box; empty where it stays inside."""
    held = list(_held(problem, path))
    names = [name for name, _ in held if name]
    low, high = (choose(value for _, ends in held for value in ends) for choose in (min, max))
    reached = deviation.moved(low, -deviation.reach), deviation.moved(high, deviation.reach)
    slack = ROUNDING * (box[1] - box[0])
    if box[0] - slack <= reached[0] and reached[1] <= box[1] + slack:
        return ""

    def said(ends: Range) -> str:
        return " to ".join(dict.fromkeys(shown(deviation.parameter, end) for end in ends))

    key = written_path(path)
    who = f"{key} ({', '.join(names)})" if names and names != [key] else key
    leaves = (
        f"search.robust.vary: with its tolerance {who}, {said((low, high))}, comes to {said(reached)}, outside the "
        f"meta-model's range {said(box)}"
    )
    room = deviation.room(box)
    inside = max(room[0], low), min(room[1], high)
    remedy = "solve designs beyond, or set meta_model.extrapolate: true."
    if inside[0] > inside[1] + slack:
        raise UserError(f"{leaves}, and no candidate stays inside; make the tolerance smaller, {remedy}")
    return f"{leaves}, where candidates fail; keep it within {said(inside)}, {remedy}"


def _paths(problem: SearchProblem, deviation: Deviation) -> tuple[KeyPath, ...]:
    """The key, and a family's in the segments that give it, or may be given, a value of their own."""
    own = [
        key
        for variable in problem.variables
        for key in variable.keys
        if deviation.path[0] == "family" and key[:2] == ("chain", "segments") and key[3:] == deviation.path
    ]
    return tuple(dict.fromkeys((deviation.path, *overridden(problem.study, deviation.path), *own)))


def _held(problem: SearchProblem, path: KeyPath) -> Iterator[tuple[str, Range]]:
    """(variable or "", lowest and highest value) that the key may hold undisturbed."""
    everywhere = False
    for one in problem.variables:
        if path in one.keys:
            everywhere |= len(one.conditions) == len(problem.conditions)
            values = one.settings.values() or (one.variable.low, one.variable.high)
            yield one.name, (min(values), max(values))
    stated = [condition.changes[path] for condition in problem.conditions if path in condition.changes]
    if stated:
        yield "", (min(stated), max(stated))
    if not everywhere and len(stated) < len(problem.conditions):
        value = number_at(problem.study, path)
        yield "", (value, value)
