"""The other axes of a module: their laws with all else free, and states in which all axes are held at once.

On the piece that moves about all axes, a lateral axis is held at angles up to `lateral_angle` while the main
one follows its free branch, as on a bench; states are chosen as on the main axis. A module with mirror planes
has an energy that is even in its lateral angles. That is tested, not asked: the far corner is solved on both
sides, and where they agree the states at −u are copies. The coupling states hold all axes at points of a
scrambled Sobol sequence (Owen 1998), so that a coupled law can be fitted, or the uncoupled one judged.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from pliant.interfaces.fem import FemConfig
from pliant.pipeline.sampling.adaptive import Box, check_error, corners, refine
from pliant.pipeline.sampling.free import free_levels
from pliant.pipeline.sampling.grid import check_targets
from pliant.pipeline.sampling.targets import FULL, Target, levels
from pliant.pipeline.sampling.walk import Walk
from pliant.records.fem import FemState, Role

FREE_LEVELS = 3  # states of the free branch on the full piece, rest included
MIRROR_TOLERANCE = 1e-3  # of τ and of u: both sides agree
CHECKS = 2  # check states of each lateral axis, on the side that is not fitted


@dataclass(frozen=True)
class Lateral:
    """The axes of the full piece, up to which actuation and angle they are sampled."""

    axes: tuple[str, ...]
    main_axis: str
    limit: float
    config: FemConfig

    @property
    def reach(self) -> float:
        """Largest lateral angle."""
        return self.config.lateral_angle_rad

    def estimate(self) -> int:
        """About how many states all this takes."""
        others = len(self.axes) - 1
        return FREE_LEVELS + others * self.estimate_of_axis() + self.config.coupling_states

    def estimate_of_axis(self) -> int:
        """About how many states one axis takes, the free ones aside."""
        return self.config.lateral_states + 1 + min(CHECKS, self.config.check_states)

    def start(self, walk: Walk) -> None:
        """The free branch of the full piece, which starts all its other states."""
        walk.rest(FULL)
        free_levels(walk, levels(0.0, self.limit, FREE_LEVELS)[1:], "", FULL)

    def explore(self, walk: Walk, axis: str, expect: Callable[[int], None]) -> dict[str, Any]:
        """The states of one lateral axis; returns the record of how well its law is known."""
        reach, config = self.reach, self.config
        symmetric, apart = self._mirror_test(walk, axis)
        box = Box(axis, FULL, (0.0, self.limit), (-reach, reach), symmetric)
        for target in corners(box):
            if not walk.knows(target):
                walk.reach(target)
        most = FREE_LEVELS + config.lateral_states * (1 if symmetric else 2)
        verdict = refine(walk, box, config.error, most, expect)
        low, high = (-reach, 0.0) if symmetric else (-reach, reach)
        count = min(CHECKS, config.check_states)
        for target in check_targets(self.limit, low, high, count, config.seed, axis, FULL):
            walk.reach(target)
        n_states = sum(one.target.explored == axis for one in walk.of(FULL))
        return {
            **verdict.record(n_states),
            "check_error": check_error(walk, box),
            "symmetric": symmetric,
            "difference_of_sides": apart,
        }

    def couple(self, walk: Walk, main_box: tuple[float, float]) -> None:
        """States that hold all axes, over the box of all of them."""
        count = self.config.coupling_states
        if count == 0:
            return
        sides = [(0.0, self.limit)]
        sides += [main_box if axis == self.main_axis else (-self.reach, self.reach) for axis in self.axes]
        sequence = scipy.stats.qmc.Sobol(len(sides), scramble=True, seed=self.config.seed)
        points = sequence.random_base2(int(np.ceil(np.log2(count))))[:count]
        low, high = np.array(sides).T
        for point in low + (high - low) * points:
            held = {axis: float(u) for axis, u in zip(self.axes, point[1:], strict=True)}
            walk.reach(Target("constrained", float(point[0]), held, piece=FULL))

    def _mirror_test(self, walk: Walk, axis: str) -> tuple[bool, float | None]:
        """Whether the states at ±u under the largest actuation are mirror images, and how much they differ."""
        k = self.axes.index(axis)
        right = self._corner(walk, axis, self.reach, "fit")
        left = self._corner(walk, axis, -self.reach, "check")
        if right is None or left is None:
            return False, None
        size = max(abs(float(right.tau[k])), abs(float(left.tau[k])), 1e-300)
        in_effort = abs(float(right.tau[k] + left.tau[k])) / size
        followed = np.abs(np.delete(right.deformation, k)) - np.abs(np.delete(left.deformation, k))
        apart = max(in_effort, float(np.abs(followed).max()) / self.reach)
        return apart <= MIRROR_TOLERANCE, apart

    def _corner(self, walk: Walk, axis: str, angle: float, role: Role) -> FemState | None:
        held = {axis: angle}
        return walk.reach(Target("constrained", self.limit, held, role=role, explored=axis, piece=FULL))
