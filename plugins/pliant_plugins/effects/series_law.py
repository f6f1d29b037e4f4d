"""A joint law in series with a rotational spring.

    τ'(p, q) = τ(p, v),      v = q + C τ'

The spring of compliance C turns by q − v = −C τ', the joint by v. With the potential Π of the joint's law
it is Π'(p, q) = min over v of Π(p, v) + |q − v|² / (2 C), so that τ' = −∂Π'/∂q as for every law, and

    ∂τ'/∂q = (1 − C ∂τ/∂v)⁻¹ ∂τ/∂v,      ∂τ'/∂p = (1 − C ∂τ/∂v)⁻¹ ∂τ/∂p

For the three axes of a ball joint rotation vectors are added, which is exact for turns about one axis and has a
relative error of |v|²/12 for others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.mechanics.law_wrapper import LawWrapper
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBand
from pliant.records.law import Effort, JointLaw, LawRecord

MOST_STEPS = 40
# Newton ends when the deformation is known to this many rad.
PRECISION_RAD = 1e-13
LEAST_STEP = 1.0 / 64.0


@dataclass(frozen=True, eq=False)
class SeriesLaw(LawWrapper):
    """`law` behind a spring that turns by `compliance` rad per N·m about every axis; with `law`'s domain and error."""

    compliance: float

    @property
    def error(self) -> ErrorBand | None:  # type: ignore[override]
        return self.law.error

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """See `JointLaw.evaluate`."""
        p, q = np.asarray(actuation, float), np.asarray(deformation, float)
        _, effort = self._divided(p, q)
        stiffer = np.linalg.inv(np.eye(q.shape[1]) - self.compliance * effort.dtau_du)
        return Effort(
            effort.tau, np.einsum("nab,nb...->na...", stiffer, effort.dtau_dp), stiffer @ effort.dtau_du
        )

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """See `JointLaw.potential`: that of the joint and of the spring."""
        p, q = np.asarray(actuation, float), np.asarray(deformation, float)
        return self._stored(p, q) - self._stored(p, np.zeros_like(q))

    def band(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array | None:
        """See `JointLaw.band`: the inner law's at the joint's deformation, reduced by the spring."""
        p, q = np.asarray(actuation, float), np.asarray(deformation, float)
        v, effort = self._divided(p, q)
        inner = self.law.band(p, v, level)
        if inner is None:
            return None
        stiffer = np.linalg.inv(np.eye(q.shape[1]) - self.compliance * effort.dtau_du)
        wide: Array = np.einsum("nab,nb->na", np.abs(stiffer), inner)
        return wide

    def draws(self, count: int, seed: int) -> tuple[JointLaw, ...]:
        """See `JointLaw.draws`."""
        return tuple(SeriesLaw(law, self.compliance) for law in self.law.draws(count, seed))

    def unwrap(self) -> tuple[JointLaw, float, float]:
        """See `JointLaw.unwrap`."""
        law, stretch, give = self.law.unwrap()
        return law, stretch, give + stretch * self.compliance

    def record(self) -> LawRecord:
        """See `JointLaw.record`."""
        inner = self.law.record()
        values = {"compliance_rad_per_n_m": self.compliance, "inner": {"kind": inner.kind, **inner.values}}
        return LawRecord("series", values, inner.arrays)

    def _stored(self, p: Array, q: Array) -> Array:
        v, effort = self._divided(p, q)
        spring = 0.5 * self.compliance * np.einsum("na,na->n", effort.tau, effort.tau)
        return np.asarray(self.law.potential(p, v) + spring)

    def _divided(self, p: Array, q: Array) -> tuple[Array, Effort]:
        """Solve for the joint's deformation v (n, a) by damped Newton; return it and the inner law there."""
        identity = np.eye(q.shape[1])
        v, effort = q, self.law.evaluate(p, q)
        short = np.ones(len(q))
        missing = v - q - self.compliance * effort.tau
        size = np.abs(missing).max(axis=1)
        for _ in range(MOST_STEPS):
            slope = identity - self.compliance * effort.dtau_du
            step = np.linalg.solve(slope, missing[:, :, None])[:, :, 0] * short[:, None]
            if not np.abs(step).max(initial=0.0) > PRECISION_RAD:
                break
            ahead = v - step
            there = self.law.evaluate(p, ahead)
            left = ahead - q - self.compliance * there.tau
            now = np.abs(left).max(axis=1)
            better = (now < size) | (short <= LEAST_STEP)
            short = np.where(better, 1.0, short / 2)
            v = np.where(better[:, None], ahead, v)
            missing, size = np.where(better[:, None], left, missing), np.where(better, now, size)
            effort = _chosen(better, there, effort)
        return v, effort


def _chosen(which: Array, there: Effort, here: Effort) -> Effort:
    if which.all():
        return there
    row = which[:, None]
    return Effort(
        np.where(row, there.tau, here.tau),
        np.where(row, there.dtau_dp, here.dtau_dp),
        np.where(row[:, :, None], there.dtau_du, here.dtau_du),
    )
