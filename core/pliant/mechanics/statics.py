"""Statics of a chain in joint coordinates, derived from one total potential.

    Π(q) = Σ Π_joint(q) − Σ_k F_k · x_k(q) + M Σ_i q_i,main
    residual r = −∂Π/∂q = τ + Q,   stiffness H = ∂²Π/∂q²

F_k are the dead forces (body weights, payload, tip force) at points x_k. With ω_j the directions of joint j,
P_j its position, G_j = Σ_{k≥j} (x_k − P_j) × F_k and T_j = Σ_{k≥j} [(x_k − P_j) F_kᵀ − ((x_k − P_j)·F_k) I]:

    Q_j = ω_jᵀ G_j,   ∂²V/∂q_i∂q_j = −ω_iᵀ T_j ω_j  (i < j),

because the proximal joint rotates all distal bodies; the diagonal block also has −Gᵀ ∂ω_j/∂q_j. A translation along
t_j, which moves the distal bodies without rotation, has with f_j = Σ_{k≥j} F_k

    Q_j = t_jᵀ f_j,   ∂²V/∂q_i∂q_j = −ω_iᵀ (t_j × f_j) for a rotation i ≤ j,   0 for a translation i.

The opposing end moment M acts on every joint: its potential M Σ q is exactly that of a moment on the tip body for a
planar chain, and keeps other chains conservative.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from pliant.errors import UserError
from pliant.mechanics.efforts import JointEfforts
from pliant.mechanics.kinematics import ChainGeometry, Pose
from pliant.mechanics.rotations import left_jacobian_transpose_slope
from pliant.mechanics.terms import TermMemory
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Cord, Inputs, PointForce

# Smaller curvature, relative to the largest, is neutral within rounding, not unstable.
NEUTRAL_SHARE = 1e-10
# A cord of zero length has no direction.
SHORTEST_CORD_M = 1e-9


@dataclass(frozen=True, eq=False)
class Loads:
    """Actuation and loads of a chain at one instant; a straight path between two of them is a continuation.

    `memory` is that of the law terms; None is a rested chain. `forces` and `cords` act at points of bodies, in
    addition to the tip force.
    """

    actuation: Mapping[str, float]
    gravity_m_s2: Array
    tip_force_n: Array = field(default_factory=lambda: np.zeros(3))
    moment_n_m: float = 0.0
    memory: TermMemory | None = None
    forces: tuple[PointForce, ...] = ()
    cords: tuple[Cord, ...] = ()

    @staticmethod
    def from_inputs(chain: ChainModel, inputs: Inputs) -> Loads:
        """Return the chain's gravity with the inputs' actuation and loads.

        Raises:
            UserError: an end moment on a prismatic chain, or a number that is not finite.
        """
        given: dict[str, Any] = {
            **inputs.actuation,
            "tip_force_n": inputs.tip_force_n,
            "moment_n_m": inputs.moment_n_m,
        }
        loads: tuple[PointForce | Cord, ...] = (*inputs.forces, *inputs.cords)
        for number, load in enumerate(loads):
            if not 0 <= load.body <= chain.n_joints:
                raise UserError(
                    f"a load acts on body {load.body}; the chain has bodies 0 to {chain.n_joints}"
                )
            for part in dataclasses.fields(load)[1:]:
                given[f"{part.name} of load {number + 1}"] = getattr(load, part.name)
        for name, value in given.items():
            if not (math.isfinite(value) if isinstance(value, float) else np.isfinite(value).all()):
                raise UserError(f"{name} is {value}: an input needs a finite number")
        if inputs.moment_n_m and chain.laws[0].joint == "prismatic":
            raise UserError("a chain of prismatic joints takes no end moment: leave moment_n_m at 0")
        gravity = np.asarray(chain.gravity_m_s2, float)
        force = np.array(inputs.tip_force_n, float)
        return Loads(
            dict(inputs.actuation),
            gravity,
            force,
            float(inputs.moment_n_m),
            forces=inputs.forces,
            cords=inputs.cords,
        )

    @staticmethod
    def unactuated(chain: ChainModel) -> Loads:
        """Return the loads of the chain's gravity only."""
        nothing = {actuator.input: 0.0 for actuator in chain.actuators}
        return Loads(nothing, np.asarray(chain.gravity_m_s2, float))

    @staticmethod
    def none(chain: ChainModel) -> Loads:
        """Return zero actuation, gravity and load, for which the chain is straight."""
        return Loads({actuator.input: 0.0 for actuator in chain.actuators}, np.zeros(3))

    def between(self, other: Loads, fraction: float) -> Loads:
        """Return the loads at `fraction` of the straight path from these (0) to the others (1)."""
        keep, take = 1.0 - fraction, fraction
        names = {**self.actuation, **other.actuation}
        return Loads(
            {k: keep * self.actuation.get(k, 0.0) + take * other.actuation.get(k, 0.0) for k in names},
            keep * self.gravity_m_s2 + take * other.gravity_m_s2,
            keep * self.tip_force_n + take * other.tip_force_n,
            keep * self.moment_n_m + take * other.moment_n_m,
            other.memory,
            _shared(self.forces, other.forces, take),
            _shared(self.cords, other.cords, take),
        )

    def after(self, memory: TermMemory) -> Loads:
        """Return the same loads on a chain with this memory."""
        return replace(self, memory=memory)


