"""How an equilibrium moves with inputs, loads and law parameters, by the implicit function theorem.

R(q; θ) = 0 with K = −∂R/∂q gives K ∂q/∂θ = ∂R/∂θ; markers move by their Jacobians.
"""

from __future__ import annotations

import warnings

import numpy as np
from scipy.linalg import LinAlgError, LinAlgWarning, solve

from pliant.errors import UserError
from pliant.mechanics.efforts import JointEfforts
from pliant.mechanics.kinematics import Pose
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.law import Effort, JointLaw, LawRecord, ScalarLaw
from pliant.records.rollout import Sensitivity
from pliant_plugins.physics.compiled.efforts import evaluate_law
from pliant_plugins.physics.compiled.laws import law_address

# Half-width of central differences, relative to the parameter or input.
STEP = 1e-5


def sensitivity(chain: ChainModel, statics: ChainStatics, q: Array, loads: Loads) -> Sensitivity:
    """Derivatives of the equilibrium q (n, a) under these loads.

    Laws without a scalar form have no entry; prismatic chains have none for the end moment. What law terms
    remember is held as it was before the step to q.

    Raises:
        UserError: the stiffness is singular at q.
    """
    pose = statics.geometry.forward(q)
    slopes = _load_slopes(chain, statics, pose, loads)
    slopes |= _actuation_slopes(chain, statics, q, loads)
    slopes |= _law_slopes(chain, q, loads)
    columns = [slope.reshape(q.size, -1) for slope in slopes.values()]
    moved = _solve(statics.balance(q, loads).stiffness, np.concatenate(columns, axis=1))
    pieces = np.split(moved, np.cumsum([column.shape[1] for column in columns])[:-1], axis=1)
    angles = {
        name: piece.reshape(slope.shape) for (name, slope), piece in zip(slopes.items(), pieces, strict=True)
    }
    # (n + 2, 3, n, a) velocity of base, joints and tip per rate of the coordinates.
    points, last = statics.geometry.markers(q), chain.n_joints
    jacobian = np.stack([statics.point_jacobian(pose, min(k, last), x) for k, x in enumerate(points)])
    markers = {name: np.einsum("kcna,na...->kc...", jacobian, angle) for name, angle in angles.items()}
    return Sensitivity(angles, markers)


def _solve(stiffness: Array, right: Array) -> Array:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", LinAlgWarning)
            return np.asarray(solve(stiffness, right), float)
    except (LinAlgError, LinAlgWarning) as error:
        raise UserError(
            "the chain has settled where its stiffness is singular (it is about to buckle or a joint is free), so its "
            "answer has no derivatives; change the load a little"
        ) from error


def _load_slopes(chain: ChainModel, statics: ChainStatics, pose: Pose, loads: Loads) -> dict[str, Array]:
    """∂R/∂ of tip force, payload, gravity and end moment, each (n, a, …)."""
    last = chain.n_joints
    tip = pose.origins[-1] + pose.rotations[-1] @ np.asarray(chain.tip_offset_m, float)
    at_tip = statics.point_jacobian(pose, last, tip).transpose(1, 2, 0)
    by_gravity = chain.payload_kg * at_tip
    for k, body in enumerate(chain.bodies):
        centre = pose.origins[k] + pose.rotations[k] @ np.asarray(body.com_m, float)
        by_gravity = by_gravity + body.mass_kg * statics.point_jacobian(pose, k, centre).transpose(1, 2, 0)
    slopes = {
        "tip_force_n": at_tip,
        "payload_kg": at_tip @ loads.gravity_m_s2,
        "gravity_m_s2": by_gravity,
    }
    if statics.geometry.kind != "prismatic":
        opposed = np.zeros(at_tip.shape[:2])
        opposed[:, statics.geometry.main] = -1.0
        slopes["moment_n_m"] = opposed
    return slopes


def _actuation_slopes(chain: ChainModel, statics: ChainStatics, q: Array, loads: Loads) -> dict[str, Array]:
    """∂τ/∂p (n, a) of each input; law terms may depend on it too, then by central differences."""
    if not chain.terms:
        return dict(statics.efforts.evaluate(q, loads.actuation, loads.memory).dtau_dp)
    slopes = {}
    for name in dict.fromkeys(actuator.input for actuator in chain.actuators):
        value = loads.actuation[name]
        step = STEP * max(abs(value), 1.0)
        up, down = (
            statics.efforts.evaluate(q, {**loads.actuation, name: value + h}, loads.memory).tau
            for h in (step, -step)
        )
        slopes[name] = (up - down) / (2 * step)
    return slopes


def _law_slopes(chain: ChainModel, q: Array, loads: Loads) -> dict[str, Array]:
    """∂τ/∂c (n, a, parameters) of each law with a scalar form, by central differences."""

    def tau(k: int, scalar: ScalarLaw) -> Array:
        laws = (*chain.laws[:k], _ScalarForm(chain.laws[k], scalar), *chain.laws[k + 1 :])
        return JointEfforts(chain.with_(laws=laws)).evaluate(q, loads.actuation, loads.memory).tau

    slopes = {}
    for k, law in enumerate(chain.laws):
        scalar = law.scalar()
        if scalar is None:
            continue
        values = np.asarray(scalar.parameters, float)
        columns = []
        for nudge in np.diag(STEP * np.where(values == 0.0, 1.0, np.abs(values))):
            up, down = (tau(k, ScalarLaw(scalar.function, values + h)) for h in (nudge, -nudge))
            columns.append((up - down) / (2 * nudge.max()))
        slopes[f"law_{k}"] = np.stack(columns, axis=2)
    return slopes


class _ScalarForm(JointLaw):
    """A law evaluated by its compiled scalar form, with parameters of one's own."""

    def __init__(self, law: JointLaw, scalar: ScalarLaw) -> None:
        self.joint, self.axes, self.domain = law.joint, law.axes, law.domain
        self.actuation_name = law.actuation_name
        self._law, self._scalar = law, scalar

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        m, a = deformation.shape
        effort = Effort(np.empty((m, a)), np.empty((m, a)), np.empty((m, a, a)))
        states = np.array(actuation, float), np.array(deformation, float, order="C")
        address, parameters = law_address(self._scalar.function), self._scalar.parameters
        evaluate_law(address, parameters, *states, effort.tau, effort.dtau_dp, effort.dtau_du)
        return effort

    def record(self) -> LawRecord:
        return self._law.record()
