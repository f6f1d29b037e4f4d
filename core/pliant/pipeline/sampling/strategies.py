"""Sampling strategies of an axis: the free branch, the grid, the published study's loads, the limits of the box.

Under several actuations (`SeveralPlan`) free states determine how far the module bends, then states fill the box. Each
of them prescribes all axes at a point of a scrambled Sobol sequence (Owen 1998) over actuations and deformations,
starting with corners of the box. A state with exact slopes gives τ, its derivatives by every actuation and axis, the
energy and the travels.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import scipy

from pliant.errors import NotReachedError, UserError
from pliant.interfaces.fem import FemConfig
from pliant.interfaces.study_loads import STUDY_LOADS, StudyLoads
from pliant.pipeline.sampling.walk import MAIN, SamplingRun, StateTarget, levels
from pliant.records.design import Array
from pliant.records.fem import ModuleProblem, Role
from pliant.records.law import EXTENSION

STRAIGHT = 1e-9  # a largest free angle (rad) or extension (m) below this is rounding
FIRST_STEP = 1 / 8  # of the limit
SHORTEST_STEP = 1 / 64
LONGEST_STEP = 1 / 3
# Target for the prediction error of a step, relative to the angle reached so far.
WANTED_MISS = 0.1
# Actuations of the trials for the border of trusted angles, as shares of the limit: the border hardly depends on
# them, so different values give states at different places.
ACTUATIONS = (0.0, 0.5, 0.25, 0.75)
ROUNDING = 1e-9


def free_levels(walk: SamplingRun, actuations: Array, explored: str, piece: str = MAIN) -> None:
    """Solve the free branch at given ascending actuations. Raises `NotReachedError` at the first failure."""
    for actuation in actuations:
        if walk.solve(StateTarget("free", float(actuation), explored=explored, piece=piece)) is None:
            raise _stopped(walk)


def free_adaptive(walk: SamplingRun, limit: float, explored: str) -> None:
    """Solve the free branch from rest up to `limit`.

    The step length follows from the error of the tangent prediction over the last step, which grows with the square of
    the length. A failed step is repeated with half its length. Raises `NotReachedError` if the shortest step fails.
    """
    here = walk.solved[-1].state
    step = FIRST_STEP * limit
    while here.actuation < limit:
        left = limit - here.actuation
        # Two equal steps rather than one and a very short one.
        length = left if left <= step else min(step, left / 2) if left < 2 * step else step
        target = StateTarget("free", limit if length == left else here.actuation + length, explored=explored)
        found = walk.solve(target)
        if found is None:
            step = length / 2
            if step < SHORTEST_STEP * limit:
                raise _stopped(walk)
            walk.failed.pop()  # a shorter step succeeds, or raises the error
            continue
        by_actuation = -here.dmoment_dp / here.dmoment_du
        foretold = here.angle_rad + by_actuation * (found.actuation - here.actuation)
        miss = abs(found.angle_rad - foretold) / max(abs(found.angle_rad), STRAIGHT)
        step = length * float(np.clip(np.sqrt(WANTED_MISS / max(miss, 1e-12)), 0.5, 2.0))
        step = min(max(step, SHORTEST_STEP * limit), LONGEST_STEP * limit)
        here = found


def _stopped(walk: SamplingRun) -> NotReachedError:
    cause = str(walk.failed[-1]["cause"]).rstrip(".")
    return NotReachedError(
        f"the free branch stopped: {cause}. Lower the largest pressure or force under "
        "'fem', or check the stiffness of the material (a modulus without a unit is in Pa)."
    )


def angle_range(walk: SamplingRun, config: FemConfig) -> tuple[float, float]:
    """Return the smallest and largest angle of the data: `angle_low` and `angle_high` times the largest free angle.

    Raises `NotReachedError` for a module that stays straight.
    """
    free = [one.state.angle_rad for one in walk.piece_states(MAIN) if one.target.branch == "free"]
    largest = float(np.abs(free).max())
    if largest < STRAIGHT:
        raise NotReachedError("the module does not bend under pressure, so that no angles can be chosen")
    return config.angle_low * largest, config.angle_high * largest


def trusted_box(walk: SamplingRun, axis: str, limit: float, low: float, high: float) -> tuple[float, float]:
    """Return the part of [low, high] around the free branch that solved states show to be free of self-contact."""

    free = [one.state for one in walk.solved if one.target.branch == "free"]
    sound = [state.angle_rad for state in free if state.trusted]
    sides = [(min(0.0, *sound), low)]
    if free[-1].trusted:
        sides.append((max(s.angle_rad for s in free), high))
    edges = []
    for inner, outer in sides:
        # `outer` if the state there is valid, else the furthest valid one by bisection towards `inner`
        end, reached, trial = outer, inner, outer
        for share in ACTUATIONS if inner != outer else ():
            found = walk.solve(StateTarget("constrained", share * limit, {axis: trial}, explored=axis))
            if found is None or not found.trusted:
                end = trial
            else:
                reached = trial
                if trial == end:
                    break
            trial = (reached + end) / 2
        edges.append(reached)
    return edges[0], edges[1] if len(edges) > 1 else high


def grid(walk: SamplingRun, config: FemConfig, limit: float, axis: str) -> tuple[float, float]:
    """Solve the free branch at Chebyshev levels, then every angle at every actuation, nearest to the branch first.

    Returns the box of angles.
    """
    free_levels(walk, levels(0.0, limit, config.pressures)[1:], axis)
    free = [one.state for one in walk.piece_states(MAIN)]
    low, high = angle_range(walk, config)
    actuations, angles = [s.actuation for s in free], [s.angle_rad for s in free]
    for p in levels(0.0, limit, config.pressures):
        here = float(np.interp(p, actuations, angles))
        for u in sorted(levels(low, high, config.angles), key=lambda u: abs(u - here)):
            walk.solve(StateTarget("constrained", float(p), {axis: float(u)}, explored=axis))
    return low, high


def check_targets(
    limit: float, low: float, high: float, count: int, seed: int, axis: str, piece: str = MAIN
) -> list[StateTarget]:
    """Return `count` states, never fitted, spread over the box by a seeded Latin hypercube."""
    random = np.random.default_rng(seed)
    strata = np.stack([random.permutation(count), random.permutation(count)], axis=1)
    points = (strata + random.random((count, 2))) / max(count, 1)
    places = [(float(a * limit), {axis: float(low + b * (high - low))}) for a, b in points]
    return [StateTarget("constrained", p, held, {}, "check", axis, piece) for p, held in places]


def axis_loads(config: FemConfig, problem: ModuleProblem) -> dict[str, StudyLoads]:
    """Return the loads of each axis in the published study's sampling: the config's own, or those of `STUDY_LOADS`.

    Raises `UserError` for an axis that neither the published study nor the config specifies.
    """
    unknown = sorted(set(config.study_loads) - set(problem.axes))
    if unknown:
        raise UserError(
            f"fem.study_loads: the module has no axis '{unknown[0]}', only {', '.join(problem.axes)}."
        )
    preset = STUDY_LOADS.get((problem.actuation, len(problem.axes), problem.joint), {})
    loads = {**preset, **config.study_loads}
    for axis in problem.axes:
        if axis not in loads:
            raise UserError(
                f"fem: the published study has no loads for axis {axis} of a {problem.joint} joint driven by "
                f"{problem.actuation}; give 'study_loads: {{{axis}: {{actuation_step: ..., effort_high: ..., "
                "effort_step: ...}}'."
            )
    return {axis: loads[axis] for axis in problem.axes}


def free_actuations(loads: StudyLoads, limit: float) -> Array:
    """Return the actuations of the free branch above zero, up to the limit."""
    found = steps(0.0, limit, loads.actuation_step)[1:]
    return found if found.size and limit - found[-1] < ROUNDING * limit else np.append(found, limit)


def study_states(loads: StudyLoads, limit: float) -> int:
    """Return the number of states of one axis if every load is reached."""
    efforts = len(steps(loads.effort_low, loads.effort_high, loads.effort_step)) - 1
    return (
        1
        + len(free_actuations(loads, limit))
        + efforts * len(steps(loads.actuation_low, limit, loads.actuation_step))
    )


def ladders(
    walk: SamplingRun, loads: StudyLoads, limit: float, axis: str, piece: str, box: tuple[float, float]
) -> None:
    """Solve the published study's dead loads in equal steps at each actuation, from the free state up and down.

    A series ends if the module bends beyond the box of angles or does not converge; the main axis is free.
    """
    k = walk.pieces[piece].axes.index(axis)
    actuations = steps(loads.actuation_low, limit, loads.actuation_step)
    if piece != MAIN:
        known = {one.state.actuation for one in walk.piece_states(piece) if one.target.branch == "free"}
        free_levels(walk, np.array([p for p in actuations if p not in known]), "", piece)
    efforts = steps(loads.effort_low, loads.effort_high, loads.effort_step)
    small = ROUNDING * loads.effort_step
    for p in actuations:
        for ladder in (efforts[efforts > small], efforts[efforts < -small][::-1]):
            for effort in ladder:
                load = {axis: float(effort)}
                state = walk.solve(
                    StateTarget("constrained", float(p), effort=load, explored=axis, piece=piece)
                )
                if state is None or not box[0] <= float(state.deformation[k]) <= box[1]:
                    break


def steps(low: float, high: float, step: float) -> Array:
    """Return low, low + step … up to `high`, without binary rounding errors."""
    count = int(np.floor((high - low) / step + ROUNDING)) + 1
    return np.array([float(f"{low + n * step:.12g}") for n in range(count)])


BESIDE = 0.3
FREE_SHARES = (0.5, 1.0)  # shares of the limits, on each free branch


@dataclass(frozen=True)
class SeveralPlan:
    """Sampling strategy under several actuations.

    Attributes:
        config: `max_states` states fill the box; `check_states` further states are never fitted.
        limit: (m,) the largest actuations, Pa or N.
    """

    config: FemConfig
    limit: Array

    def estimate(self) -> int:
        """Estimate the total number of states."""
        free = 1 + len(FREE_SHARES) * (len(self.limit) + 1)
        return free + self.config.max_states + self.config.check_states

    def carry_out(self, walk: SamplingRun) -> dict[str, Any]:
        """Solve everything; returns the summary.

        Raises:
            UserError: the config names a strategy of one actuation.
            NotReachedError: no input bends the module.
        """
        if self.config.sampling != "adaptive":
            raise UserError(
                f"fem.sampling '{self.config.sampling}' is for modules of one actuation, and this one has "
                f"{len(self.limit)}: leave it out, and 'max_states' states fill the box of all of them."
            )
        walk.rest()
        for driven in (*np.eye(len(self.limit)), np.ones(len(self.limit))):
            for share in FREE_SHARES:
                walk.solve(StateTarget("free", _levels(share * driven * self.limit)))
        sides = self._sides(walk)
        low, high = np.array([*((0.0, limit) for limit in self.limit), *sides.values()]).T
        points = self._points(len(low))
        walk.bar.expect(len(walk.saved) + len(points))
        for number, point in enumerate(points):
            role: Role = "check" if number < self.config.check_states else "fit"
            place = low + (high - low) * point
            self._hold(walk, place, tuple(sides), role)
        return {
            "kind": "several actuations",
            "seed": self.config.seed,
            "axes": {axis: {"low": side[0], "high": side[1]} for axis, side in sides.items()},
        }

    def _hold(self, walk: SamplingRun, place: Array, axes: tuple[str, ...], role: Role) -> None:
        m = len(self.limit)
        held = dict(zip(axes, place[m:].tolist(), strict=True))
        walk.solve(StateTarget("constrained", _levels(place[:m]), held, role=role))

    def _sides(self, walk: SamplingRun) -> dict[str, tuple[float, float]]:
        """Return each axis' range of the free states, widened by `angle_high`; ±`lateral_angle` if not driven."""
        free = [one.state for one in walk.piece_states(MAIN)]
        axes = walk.pieces[MAIN].axes
        turned = np.array([state.deformation for state in free])
        largest = float(np.abs(turned[:, [axis != EXTENSION for axis in axes]]).max())
        if largest < STRAIGHT:
            raise NotReachedError("no input bends the module, so that no angles can be chosen")
        sides = {}
        for axis, column in zip(axes, turned.T, strict=True):
            if axis == EXTENSION:
                sides[axis] = self._extensions(column)
                continue
            low, high = min(float(column.min()), 0.0), max(float(column.max()), 0.0)
            reach = max(-low, high)
            if reach < 1e-3 * largest:
                sides[axis] = (-self.config.lateral_angle_rad, self.config.lateral_angle_rad)
                continue
            wide = self.config.angle_high
            sides[axis] = (
                min(wide * low, self.config.angle_low * reach),
                max(wide * high, -self.config.angle_low * reach),
            )
        return sides

    def _extensions(self, column: Array) -> tuple[float, float]:
        """Return the range of the free states' extensions, widened on both sides by a share for axial forces."""
        low, high = float(column.min()), float(column.max())
        return low - BESIDE * (high - low), high + BESIDE * (high - low)

    def _points(self, dimensions: int) -> Array:
        """Return (n, d) points in the unit cube: first the check states, then corners, then the other states."""
        count, checks = self.config.max_states, self.config.check_states
        sequence = scipy.stats.qmc.Sobol(dimensions, scramble=True, seed=self.config.seed)
        points = sequence.random_base2(int(np.ceil(np.log2(max(count + checks, 2)))))[: count + checks]
        corners = np.array(list(product((0.0, 1.0), repeat=dimensions)))
        if len(corners) > count // 3:  # every second corner spans the box too
            corners = corners[corners.sum(axis=1) % 2 == 0]
        if len(corners) > count // 2:
            corners = corners[:0]
        return np.concatenate([points[:checks], corners, points[checks + len(corners) :]])


def _levels(values: Array) -> tuple[float, ...]:
    return tuple(np.asarray(values, float).tolist())
