"""A chain that is actuated: reach a point with its tip, or follow a curve with its backbone.

``gymnasium.make("pliant/FreeBending-v0")``, and so ``TipLoad``, ``HelicalHang``, ``TendonFinger`` and ``FollowShape``.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.physics import PhysicsBackend
from pliant.pipeline.motion import chain_frames, chain_scene
from pliant.pipeline.study import DEFAULT_PHYSICS
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, Inputs
from pliant.records.scene import Scene, SceneFrames
from pliant_plugins.envs.base import OBSERVED, SoftRobotEnv
from pliant_plugins.tasks.curves import Distances, resampled
from pliant_plugins.tasks.follow_shape import FollowShape

CHANGE_COST = 0.01  # of a full swing of every action, per step
RATE_S = 0.1  # rates are observed as the angle in this time
REACHED = 0.02  # of the chain's length
WEIGHT_N_KG = 9.81
TIP_LOADS_KG = (0.0, 0.01, 0.02, 0.05)
LEAST_SHARE = 0.1  # of the actuation: targets below hardly differ from rest
SEEN = 5  # points of the curve in the observation
COMPARED = 50  # points at which backbone and curve are compared


class ChainEnv(SoftRobotEnv):
    """One chain from a study; each action is one input's share of its highest value, −1 for none.

    Observation, in this order: joint coordinates (rad), their change in 0.1 s, the tip from the base in chain
    lengths, the shares of the actuation, then what the subclass adds.
    """

    goal_size: ClassVar[int]

    def _build(self) -> None:
        self.simulation = self.backend.build(self.chain)
        self._rest = self.simulation.snapshot()
        self._statics = self._quasistatic().build(self.chain)
        self._straight = self._statics.snapshot()
        self._length_m = self.chain.length_m
        self._markers = self.simulation.markers()
        size_seen = 2 * self._rest.position.size + 3 + len(self.inputs) + self.goal_size
        self._set_spaces(len(self.inputs), size_seen)

    def _quasistatic(self) -> PhysicsBackend:
        """Return the equilibria from which goals are drawn: engines agree, and Newton is the fastest."""
        component = self.opened.context.registry.get("physics", DEFAULT_PHYSICS)
        backend: PhysicsBackend = component.build(component.config_model()(kind=DEFAULT_PHYSICS))
        return backend

    def _begin(self, options: dict[str, Any]) -> None:
        self._ask(options)
        self.simulation.restore(self._rest)
        self.simulation.apply(self._inputs(self._share))
        self._markers = self.simulation.markers()

    def _advance(self, action: Array) -> bool:
        self._before, self._share = self._share, 0.5 * (action + 1.0)
        self.simulation.apply(self._inputs(self._share))
        self.simulation.step(self.control_s)
        self._markers = self.simulation.markers()
        return bool(np.all(np.isfinite(self._markers)))

    def _observed(self) -> OBSERVED:
        state = self.simulation.snapshot()
        return self._clipped(
            state.position,
            RATE_S * state.velocity,
            self._in_lengths(self._markers[-1]),
            self._share,
            self._goal(),
        )

    def _reward(self, action: Array) -> float:
        change = float(np.mean((self._share - self._before) ** 2))
        return -self._error_m() / self._length_m - CHANGE_COST * change

    def _metrics(self) -> dict[str, Any]:
        error = self._error_m()
        return {
            "time_s": self._taken * self.control_s,
            "tip_m": np.array(self._markers[-1]),
            "error_m": error,
            "is_success": bool(error < REACHED * self._length_m),
            **self._actuation(self._share),
        }

    def _inputs(self, share: Array) -> Inputs:
        """Return actuation with this episode's loads."""
        return Inputs(self._actuation(share))

    def _in_lengths(self, points_m: Array) -> Array:
        """Return world points relative to the base, in chain lengths."""
        return np.asarray((points_m - self.chain.base_position_m) / self._length_m)

    def _settled(self, share: Array) -> Equilibrium:
        """Return the equilibrium at this actuation and this episode's loads."""
        self._statics.restore(self._straight)
        self._statics.apply(self._inputs(share))
        return self._statics.settle()

    def _frame(self) -> SceneFrames:
        state = self.simulation.snapshot()
        return chain_frames(np.array([self._taken * self.control_s]), state.position[None])

    def _drawn(self) -> tuple[Scene, SceneFrames]:
        looks = self._looks()
        chain = self.chain.with_(shapes=looks.shapes)
        levels = [np.full(len(self.inputs), level) for level in (0.0, 0.5, 1.0)]
        poses = np.array([self._settled(share).joint_angles for share in levels])
        return chain_scene(chain), chain_frames(np.arange(3.0), poses)

    def close(self) -> None:
        super().close()
        self.simulation.close()
        self._statics.close()

    @abstractmethod
    def _ask(self, options: dict[str, Any]) -> None:
        """Draw this episode's loads and goal with `self.np_random`; the chain's state is free to use."""

    @abstractmethod
    def _goal(self) -> Array:
        """Return (goal_size,) the part of the observation for the goal and the loads."""

    @abstractmethod
    def _error_m(self) -> float:
        """Return the distance between the chain and the goal."""


