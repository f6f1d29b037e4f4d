"""Efforts of all joints of a chain from its laws, actuators and law terms: τ(q) = Σ_k T_k law(p_k, T_kᵀ q).

T_k is an actuator's sign, and its rotation about the chain axis if it has one (`Actuator.turn`). A law of several
actuations takes all actuators of the joint at once: τ(q) = law(a, q).

Terms split that sum into its elastic part, the sum at p = 0, and its actuation part, the remainder: see `LawTerm`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.mechanics.terms import LawTerms, TermMemory
from pliant.records.chain import Actuator, ChainModel
from pliant.records.design import Array
from pliant.records.law import EXTENSION, JointLaw
from pliant.records.rollout import OutsideDomain

# Smaller excesses are rounding, not extrapolation.
DOMAIN_ROUNDING = 1e-9
# Quadrature of the work of law terms along a path.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)


@dataclass(frozen=True, eq=False)
class ChainEffort:
    """Effort tau (n, a), slopes dtau_dp (n, a) for each input's name and dtau_du (n, a, a)."""

    tau: Array
    dtau_dp: Mapping[str, Array]
    dtau_du: Array


def actuation_values(actuators: Sequence[Actuator], actuation: Mapping[str, float]) -> Array:
    """Return (actuators,) the value of each actuator's input.

    Raises:
        UserError: an input of the chain has no value.
    """
    missing = sorted({a.input for a in actuators} - set(actuation))
    if missing:
        given = ", ".join(sorted(actuation)) or "none"
        raise UserError(f"the chain is driven by {', '.join(missing)}, which has no value (given: {given})")
    return np.array([actuation[actuator.input] for actuator in actuators], float)


@dataclass(frozen=True, eq=False)
class _LawGroup:
    """Joints with the same law and actuators, `drives`; `whole`: the law takes all actuators at once."""

    law: JointLaw
    joints: NDArray[np.intp]
    drives: slice

    @property
    def whole(self) -> bool:
        return len(self.law.actuations) > 1


