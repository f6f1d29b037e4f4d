"""A spatial chain with an energy-consistent cubic law, different in every joint and body."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.mechanics.rotations import exp_map
from pliant.records.chain import ChainModel, Joint
from pliant.records.design import Array, MassProperties
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord

AXES: dict[JointKind, tuple[str, ...]] = {
    "revolute": ("y",),
    "prismatic": ("x",),
    "spherical": ("x", "y", "z"),
    "extensible": ("x", "y", "z", "e"),
}


class CubicLaw(JointLaw):
    """τ = p g − K u − c (u·u) u: derives from ½ uᵀKu + c (u·u)²/4 − p g·u with K full and symmetric."""

    actuation_name = "pressure_pa"

    def __init__(self, joint: JointKind, domain: Domain | None = None) -> None:
        self.joint, self.axes = joint, AXES[joint]
        n = len(self.axes)
        self.gain = np.array([0.2, 1.0, -0.3, 0.4])[:n] * 1e-6
        self.stiffness = np.diag([0.02, 0.05, 0.03, 0.04])[:n, :n] + 0.004
        self.cubic = 0.02
        self.domain = domain or Domain.unbounded(n)

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        u = deformation
        square = np.einsum("na,na->n", u, u)[:, None]
        tau = actuation[:, None] * self.gain - u @ self.stiffness - self.cubic * square * u
        slope = self.stiffness + self.cubic * (
            square[:, :, None] * np.eye(u.shape[1]) + 2 * u[:, :, None] * u[:, None, :]
        )
        return Effort(tau, np.tile(self.gain, (len(u), 1)), -slope)

    def record(self) -> LawRecord:
        return LawRecord("cubic", {}, {})


def random_chain(joint: JointKind, n_joints: int = 5, seed: int = 0) -> ChainModel:
    """Return joints turned and offset in all directions, and bodies with their centre of mass anywhere."""
    random = np.random.default_rng(seed)

    def rotation() -> Array:
        return exp_map(random.normal(size=3))

    def body() -> MassProperties:
        principal = random.uniform(1.0, 1.9, 3) * 1e-7
        turn = rotation()
        return MassProperties(
            random.uniform(1e-3, 5e-3), random.normal(size=3) * 5e-3, turn @ np.diag(principal) @ turn.T
        )

    return ChainModel(
        joints=tuple(Joint(i % 2, random.normal(size=3) * 0.01, rotation()) for i in range(n_joints)),
        bodies=tuple(body() for _ in range(n_joints + 1)),
        laws=(CubicLaw(joint), CubicLaw(joint)),
        tip_offset_m=random.normal(size=3) * 0.01,
        base_position_m=random.normal(size=3),
        base_rotation=rotation(),
        payload_kg=0.013,
    )


@pytest.fixture(params=["revolute", "spherical", "prismatic", "extensible"])
def chain(request: pytest.FixtureRequest) -> ChainModel:
    return random_chain(request.param)


@pytest.fixture
def extensible_chain() -> ChainModel:
    return random_chain("extensible")


@pytest.fixture
def spherical_chain() -> ChainModel:
    return random_chain("spherical")
