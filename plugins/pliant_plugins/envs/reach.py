"""Reach a point with the tip, under loads that differ from episode to episode.

``gymnasium.make("pliant/FreeBending-v0")``, and so ``TipLoad``, ``HelicalHang`` and ``TendonFinger``."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from pliant.records.design import Array
from pliant.records.rollout import Inputs
from pliant_plugins.envs.chain_env import ChainEnv, vector_option

WEIGHT_N_KG = 9.81
TIP_LOADS_KG = (0.0, 0.01, 0.02, 0.05)
LEAST_SHARE = 0.1  # of the actuation: targets below hardly differ from rest


class ReachEnv(ChainEnv):
    """The target is where the tip settles at a random actuation under this episode's load: it can be reached.

    Reward per step: −(distance of the tip to the target) / (chain length) − 0.01 (change of the actuation)².
    Adds to the observation: target from the base in chain lengths (3), tip force over `force_scale_n` (3).
    Options: `target_m`, `tip_force_n` (world, 3 numbers each). `info`: `error_m`, `is_success` (within 2 % of
    the length), `target_m`, `tip_force_n`.
    """

    goal_size: ClassVar[int] = 6
    option_names: ClassVar[tuple[str, ...]] = ("target_m", "tip_force_n")
    force_scale_n: ClassVar[float] = 1.0

    _target: Array = np.zeros(3)
    _force: Array = np.zeros(3)

    def _ask(self, options: dict[str, Any]) -> None:
        force, target = vector_option(options, "tip_force_n"), vector_option(options, "target_m")
        # Both are drawn in any case, so that one option does not change the other.
        drawn = self._draw_force()
        share = self.np_random.uniform(LEAST_SHARE, 1.0, len(self.plant.names))
        self._force = drawn if force is None else force
        self._target = self._settled(share).tip_m.copy() if target is None else target

    def _draw_force(self) -> Array:
        """This episode's tip force (3,) in N."""
        return np.zeros(3)

    def _inputs(self, share: Array) -> Inputs:
        return Inputs(self.plant.actuation(share), self._force)

    def _goal(self) -> Array:
        return np.concatenate([self._in_lengths(self._target), self._force / self.force_scale_n])

    def _error_m(self) -> float:
        return float(np.linalg.norm(self._markers[-1] - self._target))

    def _metrics(self) -> dict[str, Any]:
        return {**super()._metrics(), "target_m": self._target.copy(), "tip_force_n": self._force.copy()}


class FreeBendingEnv(ReachEnv):
    """Bend a finger of eight modules until its tip is at the target; nothing hangs at it."""

    default_study: ClassVar[str] = "free_bending"


class TipLoadEnv(ReachEnv):
    """Bend a finger until its tip is at the target, with a dead force of up to `force_scale_n` at the tip.

    The force has any direction in the bending plane.
    """

    default_study: ClassVar[str] = "tip_load"
    force_scale_n: ClassVar[float] = 0.13

    def _draw_force(self) -> Array:
        size, angle = self.np_random.uniform(0.0, self.force_scale_n), self.np_random.uniform(0.0, 2 * np.pi)
        plane = self.chain.base_rotation[:, [0, 2]]  # chain x and z: bending is about y
        return np.asarray(size * plane @ [np.cos(angle), np.sin(angle)])


class HelicalHangEnv(ReachEnv):
    """Hold the tip of a helical actuator at the target with 0, 10, 20 or 50 g hung there, or the study's `loads`."""

    default_study: ClassVar[str] = "helical_hang"
    force_scale_n: ClassVar[float] = TIP_LOADS_KG[-1] * WEIGHT_N_KG

    def _draw_force(self) -> Array:
        config = getattr(self.plant.task, "config", None)
        loads = getattr(config, "loads_kg", TIP_LOADS_KG)
        return np.array([0.0, 0.0, -WEIGHT_N_KG * self.np_random.choice(loads)])


class TendonFingerEnv(ReachEnv):
    """Pull the tendon until the tip is at the target; up to 50 g hang at the tip, another weight each time."""

    default_study: ClassVar[str] = "tendon_finger"
    force_scale_n: ClassVar[float] = 0.05 * WEIGHT_N_KG

    def _draw_force(self) -> Array:
        return np.array([0.0, 0.0, -self.np_random.uniform(0.0, self.force_scale_n)])