def points_option(options: dict[str, Any], name: str, curve: bool = False) -> Array | None:
    """Return a vector (3,) from the options, or a curve's points (k, 3); None if the option is absent.

    Raises:
        UserError: the option has any other value.
    """
    if name not in options:
        return None
    try:
        value = np.asarray(options[name], float)
    except (TypeError, ValueError):
        value = np.empty(0)
    right = value.ndim == 2 and value.shape[1:] == (3,) and len(value) > 1 if curve else value.shape == (3,)
    if not right or not np.all(np.isfinite(value)):
        if curve:
            raise UserError(f"option '{name}' needs at least two points of three numbers each.")
        raise UserError(f"option '{name}' is {options[name]!r}; it needs three numbers.")
    return value


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
        force, target = points_option(options, "tip_force_n"), points_option(options, "target_m")
        # Both are drawn in any case, so that one option does not change the other.
        drawn = self._draw_force()
        share = self.np_random.uniform(LEAST_SHARE, 1.0, len(self.inputs))
        self._force = drawn if force is None else force
        self._target = self._settled(share).tip_m.copy() if target is None else target

    def _draw_force(self) -> Array:
        """Return this episode's tip force (3,) in N."""
        return np.zeros(3)

    def _inputs(self, share: Array) -> Inputs:
        return Inputs(self._actuation(share), self._force)

    def _goal(self) -> Array:
        return np.concatenate([self._in_lengths(self._target), self._force / self.force_scale_n])

    def _error_m(self) -> float:
        return float(np.linalg.norm(self._markers[-1] - self._target))

    def _metrics(self) -> dict[str, Any]:
        return {**super()._metrics(), "target_m": self._target.copy(), "tip_force_n": self._force.copy()}


class FreeBendingEnv(ReachEnv):
    """Bend a finger of eight modules without payload until its tip is at the target."""

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
        config = getattr(self.task, "config", None)
        loads = getattr(config, "loads_kg", TIP_LOADS_KG)
        return np.array([0.0, 0.0, -WEIGHT_N_KG * self.np_random.choice(loads)])


class TendonFingerEnv(ReachEnv):
    """Pull the tendon until the tip is at the target; up to 50 g hang at the tip, another weight each time."""

    default_study: ClassVar[str] = "tendon_finger"
    force_scale_n: ClassVar[float] = 0.05 * WEIGHT_N_KG

    def _draw_force(self) -> Array:
        return np.array([0.0, 0.0, -self.np_random.uniform(0.0, self.force_scale_n)])


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
        share = self.np_random.uniform(LEAST_SHARE, 1.0, len(self.inputs))
        curve = points_option(options, "curve_m", curve=True)
        if curve is None and isinstance(self.task, FollowShape):
            curve = self.chain.base_position_m + self.task.target @ self.chain.base_rotation.T
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
