"""States of a module under several actuations: free ones that show how far it bends, then states that fill the box.

Every state holds all axes at a point of a scrambled Sobol sequence (Owen 1998) over the actuations and deformations at
once, corners of that box first: with exact slopes each of them tells τ, its changes by every actuation and every
axis, the energy and the travels.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import scipy

from pliant.errors import NotReachedError, UserError
from pliant.interfaces.fem import FemConfig
from pliant.pipeline.sampling.walk import MAIN, StateTarget, Walk
from pliant.records.design import Array
from pliant.records.fem import Role
from pliant.records.law import EXTENSION

STRAIGHT = 1e-9  # a largest free angle (rad) below this is rounding
BESIDE = 0.3
FREE_SHARES = (0.5, 1.0)  # of the limits, on each free branch


@dataclass(frozen=True)
class SeveralPlan:
    """The only strategy under several actuations.

    Attributes:
        config: `max_states` states fill the box, `check_states` more are never fitted.
        limit: (m,) the largest actuations, Pa or N.
    """

    config: FemConfig
    limit: Array

    def estimate(self) -> int:
        """About how many states there will be."""
        free = 1 + len(FREE_SHARES) * (len(self.limit) + 1)
        return free + self.config.max_states + self.config.check_states

    def carry_out(self, walk: Walk) -> dict[str, Any]:
        """Solve everything; returns the summary.

        Raises:
            UserError: a strategy of one actuation.
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
                walk.reach(StateTarget("free", _levels(share * driven * self.limit)))
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

    def _hold(self, walk: Walk, place: Array, axes: tuple[str, ...], role: Role) -> None:
        m = len(self.limit)
        held = dict(zip(axes, place[m:].tolist(), strict=True))
        walk.reach(StateTarget("constrained", _levels(place[:m]), held, role=role))

    def _sides(self, walk: Walk) -> dict[str, tuple[float, float]]:
        """Of each axis the range of the free states, widened by `angle_high`; an axis that none drives gets
        `lateral_angle` both ways.
        """
        free = [one.state for one in walk.of(MAIN)]
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
        """The range of the free states' extensions, and on both sides `BESIDE` of it for forces along the chain."""
        low, high = float(column.min()), float(column.max())
        return low - BESIDE * (high - low), high + BESIDE * (high - low)

    def _points(self, dimensions: int) -> Array:
        """(n, d) in the unit cube: first what scores, then corners, then the rest."""
        count, checks = self.config.max_states, self.config.check_states
        sequence = scipy.stats.qmc.Sobol(dimensions, scramble=True, seed=self.config.seed)
        points = sequence.random_base2(int(np.ceil(np.log2(max(count + checks, 2)))))[: count + checks]
        corners = np.array(list(product((0.0, 1.0), repeat=dimensions)))
        if len(corners) > count // 3:  # every second one spans the box too
            corners = corners[corners.sum(axis=1) % 2 == 0]
        if len(corners) > count // 2:
            corners = corners[:0]
        return np.concatenate([points[:checks], corners, points[checks + len(corners) :]])


def _levels(values: Array) -> tuple[float, ...]:
    return tuple(np.asarray(values, float).tolist())