PointLoad = TypeVar("PointLoad", PointForce, Cord)


def _shared(old: tuple[PointLoad, ...], new: tuple[PointLoad, ...], take: float) -> tuple[PointLoad, ...]:
    """Blend two sets of point loads: loads in both are kept, the others fade out and in."""
    kept = tuple(load for load in new if any(load is other for other in old))
    fading = tuple(load.scaled(1.0 - take) for load in old if not any(load is k for k in kept))
    coming = tuple(load.scaled(take) for load in new if not any(load is k for k in kept))
    return kept + fading + coming


@dataclass(frozen=True, eq=False)
class ActingForce:
    """A force in the world (3,) at a point of the world (3,) on a body, with its slope ∂F/∂x = −stiffness (3, 3)."""

    body: int
    point_m: Array
    force_n: Array
    stiffness: Array


@dataclass(frozen=True, eq=False)
class Balance:
    """Residual (n, a) in N·m (N on prismatic joints) and stiffness (n·a, n·a), the Hessian of Π."""

    residual: Array
    stiffness: Array


class ChainStatics:
    """Residual, stiffness and potential of one chain."""

    def __init__(self, chain: ChainModel) -> None:
        self.geometry = ChainGeometry.from_chain(chain)
        self.efforts = JointEfforts(chain)
        moving = chain.bodies[1:]
        self._mass = np.array([body.mass_kg for body in moving] + [chain.payload_kg], float)
        self._arm = np.array([body.com_m for body in moving] + [chain.tip_offset_m], float)
        n = self.geometry.n_joints
        self._body = np.minimum(np.arange(1, n + 2), n)

    def residual(self, q: Array, loads: Loads) -> Array:
        """Return (n, a) unbalanced effort of each joint coordinate."""
        pose = self.geometry.forward(q)
        moment, force, _ = self._beyond(pose, loads)
        return self.effort(q, loads) + self._generalised(pose, moment, force)

    def balance(self, q: Array, loads: Loads) -> Balance:
        """Return residual and its negative slope, analytic; symmetric if the laws derive from an energy."""
        pose = self.geometry.forward(q)
        moment, force, torsor = self._beyond(pose, loads)
        effort = self.efforts.evaluate(q, loads.actuation, loads.memory)
        residual = self._with_moment(effort.tau, loads) + self._generalised(pose, moment, force)
        n, a = q.shape
        stiffness = self._load_stiffness(q, pose, moment, force, torsor) + self._cord_stiffness(pose, loads)
        stiffness = stiffness.reshape(n, a, n, a)
        joints = np.arange(n)
        stiffness[joints, :, joints, :] -= effort.dtau_du
        return Balance(residual, stiffness.reshape(n * a, n * a))

    def load_stiffness(self, q: Array, loads: Loads) -> Array:
        """Return (n·a, n·a) Hessian of the potential of weights, payload and tip force."""
        pose = self.geometry.forward(q)
        moment, force, torsor = self._beyond(pose, loads)
        return self._load_stiffness(q, pose, moment, force, torsor) + self._cord_stiffness(pose, loads)

    def acting(self, pose: Pose, loads: Loads) -> list[ActingForce]:
        """Return the point forces and cords of the loads at their points, for engines that apply forces to bodies."""
        found = [
            ActingForce(f.body, _point(pose, f), np.asarray(f.force_n, float), np.zeros((3, 3)))
            for f in loads.forces
        ]
        for cord in loads.cords:
            point = _point(pose, cord)
            away = point - np.asarray(cord.pulley_m, float)
            distance = max(float(np.linalg.norm(away)), SHORTEST_CORD_M)
            away /= distance
            stiffness = cord.tension_n / distance * (np.eye(3) - np.outer(away, away))
            found.append(ActingForce(cord.body, point, -cord.tension_n * away, stiffness))
        return found

    def point_jacobian(self, pose: Pose, body: int, point_m: Array) -> Array:
        """Return (3, n, a) velocity of a world point of a body per rate of the joint coordinates."""
        jacobian = np.zeros((3, *pose.directions.shape[::2]))
        moving = pose.directions[:body]
        if not self.geometry.turns:
            jacobian[:, :body] = moving.transpose(1, 0, 2)
            return jacobian
        arms = point_m - pose.pivots[:body]
        jacobian[:, :body] = np.cross(moving, arms[:, :, None], axis=1).transpose(1, 0, 2)
        slide = self.geometry.slide
        if slide is not None:
            jacobian[:, :body, slide] = moving[:, :, slide].T
        return jacobian

    def effort(self, q: Array, loads: Loads) -> Array:
        """Return (n, a) efforts of the laws minus the end moment, which an engine applies at its joints."""
        return self._with_moment(self.efforts.evaluate(q, loads.actuation, loads.memory).tau, loads)

    def potential(self, q: Array, loads: Loads) -> float:
        """Return the total potential Π in J, up to a constant."""
        pose = self.geometry.forward(q)
        points = self._points(pose)
        work = float(np.einsum("ki,ki->", self._forces(loads), points))
        for force in loads.forces:
            work += float(force.force_n @ _point(pose, force))
        for cord in loads.cords:
            work -= cord.tension_n * float(np.linalg.norm(_point(pose, cord) - cord.pulley_m))
        opposed = loads.moment_n_m * float(q[:, self.geometry.main].sum())
        return self.efforts.potential(q, loads.actuation, loads.memory) - work + opposed

    def _with_moment(self, tau: Array, loads: Loads) -> Array:
        if loads.moment_n_m:
            tau = tau.copy()
            tau[:, self.geometry.main] -= loads.moment_n_m
        return tau

    def _forces(self, loads: Loads) -> Array:
        forces = self._mass[:, None] * loads.gravity_m_s2
        forces[-1] += loads.tip_force_n
        return forces

    def _points(self, pose: Pose) -> Array:
        arms = np.einsum("kij,kj->ki", pose.rotations[self._body], self._arm)
        return np.asarray(pose.origins[self._body] + arms)

    def _beyond(self, pose: Pose, loads: Loads) -> tuple[Array, Array, Array]:
        """Return (moment (n, 3), force (n, 3), Σ r Fᵀ (n, 3, 3)) about each joint of the forces distal to it."""
        forces, points = self._forces(loads), self._points(pose)
        products = points[:, :, None] * forces[:, None, :]
        for acting in self.acting(pose, loads):
            if acting.body:
                forces[acting.body - 1] += acting.force_n
                products[acting.body - 1] += np.outer(acting.point_m, acting.force_n)
        force = np.cumsum(forces[::-1], axis=0)[::-1][:-1]
        torsor = np.cumsum(products[::-1], axis=0)[::-1][:-1]
        torsor = torsor - pose.pivots[:, :, None] * force[:, None, :]
        moment = np.stack(
            [
                torsor[:, 1, 2] - torsor[:, 2, 1],
                torsor[:, 2, 0] - torsor[:, 0, 2],
                torsor[:, 0, 1] - torsor[:, 1, 0],
            ],
            axis=1,
        )
        return moment, force, torsor

    def _generalised(self, pose: Pose, moment: Array, force: Array) -> Array:
        acting = moment if self.geometry.turns else force
        effort = np.asarray(np.einsum("nia,ni->na", pose.directions, acting))
        slide = self.geometry.slide
        if slide is not None:
            effort[:, slide] = np.einsum("ni,ni->n", pose.directions[:, :, slide], force)
        return effort

    def _load_stiffness(self, q: Array, pose: Pose, moment: Array, force: Array, torsor: Array) -> Array:
        n, a = q.shape
        if not self.geometry.turns:
            return np.zeros((n, n))
        slide = self.geometry.slide
        trace = np.trace(torsor, axis1=1, axis2=2)
        turned = (torsor - trace[:, None, None] * np.eye(3)) @ pose.directions
        turning = pose.directions
        if slide is not None:
            turned[:, :, slide] = np.cross(pose.directions[:, :, slide], force)
            turning = turning.copy()
            turning[:, :, slide] = 0.0
        left = turning.transpose(1, 0, 2).reshape(3, n * a)
        blocks = -(left.T @ turned.transpose(1, 0, 2).reshape(3, n * a)).reshape(n, a, n, a)
        joints = np.arange(n)
        if self.geometry.kind != "revolute":
            blocks[joints, :, joints, :] -= self._own_slopes(q, pose, moment)
        upper = joints[:, None] < joints[None, :]
        blocks = np.where(upper[:, None, :, None], blocks, blocks.transpose(2, 3, 0, 1))
        diagonal = blocks[joints, :, joints, :]
        if slide is not None:
            diagonal[:, :, slide] = diagonal[:, slide]  # the block is transposed here
        blocks[joints, :, joints, :] = 0.5 * (diagonal + diagonal.transpose(0, 2, 1))
        return blocks.reshape(n * a, n * a)

    def _cord_stiffness(self, pose: Pose, loads: Loads) -> Array:
        n, _, a = pose.directions.shape
        total = np.zeros((n * a, n * a))
        for acting in self.acting(pose, loads) if loads.cords else []:
            jacobian = self.point_jacobian(pose, acting.body, acting.point_m).reshape(3, n * a)
            total += jacobian.T @ acting.stiffness @ jacobian
        return total

    def _own_slopes(self, q: Array, pose: Pose, moment: Array) -> Array:
        """Return (n, a, a) Gᵀ ∂ω/∂q of each joint's own coordinates; a hinge has none."""
        basis = self.geometry.basis
        seen = np.einsum("nij,ni->nj", pose.rest_frames, moment)
        slope = left_jacobian_transpose_slope(self.geometry.rotation_vectors(q), seen)
        return np.asarray(basis.T @ slope @ basis)


def _point(pose: Pose, load: PointForce | Cord) -> Array:
    """Return (3,) the point of a load in the world."""
    point: Array = pose.origins[load.body] + pose.rotations[load.body] @ np.asarray(load.point_m, float)
    return point


def unstable_mode(stiffness: Array) -> Array | None:
    """Return (n·a,) the most negative mode of a stiffness; None in a stable state, within rounding."""
    symmetric = 0.5 * (stiffness + stiffness.T)
    try:
        np.linalg.cholesky(symmetric)
        return None
    except np.linalg.LinAlgError:
        values, modes = np.linalg.eigh(symmetric)
    if values[0] >= -NEUTRAL_SHARE * np.abs(values).max():
        return None
    return np.asarray(modes[:, 0])
