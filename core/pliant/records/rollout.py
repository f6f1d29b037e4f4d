"""Inputs and results of simulations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pliant.formatting import output_unit
from pliant.records.design import Array
from pliant.records.mount import Carrier
from pliant.records.scene import SceneFrames, SceneStill


@dataclass(frozen=True, eq=False)
class PointForce:
    """A dead force: `force_n` (3,) in the world, at `point_m` (3,) in the frame of body 0…n of the chain.

    A wrench is a force and a couple of two opposite forces at different points, so that it has a potential.
    """

    body: int
    point_m: Array
    force_n: Array

    def scaled(self, share: float) -> PointForce:
        """Return the force multiplied by a share, at the same point."""
        return replace(self, force_n=share * np.asarray(self.force_n, float))


@dataclass(frozen=True, eq=False)
class Cord:
    """A cord of constant tension T from a point x of body 0…n to a pulley in the world, of potential T |x − pulley|."""

    body: int
    point_m: Array
    pulley_m: Array
    tension_n: float

    def scaled(self, share: float) -> Cord:
        """Return the cord with its tension multiplied by a share."""
        return replace(self, tension_n=share * self.tension_n)


@dataclass(frozen=True, eq=False)
class Inputs:
    """Actuation and loads at one instant.

    Attributes:
        actuation: value of each actuator's input, e.g. ``{"pressure_pa": 15e3}``.
        tip_force_n: (3,) dead force at the tip, world frame.
        moment_n_m: external end moment about the main axis that opposes the actuation. It acts on every joint: its
            potential is moment · Σ main-axis coordinates, on a planar chain that of a moment on the tip body.
            Prismatic chains have none.
        forces: dead forces at points of the bodies.
        cords: cords of constant tension toward pulleys.
    """

    actuation: Mapping[str, float]
    tip_force_n: Array = field(default_factory=lambda: np.zeros(3))
    moment_n_m: float = 0.0
    forces: tuple[PointForce, ...] = ()
    cords: tuple[Cord, ...] = ()


@dataclass(frozen=True)
class OutsideDomain:
    """Use of a law outside the box of its data: joint number from 1, variable, excess, time.

    `variable` is the input's name, `angle_rad` (`angle_x_rad`… on a spherical joint, `extension_m` on a
    prismatic one), or `dtau_du` if the law's slope is not negative. `excess` is in the variable's unit and in
    joint coordinates: negative below the box, positive above.
    """

    module: int
    time_s: float
    variable: str
    excess: float

    def __str__(self) -> str:
        """Return the text "pressure_pa by 3 kPa" for messages."""
        return f"{self.variable} by {output_unit(self.variable).text(self.excess, 3)}"


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A settled chain.

    Attributes:
        joint_angles: (n, a) joint coordinates.
        markers_m: (n + 2, 3) base, joints 1…n, tip, world frame.
        residual: largest unbalanced effort, N·m (N for prismatic joints), computed by the common statics; NaN if the
            chain is in motion or in contact.
        converged: whether the engine reached its tolerance; for a motion, whether it could be followed.
        stable: whether the potential energy has a minimum here; None if the engine does not determine it.
        iterations: Newton iterations or time steps.
        carrier: the arm on which the chain is mounted, if any.
    """

    joint_angles: Array
    markers_m: Array
    residual: float
    converged: bool
    stable: bool | None
    iterations: int
    wall_s: float
    outside_domain: tuple[OutsideDomain, ...] = ()
    carrier: Carrier | None = None

    @property
    def at_rest(self) -> bool:
        """Return whether the joint efforts should balance: neither in motion nor in contact."""
        return not np.isnan(self.residual)

    @property
    def tip_m(self) -> Array:
        """(3,) world position of the tip."""
        return np.asarray(self.markers_m[-1])


@dataclass(frozen=True, eq=False)
class Rollout:
    """A history: time_s (t,), actuation (t, inputs), joint_angles (t, n, a), markers_m (t, n + 2, 3).

    `carrier`: the arm on which the chain is mounted at these times, if any.
    """

    time_s: Array
    actuation: Array
    joint_angles: Array
    markers_m: Array
    carrier: Carrier | None = None


@dataclass(frozen=True, eq=False)
class TaskResult:
    """Result of a task: the settled chain, the task's metrics (SI, unit in the name), a history.

    A task in a scene has `frames` and a few `stills` of its first trial; its `final` is the first arm at the end, with
    a residual of NaN, since contact forces are not included.

    `not_reached` is a sentence if the task was not completed: what failed, and the last valid state; `last_held` is its
    index in the history, if known.
    """

    final: Equilibrium
    metrics: Mapping[str, Any]
    rollout: Rollout | None = None
    frames: SceneFrames | None = None
    stills: tuple[SceneStill, ...] = ()
    not_reached: str = ""
    last_held: int | None = None

    @property
    def reached(self) -> bool:
        """Return whether `final` is an equilibrium under the conditions that the task requires."""
        return self.final.converged and not self.not_reached


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """First-order change of an equilibrium, by the implicit function theorem.

    Keys: each input's name (`pressure_pa`), `tip_force_n` (trailing 3), `moment_n_m`, `payload_kg`,
    `gravity_m_s2` (trailing 3) and `law_0`… (trailing: the parameters of `ChainModel.laws[k].scalar()`).

    Attributes:
        joint_angles: (n, a, …) change of the joint coordinates per unit of each quantity.
        markers_m: (n + 2, 3, …) change of the markers.
    """

    joint_angles: Mapping[str, Array]
    markers_m: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Response:
    """An equilibrium and its first-order change with the inputs.

    Attributes:
        joint_angles: (n, a).
        markers_m: (n + 2, 3) base, joints, tip.
        by_input: (k, n + 2, 3) change of the markers per unit of each input.
        tip_rotation: (3, 3) attitude of the last body in the world.
        tip_spin: (k, 3) its angular velocity per unit of each input.
        converged: whether it is an equilibrium with slopes.
        inside: whether every law is inside its domain.
    """

    joint_angles: Array
    markers_m: Array
    by_input: Array
    tip_rotation: Array
    tip_spin: Array
    converged: bool
    inside: bool
