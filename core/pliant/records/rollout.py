"""What goes into a simulation and what comes out of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pliant.records.design import Array


@dataclass(frozen=True, eq=False)
class Inputs:
    """Actuation and loads at one instant.

    Attributes:
        actuation: value of each actuator's input, e.g. ``{"pressure_pa": 15e3}``.
        tip_force_n: (3,) dead force at the tip, world frame.
        moment_n_m: external end moment about the main axis that opposes the actuation. It is carried by every
            joint: its potential is moment · Σ main-axis coordinates, on a planar chain that of a moment on the
            tip body. Prismatic chains take none.
    """

    actuation: Mapping[str, float]
    tip_force_n: Array = field(default_factory=lambda: np.zeros(3))
    moment_n_m: float = 0.0


@dataclass(frozen=True)
class OutsideDomain:
    """A law was used outside the box of its data: joint number from 1, variable, how far, when.

    `variable` is the input's name, `angle_rad` (`angle_x_rad`… on a spherical joint, `extension_m` on a
    prismatic one), or `dtau_du` where the law's slope is not negative. `excess` is in the variable's unit and in
    joint coordinates: negative below the box, positive above.
    """

    module: int
    time_s: float
    variable: str
    excess: float


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A settled chain.

    Attributes:
        joint_angles: (n, a) joint coordinates.
        markers_m: (n + 2, 3) base, joints 1…n, tip, world frame.
        residual: largest unbalanced effort, N·m (N for prismatic joints), measured by the common statics.
        converged: the engine reached its own tolerance.
        stable: the potential energy has a minimum here; None if the engine cannot tell.
        iterations: Newton iterations or time steps.
    """

    joint_angles: Array
    markers_m: Array
    residual: float
    converged: bool
    stable: bool | None
    iterations: int
    wall_s: float
    outside_domain: tuple[OutsideDomain, ...] = ()

    @property
    def tip_m(self) -> Array:
        """(3,) world position of the tip."""
        tip: Array = self.markers_m[-1]
        return tip


@dataclass(frozen=True, eq=False)
class Rollout:
    """A history: time_s (t,), actuation (t, inputs), joint_angles (t, n, a), markers_m (t, n + 2, 3)."""

    time_s: Array
    actuation: Array
    joint_angles: Array
    markers_m: Array


@dataclass(frozen=True, eq=False)
class TaskResult:
    """What a task leaves behind: the settled chain, the task's metrics (SI, unit in the name), a history."""

    final: Equilibrium
    metrics: Mapping[str, Any]
    rollout: Rollout | None = None
