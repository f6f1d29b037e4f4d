"""Newton's method on a potential, globalised so that it ends in a minimum and not in a saddle.

Where the stiffness is positive definite the step is Newton's; elsewhere its eigenvalues are replaced by their
absolute values (Dauphin et al. 2014), so every step descends. A backtracking line search on the potential
takes over when the full step does not halve the residual.

How an equilibrium moves with inputs, loads and law parameters follows by the implicit function theorem: R(q; θ) = 0
with K = −∂R/∂q gives K ∂q/∂θ = ∂R/∂θ; markers move by their Jacobians.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import linalg

from pliant.errors import UserError
from pliant.mechanics.efforts import JointEfforts
from pliant.mechanics.kinematics import Pose
from pliant.mechanics.statics import Balance, ChainStatics, Loads, unstable_mode
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.law import Effort, JointLaw, LawRecord, ScalarLaw
from pliant.records.rollout import Inputs, Response, Sensitivity

SUFFICIENT_DECREASE = 1e-4
MAX_HALVINGS = 30
# An equilibrium that is a saddle is left along its most negative mode by this share of the longest step.
PUSH = 0.2
# Half-width of central differences, relative to the parameter or input.
STEP = 1e-5


class NewtonOptions(NamedTuple):
    """Tolerance on the largest residual, maximum number of iterations, longest move of a coordinate in one step.

    Travels of extensible joints are measured in module lengths (`ChainGeometry.relative_reach`).
    """

    tolerance: float
    max_iterations: int
    max_step: float


@dataclass(frozen=True, eq=False)
class ChainSolution:
    """The end of an iteration: q (n, a), its largest residual, and the type of that point.

    `markers` (n + 2, 3) and `inside`, no law outside its domain, are set if they are available at no cost.
    """

    q: Array
    residual: float
    converged: bool
    stable: bool
    iterations: int
    markers: Array | None = None
    inside: bool = False


# The stable equilibrium of one chain under any loads, reached from coordinates q (n, a).
Solver = Callable[[Array, Loads], ChainSolution]
# The same under inputs, from q, with its slopes by the actuations.
Responder = Callable[[Inputs, Array], Response]


def minimise(statics: ChainStatics, loads: Loads, q: Array, options: NewtonOptions) -> ChainSolution:
    """Descend from q (n, a) to a stable equilibrium; `converged` is False if none is reached."""
    balance, reach = statics.balance(q, loads), statics.geometry.relative_reach
    for iteration in range(options.max_iterations):
        size = _size(balance)
        if not np.isfinite(size):
            return ChainSolution(q, size, False, False, iteration)
        positive = _is_positive(balance.stiffness)
        if size <= options.tolerance:
            mode = None if positive else unstable_mode(balance.stiffness)
            if mode is None:
                return ChainSolution(q, size, True, True, iteration)
            q = _leave_saddle(statics, loads, q, mode.reshape(q.shape), PUSH * options.max_step)
            balance = statics.balance(q, loads)
            continue
        step = _step(balance, positive).reshape(q.shape)
        longest = float(np.abs(step / reach).max())
        if longest > options.max_step:
            step *= options.max_step / longest
        moved = _search(statics, loads, q, balance, step, positive)
        if moved is None:
            return ChainSolution(q, size, False, positive, iteration + 1)
        q, balance = moved
    size = _size(balance)
    stable = unstable_mode(balance.stiffness) is None
    return ChainSolution(q, size, size <= options.tolerance and stable, stable, options.max_iterations)


def _size(balance: Balance) -> float:
    return float(np.abs(balance.residual).max())


def _is_positive(stiffness: Array) -> bool:
    try:
        np.linalg.cholesky(0.5 * (stiffness + stiffness.T))
    except np.linalg.LinAlgError:
        return False
    return True


def _step(balance: Balance, positive: bool) -> Array:
    right = balance.residual.ravel()
    if positive:
        # The full stiffness, not its symmetric part: convergence stays quadratic for laws fitted without an energy.
        return np.asarray(np.linalg.solve(balance.stiffness, right), float)
    values, modes = np.linalg.eigh(0.5 * (balance.stiffness + balance.stiffness.T))
    floor = 1e-8 * float(np.abs(values).max()) + np.finfo(float).tiny
    return np.asarray(modes @ ((modes.T @ right) / np.maximum(np.abs(values), floor)), float)


def _search(
    statics: ChainStatics, loads: Loads, q: Array, balance: Balance, step: Array, positive: bool
) -> tuple[Array, Balance] | None:
    """Return the accepted point and its balance, or None when no step along the direction helps."""
    trial = statics.balance(q + step, loads)
    norm = np.linalg.norm(balance.residual)
    if positive and np.linalg.norm(trial.residual) <= 0.5 * norm:
        return q + step, trial
    slope = float(np.sum(balance.residual * step))
    start = statics.potential(q, loads)
    rounding = 1e-14 * max(abs(start), 1e-12)
    share = 1.0
    for _ in range(MAX_HALVINGS):
        drop = start - statics.potential(q + share * step, loads)
        if drop >= SUFFICIENT_DECREASE * share * slope - rounding:
            return q + share * step, trial if share == 1.0 else statics.balance(q + share * step, loads)
        share *= 0.5
    if np.linalg.norm(trial.residual) < norm:
        return q + step, trial
    return None


def _leave_saddle(statics: ChainStatics, loads: Loads, q: Array, mode: Array, length: float) -> Array:
    """Return q moved along an unstable mode by `length`, to the side of lower potential."""
    push = mode * (length / np.abs(mode / statics.geometry.relative_reach).max())
    up, down = q + push, q - push
    return up if statics.potential(up, loads) <= statics.potential(down, loads) else down


def sensitivity(chain: ChainModel, statics: ChainStatics, q: Array, loads: Loads) -> Sensitivity:
    """Return derivatives of the equilibrium q (n, a) under these loads.

    Laws without a scalar form have no entry; prismatic chains have none for the end moment. The memory of law terms is
    that before the step to q.

    Raises:
        UserError: the stiffness is singular at q.
    """
    slopes = _load_slopes(chain, statics, statics.geometry.forward(q), loads)
    slopes |= _actuation_slopes(chain, statics, q, loads)
    slopes |= _law_slopes(chain, q, loads)
    return Sensitivity(*_moved(chain, statics, q, loads, slopes))


def by_actuation(
    chain: ChainModel, statics: ChainStatics, q: Array, loads: Loads
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return the part of `sensitivity` for the inputs: change of coordinates (n, a) and of markers (n + 2, 3) by input.

    Raises:
        UserError: the stiffness is singular at q.
    """
    return _moved(chain, statics, q, loads, _actuation_slopes(chain, statics, q, loads))


