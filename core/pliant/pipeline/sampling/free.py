"""The free branch: at given levels, or in steps that grow while the tangent foretells the next state."""

from __future__ import annotations

import numpy as np

from pliant.errors import NotReachedError
from pliant.pipeline.sampling.targets import MAIN, Target
from pliant.pipeline.sampling.walk import Walk
from pliant.records.design import Array
from pliant.records.fem import FemState

STRAIGHT = 1e-9  # a largest free angle (rad) or extension (m) below this is rounding
FIRST_STEP = 1 / 8  # of the limit
SHORTEST_STEP = 1 / 64
LONGEST_STEP = 1 / 3
# A step whose prediction misses by this share of the angle reached so far was just right.
WANTED_MISS = 0.1


def free_levels(walk: Walk, actuations: Array, explored: str, piece: str = MAIN) -> None:
    """The free branch at given actuations, ascending. Raises `NotReachedError` at its first failure."""
    for actuation in actuations:
        target = Target("free", float(actuation), explored=explored, piece=piece)
        if walk.reach(target) is None:
            raise _stopped(walk)


def free_adaptive(walk: Walk, limit: float, explored: str) -> None:
    """The free branch up to `limit`, from a walk that stands at rest.

    Each step is as long as the miss of the tangent's prediction over the last one allows; a step that fails is
    tried at half its length. Raises `NotReachedError` where the shortest step fails.
    """
    here = walk.solved[-1].state
    step = FIRST_STEP * limit
    while here.actuation < limit:
        left = limit - here.actuation
        # Two even steps rather than one and a splinter.
        length = left if left <= step else min(step, left / 2) if left < 2 * step else step
        target = Target("free", limit if length == left else here.actuation + length, explored=explored)
        found = walk.reach(target)
        if found is None:
            step = length / 2
            if step < SHORTEST_STEP * limit:
                raise _stopped(walk)
            walk.failed.pop()  # a shorter step gets past it, or says so
            continue
        step = length * _growth(here, found)
        step = min(max(step, SHORTEST_STEP * limit), LONGEST_STEP * limit)
        here = found


def largest_free(walk: Walk) -> float:
    """Largest |u| of the free branch. Raises `NotReachedError` for a module that stays straight."""
    free = [one.state.angle_rad for one in walk.of(MAIN) if one.target.branch == "free"]
    largest = float(np.abs(free).max())
    if largest < STRAIGHT:
        raise NotReachedError("the module does not bend under pressure, so that no angles can be chosen")
    return largest


def _growth(here: FemState, found: FemState) -> float:
    """By what the next step may be longer than the last: the miss grows with the square of the length."""
    by_actuation = -here.dmoment_dp / here.dmoment_du
    foretold = here.angle_rad + by_actuation * (found.actuation - here.actuation)
    size = max(abs(found.angle_rad), STRAIGHT)
    miss = abs(found.angle_rad - foretold) / size
    return float(np.clip(np.sqrt(WANTED_MISS / max(miss, 1e-12)), 0.5, 2.0))


def _stopped(walk: Walk) -> NotReachedError:
    cause = str(walk.failed[-1]["cause"]).rstrip(".")
    return NotReachedError(
        f"the free branch stopped: {cause}. Lower the largest pressure or force under "
        "'fem', or see whether the material is as stiff as it should be (a bare modulus is in Pa)."
    )
