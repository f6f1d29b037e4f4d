"""Least squares over a candidate's equilibria: design and joint coordinates move together.

Near a fold or a bifurcation a chain answers a tiny change of the design by a large one of its shape: ∂q/∂θ = K⁻¹ ∂R/∂θ
grows without bound, and steps in θ alone are lost in a valley as narrow as it is curved. The set R(q; θ) = 0 itself
stays smooth there. Steps are therefore taken in it: along an orthonormal basis Z of the null space of [K, −∂R/∂θ], with

    min |r + J Z s|² + λ |s|²,   J Z = ∂r/∂θ Z_θ + ∂r/∂q Z_q

(Levenberg–Marquardt on a manifold: Absil, Mahony, Sepulchre 2008, ch. 8), then back onto it by the shortest
corrections.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from pliant.records.design import Array
from pliant_search.optimizer import Value
from pliant_search.polish.followed import FollowedSimulation
from pliant_search.polish.slopes import Recorded, SlopeEvaluator

LONGEST = 0.3  # step, of the ranges and in rad
CORRECTIONS = 8
ON_IT = 1e-9  # rad: residual over the stiffness of an equilibrium
AT_BOUND = 1e-7  # of a range
STEP_RAD = 1e-7  # along the joint coordinates: one-sided differences of the residuals


@dataclass(frozen=True, eq=False)
class Place:
    """A point of the set: shares x (k,), joint coordinates q (n,) in rad or its equivalent, residuals (r,).

    q has all levels of the task.
    """

    x: Array
    q: Array
    residuals: Array

    @property
    def cost(self) -> float:
        """The sum of squares."""
        return float(self.residuals @ self.residuals)


@dataclass(frozen=True, eq=False)
class Step:
    """A step within the ranges: dx (k,), dq (n,), the gain that it promises, the variables that are not held (k,)."""

    dx: Array
    dq: Array
    gain: float
    free: NDArray[np.bool_]


class Equilibria:
    """The equilibria near a recorded candidate of one condition, to first order."""

    def __init__(self, evaluator: SlopeEvaluator, at: Recorded) -> None:
        self._evaluator, self._values, (self._run,) = evaluator, at.trial.values, at.runs
        assert at.outcome is not None and at.outcome.residuals is not None
        self._reach, self._count = self._run.reach(), len(at.outcome.residuals)
        q = np.concatenate([one.ravel() for one in self._run.q]) / self._reach
        self.place = Place(evaluator.shares(self._values), q, at.outcome.residuals)
        here = self._row(self._values, q)
        assert here is not None
        table = evaluator.differences(self._values, here, lambda values: self._row(values, q))
        self._by_design = table[: self._count]
        stiffness = linalg.block_diag(*self._run.stiffnesses()) * self._reach
        self._scale = float(np.abs(np.diag(stiffness)).max())
        self._jacobian = np.hstack([stiffness, -table[self._count :]]) / self._scale
        self._tangents: dict[bytes, tuple[Array, Array]] = {}  # by the free variables

    def step(self, damping: float) -> Step:
        """Return the step of a damping, relative to the curvature of the residuals."""
        x, free = self.place.x, np.ones(len(self.place.x), bool)
        while True:
            dq, dx, moved = self._free_step(free, damping)
            outward = free & (((x <= AT_BOUND) & (dx < 0)) | ((x >= 1 - AT_BOUND) & (dx > 0)))
            if not outward.any():
                break
            free = free & ~outward
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(dx > 0, (1.0 - x) / dx, np.where(dx < 0, -x / dx, np.inf))
        longest = max(np.abs(dx).max(), np.abs(dq).max(), 1e-300)
        share = float(min(1.0, LONGEST / longest, np.min(room)))
        there = self.place.residuals + share * moved
        return Step(share * dx, share * dq, self.place.cost - float(there @ there), free)

    def landed(self, step: Step) -> Place | None:
        """Return the equilibrium after a step, by the shortest corrections; None where they find none."""
        q, x = self.place.q + step.dq, np.clip(self.place.x + step.dx, 0.0, 1.0)
        columns = np.concatenate([np.ones(len(q), bool), step.free])
        back, before = np.linalg.pinv(self._jacobian[:, columns]), np.inf
        for _ in range(CORRECTIONS):
            row = self._row(self._evaluator.with_shares(self._values, x), q)
            if row is None or not np.isfinite(row).all():
                return None
            off = row[self._count :] / self._scale
            size = float(np.abs(off).max())
            if size < ON_IT:
                return Place(x, q, row[: self._count])
            if size > before:
                return None
            before, moved = size, np.zeros(len(columns))
            moved[columns] = back @ off
            q, x = q + moved[: len(q)], np.clip(x + moved[len(q) :], 0.0, 1.0)
        return None

    def _free_step(self, free: NDArray[np.bool_], damping: float) -> tuple[Array, Array, Array]:
        """Return dq (n,), dx (k,) and the change of the residuals (r,), with some variables held."""
        n, k = len(self._reach), len(free)
        if not free.any():
            return np.zeros(n), np.zeros(k), np.zeros(self._count)
        basis, slopes = self._tangent(free)
        normal = slopes.T @ slopes
        damped = normal + damping * float(np.trace(normal)) * np.eye(len(normal))
        s = -np.linalg.solve(damped, slopes.T @ self.place.residuals)
        return basis[:n] @ s, basis[n:] @ s, slopes @ s

    def _tangent(self, free: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Return the basis Z (n + k, m) of the set, some variables held, and the slopes J Z (r, m)."""
        key, n = free.tobytes(), len(self._reach)
        if key not in self._tangents:
            columns = np.concatenate([np.ones(n, bool), free])
            orthogonal = np.linalg.qr(self._jacobian[:, columns].T, mode="complete")[0]
            basis = np.zeros((len(columns), int(free.sum())))
            basis[columns] = orthogonal[:, n:]
            self._tangents[key] = basis, self._by_design @ basis[n:] + self._along(basis[:n])
        return self._tangents[key]

    def _along(self, directions: Array) -> Array:
        """Return (r, m) slopes of the residuals along directions (n, m) of the joint coordinates."""
        here = self._shape(self.place.q)
        there = [self._shape(self.place.q + STEP_RAD * one) for one in directions.T]
        return np.stack([(one - here) / STEP_RAD for one in there], axis=1)

    def _shape(self, q: Array) -> Array:
        """Return the residuals (r,) of the recorded chain at joint coordinates (n,)."""
        run = self._run
        assert run.task is not None and run.chain is not None
        shown = FollowedSimulation(
            run.chain, run.at(self._levels(q)), lambda level, _: self._levels(q)[level]
        )
        return self._evaluator.scaled(run.task.residuals(run.chain, run.task.run(shown)))

    def _levels(self, q: Array) -> list[Array]:
        return list((q * self._reach).reshape(-1, *self._run.q[0].shape))

    def _row(self, values: Mapping[str, Value], q: Array) -> Array | None:
        """Return residuals of the shape and of the equilibria (r + n,) of a candidate at joint coordinates."""
        levels, unbalanced = self._levels(q), list[Array]()

        def placed(condition: int, level: int, residual: Array) -> Array:
            unbalanced.append(residual.ravel())
            return levels[level]

        found = self._evaluator.shown(values, [self._run.at(levels)], placed)
        if found is None or found.residuals is None:
            return None
        return np.concatenate([found.residuals, *unbalanced])
