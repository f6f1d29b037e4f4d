"""The laws of the tests' chains with a scalar form, and chains made of them."""

from __future__ import annotations

import numpy as np
from tests.physics.conftest import SpatialLaw, StretchLaw, StudyLaw

from pliant.records.design import Array
from pliant.records.law import ScalarLaw


def study(p: float, u: Array, c: Array, tau: Array, dtau_dp: Array, dtau_du: Array) -> None:
    slope = c[1] * p + c[2]
    tau[0] = c[0] * p + slope * u[0] - (c[3] * u[0] * abs(u[0]) / 2 + c[4] * u[0])
    dtau_dp[0] = c[0] + c[1] * u[0]
    dtau_du[0, 0] = slope - c[3] * abs(u[0]) - c[4]


def spatial(p: float, u: Array, c: Array, tau: Array, dtau_dp: Array, dtau_du: Array) -> None:
    square = _square(u)
    for a in range(3):
        tau[a] = p * c[a] - c[12] * square * u[a]
        dtau_dp[a] = c[a]
        for b in range(3):
            tau[a] -= c[3 + 3 * a + b] * u[b]
            dtau_du[a, b] = -c[3 + 3 * a + b] - 2 * c[12] * u[a] * u[b]
        dtau_du[a, a] -= c[12] * square


def _square(u: Array) -> float:
    return float(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])


def stretch(p: float, u: Array, c: Array, tau: Array, dtau_dp: Array, dtau_du: Array) -> None:
    tau[0] = c[0] * p - c[1] * u[0] - c[2] * u[0] ** 3
    dtau_dp[0] = c[0]
    dtau_du[0, 0] = -c[1] - 3 * c[2] * u[0] ** 2


class ScalarStudy(StudyLaw):
    def scalar(self) -> ScalarLaw:
        return ScalarLaw(study, np.array([self.k_n, self.m_a, self.b_a, self.m_e, self.b_e]))


class ScalarSpatial(SpatialLaw):
    def scalar(self) -> ScalarLaw:
        return ScalarLaw(spatial, np.concatenate([self.gain, self.stiffness.ravel(), [self.cubic]]))


class ScalarStretch(StretchLaw):
    def scalar(self) -> ScalarLaw:
        return ScalarLaw(stretch, np.array([1e-4, 200.0, 1e5]))


SCALAR = {"revolute": ScalarStudy, "spherical": ScalarSpatial, "prismatic": ScalarStretch}