class JointEfforts:
    """Evaluator of a chain's laws; joints with the same law and actuators are evaluated by one vectorised call."""

    def __init__(self, chain: ChainModel) -> None:
        self.actuators = chain.actuators
        self.shape = (chain.n_joints, len(chain.axes))
        self._signs = np.array([actuator.sign for actuator in chain.actuators], float)
        self._turns = np.array([actuator.turn(len(chain.axes)) for actuator in chain.actuators], float)
        of_joint = [(joint.law, chain.actuator_range(joint)) for joint in chain.joints]
        self._groups = [
            _LawGroup(
                chain.laws[k],
                np.array([i for i, known in enumerate(of_joint) if known == (k, drives)]),
                slice(*drives),
            )
            for k, drives in sorted(set(of_joint))
        ]
        self._apart = any(joint.drives for joint in chain.joints)
        self.terms = LawTerms(chain.terms, self.shape)

    def values(self, actuation: Mapping[str, float]) -> Array:
        """Return (actuators,) the value of each actuator's input; see `actuation_values`."""
        return actuation_values(self.actuators, actuation)

    def evaluate(
        self, q: Array, actuation: Mapping[str, float], memory: TermMemory | None = None
    ) -> ChainEffort:
        """Return effort and slopes of all joints at coordinates q (n, a); without a memory the chain is rested."""
        values = self.values(actuation)
        whole = self._laws(q, values)
        if not self.terms.terms:
            return whole
        memory = memory or self.terms.rested()
        net = self._net(values)
        now, slope = self.terms.contribution(q, net, memory), self.terms.slopes(q, net, memory)
        none = np.zeros_like(values)
        straight, elastic = self._laws(q, none), self._laws(q - now.rest, none)
        actuated = whole.tau - straight.tau
        tau = now.elastic * elastic.tau + now.actuation * actuated + now.moment
        dtau_du = now.elastic[:, :, None] * elastic.dtau_du * (1.0 - slope.rest)[:, None, :]
        dtau_du += now.actuation[:, :, None] * (whole.dtau_du - straight.dtau_du)
        own = slope.elastic * elastic.tau + slope.actuation * actuated + slope.moment
        axes = np.arange(self.shape[1])
        dtau_du[:, axes, axes] += own
        by_input = {name: now.actuation * slope_p for name, slope_p in whole.dtau_dp.items()}
        return ChainEffort(tau, by_input, dtau_du)

    def advance(self, q: Array, actuation: Mapping[str, float], memory: TermMemory) -> TermMemory:
        """Return the memory of the law terms after a step that ends at q (n, a)."""
        return self.terms.advance(q, self._net(self.values(actuation)), memory)

    def potential(self, q: Array, actuation: Mapping[str, float], memory: TermMemory | None = None) -> float:
        """Return Σ Π(p, Tᵀ q) − Π(p, 0) over joints and actuators (Π(a, q) for several at once), in J.

        With law terms it is minus the work of τ along the straight path from 0 at fixed memory, by 12-point
        Gauss–Legendre: the potential of the next step.
        """
        if not self.terms.terms:
            values = self.values(actuation)
            return float(
                sum(
                    group.law.potential(*self._stack(group, q[group.joints], values)).sum()
                    for group in self._groups
                )
            )
        taus = self._efforts_at(
            0.5 * (NODES[:, None, None] + 1.0) * q, actuation, memory or self.terms.rested()
        )
        return -float(0.5 * np.einsum("s,sna,na->", WEIGHTS, taus, q))

    def _efforts_at(self, points: Array, actuation: Mapping[str, float], memory: TermMemory) -> Array:
        """Return τ (s, n, a) at several coordinates (s, n, a) with terms, without slopes; laws are called once."""
        values = self.values(actuation)
        net, none = self._net(values), np.zeros_like(values)
        now = [self.terms.contribution(q, net, memory) for q in points]
        rest, elastic, driven, moment = (
            np.array([getattr(one, name) for one in now])
            for name in ("rest", "elastic", "actuation", "moment")
        )
        driven *= self._taus(points, values) - self._taus(points, none)
        return np.asarray(elastic * self._taus(points - rest, none) + driven + moment)

    def _taus(self, points: Array, values: Array) -> Array:
        """Return (s, n, a) efforts of the laws without terms at several coordinates (s, n, a)."""
        tau = np.empty_like(points)
        for group in self._groups:
            rows = points[:, group.joints].reshape(-1, self.shape[1])
            own, turns = group.law.evaluate(*self._stack(group, rows, values)).tau, self._turns[group.drives]
            if not group.whole:
                own = np.einsum("kab,knb->na", turns, own.reshape(len(turns), *rows.shape))
            tau[:, group.joints] = own.reshape(len(points), -1, self.shape[1])
        return tau

    def travels(self, q: Array, values: Array) -> Array:
        """Return (s, actuators) travels ∫ ∂τ/∂p dq from straight joints to q (s, n, a), at values (s, actuators).

        A travel is the work conjugate of an actuation (a pressure's is a change of volume) without the part that
        depends on the actuation alone, which a law does not contain. Law terms are left out.
        """
        travels, shares = np.zeros(values.shape), 0.5 * (NODES + 1.0)
        for group in self._groups:
            m, drives = len(group.joints), range(group.drives.start, group.drives.stop)
            rows = q[:, group.joints].reshape(-1, self.shape[1])
            path = shares[:, None, None] * rows
            acting = np.repeat(values[:, group.drives], m, axis=0)
            if group.whole:
                slopes = group.law.evaluate(
                    np.tile(acting, (len(shares), 1)), path.reshape(-1, self.shape[1])
                ).dtau_dp.reshape(*path.shape, -1)
                work = 0.5 * np.einsum("g,grak,ra->rk", WEIGHTS, slopes, rows)
                travels[:, group.drives] += work.reshape(len(q), m, -1).sum(axis=1)
                continue
            for k, drive in enumerate(drives):
                turn = self._turns[drive]
                pressures, points = (
                    np.tile(acting[:, k], len(shares)),
                    (path @ turn).reshape(-1, self.shape[1]),
                )
                slopes = group.law.evaluate(pressures, points).dtau_dp.reshape(path.shape)
                work = 0.5 * np.einsum("g,gra,ra->r", WEIGHTS, slopes, rows @ turn)
                travels[:, drive] += work.reshape(len(q), m).sum(axis=1)
        return travels

    def _net(self, values: Array) -> Array:
        """Return (n,) the sum of the signed inputs on each joint, for law terms."""
        if not self._apart:
            return np.full(self.shape[0], float(self._signs @ values))
        net = np.empty(self.shape[0])
        for group in self._groups:
            net[group.joints] = self._signs[group.drives] @ values[group.drives]
        return net

    def _laws(self, q: Array, values: Array) -> ChainEffort:
        n, a = self.shape
        tau, dtau_du = np.zeros((n, a)), np.zeros((n, a, a))
        dtau_dp = {actuator.input: np.zeros((n, a)) for actuator in self.actuators}
        for group in self._groups:
            pressures, deformations = self._stack(group, q[group.joints], values)
            effort = group.law.evaluate(pressures, deformations)
            actuators = self.actuators[group.drives]
            if group.whole:
                tau[group.joints], dtau_du[group.joints] = effort.tau, effort.dtau_du
                for k, actuator in enumerate(actuators):
                    dtau_dp[actuator.input][group.joints] += effort.dtau_dp[:, :, k]
                continue
            turns = self._turns[group.drives]
            shape = (len(turns), len(group.joints), a)
            tau[group.joints] += np.einsum("kab,knb->na", turns, effort.tau.reshape(shape))
            slopes = effort.dtau_du.reshape(*shape, a)
            dtau_du[group.joints] += np.einsum("kab,knbc,kdc->nad", turns, slopes, turns)
            by_input = np.einsum("kab,knb->kna", turns, effort.dtau_dp.reshape(shape))
            for actuator, slope in zip(actuators, by_input, strict=True):
                dtau_dp[actuator.input][group.joints] += slope
        return ChainEffort(tau, dtau_dp, dtau_du)

    def outside_domain(
        self, q: Array, actuation: Mapping[str, float], time_s: float = 0.0
    ) -> tuple[OutsideDomain, ...]:
        """Return where laws are used outside the box of their data, or where their slope is not negative.

        `variable` is the input's name, `angle_rad` (`angle_x_rad`… on joints with several axes, `extension_m` of a
        translation) or `dtau_du`; `excess` is in the variable's unit and in the joint's own coordinates. If several
        actuators leave their box by the same variable of a joint, the one furthest outside is returned.
        """
        values = self.values(actuation)
        found: list[OutsideDomain] = []
        for group in self._groups:
            for variables, excess in self._excesses(group, q, values):
                for row, column in np.argwhere(np.abs(excess) > DOMAIN_ROUNDING):
                    module = int(group.joints[row]) + 1
                    found.append(OutsideDomain(module, time_s, variables[column], float(excess[row, column])))
        slopes = self.evaluate(q, actuation).dtau_du
        largest = np.linalg.eigvalsh(0.5 * (slopes + slopes.transpose(0, 2, 1)))[:, -1]
        found += [
            OutsideDomain(int(i) + 1, time_s, "dtau_du", float(largest[i]))
            for i in np.flatnonzero(largest >= 0.0)
        ]
        # The furthest is last and is kept.
        found.sort(key=lambda entry: (entry.module, entry.variable, abs(entry.excess)))
        return tuple({(entry.module, entry.variable): entry for entry in found}.values())

    def _excesses(self, group: _LawGroup, q: Array, values: Array) -> Iterator[tuple[tuple[str, ...], Array]]:
        """Yield for each actuator the variables' names and the law's distance from its box, (m, variables)."""
        names, joints = _deformation_names(group.law), q[group.joints]
        actuators = self.actuators[group.drives]
        if group.whole:
            inputs = tuple(actuator.input for actuator in actuators)
            yield (*inputs, *names), group.law.domain.excess(*self._stack(group, q[group.joints], values))
            return
        known = zip(actuators, values[group.drives], self._turns[group.drives], strict=True)
        for actuator, value, turn in known:
            excess = group.law.domain.excess(np.full(len(joints), value), joints @ turn)
            if not actuator.rotation_rad:  # otherwise about the actuator's own axes
                excess[:, 1:] *= np.diag(turn)
            yield (actuator.input, *names), excess

    def _stack(self, group: _LawGroup, joints: Array, values: Array) -> tuple[Array, Array]:
        """Return actuation and deformation of a group's joints (m, a) as arguments of its law.

        (k·m,) and (k·m, a) for k separate actuators; (m, k) and (m, a) for a law that takes them at once.
        """
        acting = values[group.drives]
        if group.whole:
            return np.tile(acting, (len(joints), 1)), joints
        return np.repeat(acting, len(joints)), (joints @ self._turns[group.drives]).reshape(-1, self.shape[1])


def _deformation_names(law: JointLaw) -> tuple[str, ...]:
    if law.joint == "prismatic":
        return ("extension_m",)
    if law.joint == "revolute":
        return ("angle_rad",)
    return tuple("extension_m" if axis == EXTENSION else f"angle_{axis}_rad" for axis in law.axes)