def _moved(
    chain: ChainModel, statics: ChainStatics, q: Array, loads: Loads, slopes: dict[str, Array]
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Change of the coordinates (n, a, …) and of the markers (n + 2, 3, …) by slopes of the residual (n, a, …)."""
    pose = statics.geometry.forward(q)
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
    return angles, markers


def _solve(stiffness: Array, right: Array) -> Array:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", linalg.LinAlgWarning)
            return np.asarray(linalg.solve(stiffness, right), float)
    except (linalg.LinAlgError, linalg.LinAlgWarning) as error:
        raise UserError(
            "the chain has settled where its stiffness is singular (it is about to buckle or a joint is free), so its "
            "answer has no derivatives; change the load a little"
        ) from error


def _load_slopes(chain: ChainModel, statics: ChainStatics, pose: Pose, loads: Loads) -> dict[str, Array]:
    """Return ∂R/∂ of tip force, payload, gravity and end moment, each (n, a, …)."""
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
    """Return ∂τ/∂p (n, a) of each input; by central differences if law terms depend on it."""
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
    """Return ∂τ/∂c (n, a, parameters) of each law with a scalar form, by central differences."""

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
            up, down = (tau(k, replace(scalar, parameters=values + h)) for h in (nudge, -nudge))
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
        effort = self._form(actuation, deformation)
        less = self._scalar.less_rest
        if less:
            rest = self._form(np.zeros(len(deformation)), deformation)
            effort = Effort(
                effort.tau - less * rest.tau, effort.dtau_dp, effort.dtau_du - less * rest.dtau_du
            )
        return effort

    def _form(self, actuation: Array, deformation: Array) -> Effort:
        """Evaluate the scalar function."""
        # numba takes a second
        from pliant_plugins.physics.compiled.efforts import evaluate_law, evaluate_wide_law
        from pliant_plugins.physics.compiled.laws import law_address

        m, a = deformation.shape
        k = len(self.actuations)
        by_p = np.empty((m, a) if k == 1 else (m, a, k))
        effort = Effort(np.empty((m, a)), by_p, np.empty((m, a, a)))
        states = np.array(actuation, float, order="C"), np.array(deformation, float, order="C")
        address, parameters = law_address(self._scalar.function, k), self._scalar.parameters
        evaluate = evaluate_law if k == 1 else evaluate_wide_law
        evaluate(address, parameters, *states, effort.tau, effort.dtau_dp, effort.dtau_du)
        return effort

    def record(self) -> LawRecord:
        return self._law.record()
