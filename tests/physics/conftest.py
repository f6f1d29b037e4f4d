"""Engines, laws and chains with known answers."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable

import numpy as np
import pytest

from pliant.interfaces.physics import PhysicsBackend
from pliant.mechanics.rotations import exp_map
from pliant.records.chain import ChainModel, Joint, default_base_rotation
from pliant.records.design import Array, MassProperties
from pliant.records.law import Domain, Effort, JointLaw, LawRecord
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.pybullet.backend import Pybullet
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig

MODULE_LENGTH_M = 0.011

needs_pybullet = pytest.mark.skipif(
    importlib.util.find_spec("pybullet") is None,
    reason="pybullet is not installed (it has wheels for Python up to 3.11 only)",
)


class StudyLaw(JointLaw):
    """τ = k_n p + (m_a p + b_a) u − (m_e u|u|/2 + b_e u), the odd form of docs/conventions.md."""

    joint = "revolute"
    axes = ("y",)
    actuation_name = "pressure_pa"

    def __init__(
        self,
        k_n: float = 1.637e-6,
        m_a: float = -1.704e-6,
        b_a: float = 0.0,
        m_e: float = 0.1012,
        b_e: float = 0.0245,
        domain: Domain | None = None,
    ) -> None:
        self.k_n, self.m_a, self.b_a, self.m_e, self.b_e = k_n, m_a, b_a, m_e, b_e
        self.domain = domain or Domain.unbounded(1)

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        p, u = actuation[:, None], deformation
        slope = self.m_a * p + self.b_a
        tau = self.k_n * p + slope * u - (self.m_e * u * np.abs(u) / 2 + self.b_e * u)
        return Effort(tau, self.k_n + self.m_a * u, (slope - self.m_e * np.abs(u) - self.b_e)[:, :, None])

    def record(self) -> LawRecord:
        return LawRecord("study", {}, {})


class SpatialLaw(JointLaw):
    """τ = p g − K u − c (u·u) u with a full symmetric K: pressure bends and twists."""

    joint = "spherical"
    axes = ("x", "y", "z")
    actuation_name = "pressure_pa"
    domain = Domain.unbounded(3)
    gain = np.array([0.2, 1.0, -0.3]) * 1e-6
    stiffness = np.diag([0.02, 0.05, 0.03]) + 0.004
    cubic = 0.02

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        u = deformation
        square = np.einsum("na,na->n", u, u)[:, None]
        tau = actuation[:, None] * self.gain - u @ self.stiffness - self.cubic * square * u
        spread = square[:, :, None] * np.eye(3) + 2 * u[:, :, None] * u[:, None, :]
        return Effort(tau, np.tile(self.gain, (len(u), 1)), -self.stiffness - self.cubic * spread)

    def record(self) -> LawRecord:
        return LawRecord("spatial", {}, {})


class StretchLaw(JointLaw):
    """τ = a p − k u − c u³ in newtons and metres."""

    joint = "prismatic"
    axes = ("x",)
    actuation_name = "pressure_pa"
    domain = Domain.unbounded(1)

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        u = deformation
        tau = 1e-4 * actuation[:, None] - 200.0 * u - 1e5 * u**3
        return Effort(tau, np.full_like(u, 1e-4), (-200.0 - 3e5 * u**2)[:, :, None])

    def record(self) -> LawRecord:
        return LawRecord("stretch", {}, {})


def finger(
    law: JointLaw, n: int = 8, module_kg: float = 0.0, com_offset_m: float = 0.0, **changes: object
) -> ChainModel:
    """Equal modules hanging down; their centre of mass lies `com_offset_m` beside the hinge line."""
    length = MODULE_LENGTH_M
    along = np.array([1.0, 0.0, 0.0])

    def piece(share: float, centre: float) -> MassProperties:
        inertia = share * module_kg * np.diag([9e-6, 7e-6, 7.5e-6])
        turn = exp_map(np.array([0.2, 0.1, -0.3]))
        com = np.array([centre, 0.0, com_offset_m])
        return MassProperties(share * module_kg, com, turn @ inertia @ turn.T)

    chain = ChainModel(
        joints=tuple(Joint(0, along * (length if i else length / 2), np.eye(3)) for i in range(n)),
        bodies=(piece(0.5, length / 4), *[piece(1.0, length / 2)] * (n - 1), piece(0.5, length / 4)),
        laws=(law,),
        tip_offset_m=along * length / 2,
        base_position_m=np.zeros(3),
        base_rotation=default_base_rotation(),
    )
    return chain.with_(**changes)


def random_chain(seed: int = 0, n: int = 6) -> ChainModel:
    """A spherical chain turned and offset in all directions."""
    random = np.random.default_rng(seed)

    def body() -> MassProperties:
        turn = exp_map(random.normal(size=3))
        inertia = turn @ np.diag(random.uniform(1.0, 1.9, 3) * 1e-7) @ turn.T
        return MassProperties(random.uniform(1e-3, 3e-3), random.normal(size=3) * 5e-3, inertia)

    return ChainModel(
        joints=tuple(
            Joint(0, random.normal(size=3) * 0.01, exp_map(random.normal(size=3))) for _ in range(n)
        ),
        bodies=tuple(body() for _ in range(n + 1)),
        laws=(SpatialLaw(),),
        tip_offset_m=random.normal(size=3) * 0.01,
        base_position_m=random.normal(size=3),
        base_rotation=exp_map(random.normal(size=3)),
        payload_kg=0.013,
    )


ENGINES: dict[str, Callable[[], PhysicsBackend]] = {
    "quasistatic": lambda: Quasistatic(QuasistaticConfig()),
    "mujoco": lambda: Mujoco(MujocoConfig()),
    "pybullet": lambda: Pybullet(PybulletConfig()),
}
dynamic_engines = ["mujoco", pytest.param("pybullet", marks=needs_pybullet)]


@pytest.fixture(params=["quasistatic", *dynamic_engines])
def engine(request: pytest.FixtureRequest) -> PhysicsBackend:
    return ENGINES[request.param]()


@pytest.fixture(params=dynamic_engines)
def dynamic_engine(request: pytest.FixtureRequest) -> PhysicsBackend:
    return ENGINES[request.param]()


@pytest.fixture
def quasistatic() -> PhysicsBackend:
    return ENGINES["quasistatic"]()


@pytest.fixture
def study_law() -> type[StudyLaw]:
    return StudyLaw


@pytest.fixture
def finger_of() -> Callable[..., ChainModel]:
    """A finger by kind of joint and number of modules."""
    laws = {"revolute": StudyLaw, "spherical": SpatialLaw, "prismatic": StretchLaw}
    return lambda kind, n: finger(laws[kind](), n, module_kg=0.0016, com_offset_m=0.01)


@pytest.fixture
def massless_finger() -> ChainModel:
    """The chain of the worked number: no masses, no gravity."""
    return finger(StudyLaw(), gravity_m_s2=np.zeros(3))


@pytest.fixture
def loaded_finger() -> ChainModel:
    """Modules of 1.6 g whose centre of mass is 10 mm off the hinge line, 13 g at the tip."""
    return finger(StudyLaw(), module_kg=0.0016, com_offset_m=0.01, payload_kg=0.013)


@pytest.fixture(params=["loaded_finger", "random_chain", "spatial_finger", "stretcher"])
def heavy_chain(request: pytest.FixtureRequest, loaded_finger: ChainModel) -> ChainModel:
    """Chains of every kind of joint, with own weight and payload."""
    return {
        "loaded_finger": loaded_finger,
        "random_chain": random_chain(),
        "spatial_finger": loaded_finger.with_(laws=(SpatialLaw(),)),
        "stretcher": loaded_finger.with_(laws=(StretchLaw(),)),
    }[request.param]
