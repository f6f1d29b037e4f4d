"""What goes into a simulation and what comes out of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pliant.formatting import unit_of
from pliant.records.design import Array
from pliant.records.mount import Carrier
from pliant.records.scene import SceneFrames, SceneStill


@dataclass(frozen=True, eq=False)
class PointForce:
    """A dead force: `force_n` (3,) in the world, at `point_m` (3,) in the frame of body 0…n of the chain.

    A wrench is a force and a couple of two opposite forces beside each other: so it has a potential.
    """

    body: int
    point_m: Array
    force_n: Array

    def scaled(self, share: float) -> PointForce:
        """The force times a share, at the same point."""
        return replace(self, force_n=share * np.asarray(self.force_n, float))


@dataclass(frozen=True, eq=False)
class Cord:
    """A cord of constant tension T from a point x of body 0…n to a pulley in the world, of potential T |x − pulley|."""

    body: int
    point_m: Array
    pulley_m: Array
    tension_n: float

    def scaled(self, share: float) -> Cord:
        """The cord with its tension times a share."""
        return replace(self, tension_n=share * self.tension_n)


@dataclass(frozen=True, eq=False)
class Inputs:
    """Actuation and loads at one instant.

    Attributes:
        actuation: value of each actuator's input, e.g. ``{"pressure_pa": 15e3}``.
        tip_force_n: (3,) dead force at the tip, world frame.
        moment_n_m: external end moment about the main axis that opposes the actuation. It is carried by every
            joint: its potential is moment · Σ main-axis coordinates, on a planar chain that of a moment on the
            tip body. Prismatic chains take none.
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
    """A law was used outside the box of its data: joint number from 1, variable, how far, when.

    `variable` is the input's name, `angle_rad` (`angle_x_rad`… on a spherical joint, `extension_m` on a
    prismatic one), or `dtau_du` where the law's slope is not negative. `excess` is in the variable's unit and in
    joint coordinates: negative below the box, positive above.
    """

    module: int
    time_s: float
    variable: str
    excess: float

    def __str__(self) -> str:
        """For people: "pressure_pa by 3 kPa"."""
        return f"{self.variable} by {unit_of(self.variable).text(self.excess, 3)}"


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A settled chain.

    Attributes:
        joint_angles: (n, a) joint coordinates.
        markers_m: (n + 2, 3) base, joints 1…n, tip, world frame.
        residual: largest unbalanced effort, N·m (N for prismatic joints), measured by the common statics; not a number
            where the chain is in motion or contact holds it.
        converged: the engine reached its own tolerance; of a motion, that it could follow it.
        stable: the potential energy has a minimum here; None if the engine cannot tell.
        iterations: Newton iterations or time steps.
        carrier: what the chain stands on, where that is not the world.
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
        """Whether the joint efforts are meant to balance: not in motion, nor held by contact."""
        return not np.isnan(self.residual)

    @property
    def tip_m(self) -> Array:
        """(3,) world position of the tip."""
        return np.asarray(self.markers_m[-1])


@dataclass(frozen=True, eq=False)
class Rollout:
    """A history: time_s (t,), actuation (t, inputs), joint_angles (t, n, a), markers_m (t, n + 2, 3).

    `carrier`: what the chain stands on at these times, where that is not the world.
    """

    time_s: Array
    actuation: Array
    joint_angles: Array
    markers_m: Array
    carrier: Carrier | None = None


@dataclass(frozen=True, eq=False)
class TaskResult:
    """What a task leaves behind: the settled chain, the task's metrics (SI, unit in the name), a history.

    A task in a scene leaves `frames` and a few `stills` of its first trial; its `final` is the first arm at the
    end, whose residual is not a number because contact forces are not in it.

    `not_reached` is a sentence where the task was not carried out in full: what failed, and what held last, of which
    `last_held` is the place in the history, where one is known.
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
        """Whether `final` is a state that the chain holds under what the task asked for."""
        return self.final.converged and not self.not_reached


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """How an equilibrium moves to first order, by the implicit function theorem.

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
    """An equilibrium and how it answers to the inputs to first order.

    Attributes:
        joint_angles: (n, a).
        markers_m: (n + 2, 3) base, joints, tip.
        by_input: (k, n + 2, 3) change of the markers per unit of each input.
        tip_rotation: (3, 3) attitude of the last body in the world.
        tip_spin: (k, 3) its angular velocity per unit of each input.
        converged: whether it is an equilibrium with slopes.
        inside: whether every law has data there.
    """

    joint_angles: Array
    markers_m: Array
    by_input: Array
    tip_rotation: Array
    tip_spin: Array
    converged: bool
    inside: bool
