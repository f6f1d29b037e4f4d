"""``gymnasium.make("pliant/FollowShape-v0")``"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant_plugins.envs.chain_env import ChainEnv
from pliant_plugins.envs.reach import LEAST_SHARE
from pliant_plugins.tasks.curves import Distances, resampled
from pliant_plugins.tasks.follow_shape import FollowShape

SEEN = 5  # points of the curve in the observation
COMPARED = 50  # points at which backbone and curve are compared


class FollowShapeEnv(ChainEnv):
    """Bend the backbone along a curve: that of the study's `follow_shape` task, or a pose that the chain can settle in.

    Reward per step: −(RMS distance at equal shares of the arc length) / (chain length) − 0.01 (change of the
    actuation)². Adds to the observation: five points of the curve from the base in chain lengths (15).
    Option: `curve_m`, points (k, 3) of a curve in the world from the base on. `info`: `error_m` (that RMS
    distance), `e_max_m` (the largest), `is_success` (within 2 % of the length), `curve_m`.
    """

    default_study: ClassVar[str] = "follow_shape"
    goal_size: ClassVar[int] = 3 * SEEN
    option_names: ClassVar[tuple[str, ...]] = ("curve_m",)

    _curve: Array = np.zeros((COMPARED, 3))

    def _ask(self, options: dict[str, Any]) -> None:
        # Drawn in any case, so that an option does not change later episodes.
        share = self.np_random.uniform(LEAST_SHARE, 1.0, len(self.plant.names))
        curve = _curve_option(options)
        if curve is None and isinstance(self.plant.task, FollowShape):
            curve = self.chain.base_position_m + self.plant.task.target @ self.chain.base_rotation.T
        self._curve = resampled(self._settled(share).markers_m if curve is None else curve, COMPARED)

    def _goal(self) -> Array:
        chosen = np.linspace(0, COMPARED - 1, SEEN + 1).round().astype(int)[1:]
        return self._in_lengths(self._curve[chosen])

    def _distances(self) -> Distances:
        return Distances.between(resampled(self._markers, COMPARED), self._curve)

    def _error_m(self) -> float:
        return self._distances().rmse_m

    def _metrics(self) -> dict[str, Any]:
        return {**super()._metrics(), "e_max_m": self._distances().e_max_m, "curve_m": self._curve.copy()}


def _curve_option(options: dict[str, Any]) -> Array | None:
    if "curve_m" not in options:
        return None
    try:
        curve = np.asarray(options["curve_m"], float)
    except (TypeError, ValueError):
        curve = np.empty(0)
    if curve.ndim != 2 or curve.shape[1:] != (3,) or len(curve) < 2 or not np.all(np.isfinite(curve)):
        raise UserError("option 'curve_m' needs at least two points of three numbers each.")
    return curve
