"""The published study's sampling: free branch, then dead loads in even steps at fixed actuations.

Loads at one actuation are applied one after another from the free state, upwards and downwards, until the
module is bent beyond the box of angles or does not converge. The study's numbers are those of `STUDY_LOADS`.
"""

from __future__ import annotations

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.fem import FemConfig
from pliant.interfaces.study_loads import STUDY_LOADS, StudyLoads
from pliant.pipeline.sampling.free import free_levels
from pliant.pipeline.sampling.targets import Target
from pliant.pipeline.sampling.walk import Walk
from pliant.records.design import Array
from pliant.records.fem import ModuleProblem

ROUNDING = 1e-9


def loads_of(config: FemConfig, problem: ModuleProblem) -> dict[str, StudyLoads]:
    """The loads of each axis: the config's own, or the study's for such a module.

    Raises `UserError` for an axis that the study did not sample and the config does not give.
    """
    unknown = sorted(set(config.study_loads) - set(problem.axes))
    if unknown:
        raise UserError(
            f"fem.study_loads: the module has no axis '{unknown[0]}', only {', '.join(problem.axes)}."
        )
    preset = STUDY_LOADS.get((problem.actuation, len(problem.axes), problem.joint), {})
    loads = {}
    for axis in problem.axes:
        found = config.study_loads.get(axis, preset.get(axis))
        if found is None:
            raise UserError(
                f"fem: the published study has no loads for axis {axis} of a {problem.joint} joint driven by "
                f"{problem.actuation}; give 'study_loads: {{{axis}: {{actuation_step: ..., effort_high: ..., "
                "effort_step: ...}}'."
            )
        loads[axis] = found
    return loads


def free_actuations(loads: StudyLoads, limit: float) -> Array:
    """Actuations of the free branch above zero, up to the limit."""
    found = steps(0.0, limit, loads.actuation_step)[1:]
    return found if found.size and limit - found[-1] < ROUNDING * limit else np.append(found, limit)


def study_states(loads: StudyLoads, limit: float) -> int:
    """How many states one axis has if every load is reached."""
    efforts = len(steps(loads.effort_low, loads.effort_high, loads.effort_step)) - 1
    levels = len(steps(loads.actuation_low, limit, loads.actuation_step))
    return 1 + len(free_actuations(loads, limit)) + efforts * levels


def study_axis(
    walk: Walk, loads: StudyLoads, limit: float, axis: str, piece: str, box: tuple[float, float]
) -> None:
    """The loads of another axis, the main one free, from a walk that has started on `piece`."""
    known = {one.state.actuation for one in walk.of(piece) if one.target.branch == "free"}
    wanted = steps(loads.actuation_low, limit, loads.actuation_step)
    free_levels(walk, np.array([p for p in wanted if p not in known]), "", piece)
    ladders(walk, loads, limit, axis, piece, box)


def ladders(
    walk: Walk, loads: StudyLoads, limit: float, axis: str, piece: str, box: tuple[float, float]
) -> None:
    """Rising and falling loads at each actuation."""
    k = walk.pieces[piece].axes.index(axis)
    efforts = steps(loads.effort_low, loads.effort_high, loads.effort_step)
    small = ROUNDING * loads.effort_step
    for p in steps(loads.actuation_low, limit, loads.actuation_step):
        for ladder in (efforts[efforts > small], efforts[efforts < -small][::-1]):
            for effort in ladder:
                load = {axis: float(effort)}
                state = walk.reach(Target("constrained", float(p), effort=load, explored=axis, piece=piece))
                if state is None or not box[0] <= float(state.deformation[k]) <= box[1]:
                    break


def steps(low: float, high: float, step: float) -> Array:
    """low, low + step … up to `high`, in numbers as people write them."""
    count = int(np.floor((high - low) / step + ROUNDING)) + 1
    return np.array([float(f"{low + n * step:.12g}") for n in range(count)])
