"""Engines, laws and chains with known results."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable

import numpy as np
import pytest

from pliant.interfaces.physics import PhysicsBackend
from pliant.mechanics.rotations import exp_map
from pliant.records.chain import ChainModel, Joint, default_base_rotation
from pliant.records.design import Array, MassProperties
from pliant.records.law import EXTENSIBLE_AXES, Domain, Effort, JointLaw, LawRecord, ScalarLaw
from pliant.records.rollout import Equilibrium, Inputs
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


def study(p: float, u: Array, c: Array, tau: Array, dtau_dp: Array, dtau_du: Array) -> None:
    """Return τ = k_n p + (m_a p + b_a) u − (m_e u|u|/2 + b_e u), the odd form of docs/conventions.md."""
    slope = c[1] * p + c[2]
    tau[0] = c[0] * p + slope * u[0] - (c[3] * u[0] * abs(u[0]) / 2 + c[4] * u[0])
    dtau_dp[0] = c[0] + c[1] * u[0]
    dtau_du[0, 0] = slope - c[3] * abs(u[0]) - c[4]


def spatial(p: float, u: Array, c: Array, tau: Array, dtau_dp: Array, dtau_du: Array) -> None:
    """Return τ = p g − K u − c (u·u) u with a full symmetric K: pressure bends and twists."""
    square = u[0] * u[0] + u[1] * u[1] + u[2] * u[2]
    for a in range(3):
        tau[a] = p * c[a] - c[12] * square * u[a]
        dtau_dp[a] = c[a]
        for b in range(3):
            tau[a] -= c[3 + 3 * a + b] * u[b]
            dtau_du[a, b] = -c[3 + 3 * a + b] - 2 * c[12] * u[a] * u[b]
        dtau_du[a, a] -= c[12] * square


def growing(p: float, u: Array, c: Array, tau: Array, dtau_dp: Array, dtau_du: Array) -> None:
    """Return τ = −∂Π/∂u, Π = ½ uᵀKu + ½ c e θ² + ¼ d θ⁴ − p g·u with u = (φ, e), θ = |φ|, stiffer if longer."""
    square = u[0] * u[0] + u[1] * u[1] + u[2] * u[2]
    for a in range(4):
        tau[a] = p * c[a]
        dtau_dp[a] = c[a]
        for b in range(4):
            tau[a] -= c[4 + 4 * a + b] * u[b]
            dtau_du[a, b] = -c[4 + 4 * a + b]
    for a in range(3):
        tau[a] -= (c[20] * u[3] + c[21] * square) * u[a]
        dtau_du[a, a] -= c[20] * u[3] + c[21] * square
        dtau_du[a, 3] -= c[20] * u[a]
        dtau_du[3, a] -= c[20] * u[a]
        for b in range(3):
            dtau_du[a, b] -= 2 * c[21] * u[a] * u[b]
    tau[3] -= 0.5 * c[20] * square


def stretch(p: float, u: Array, c: Array, tau: Array, dtau_dp: Array, dtau_du: Array) -> None:
    """Return τ = a p − k u − c u³ in newtons and metres."""
    tau[0] = c[0] * p - c[1] * u[0] - c[2] * u[0] ** 3
    dtau_dp[0] = c[0]
    dtau_du[0, 0] = -c[1] - 3 * c[2] * u[0] ** 2


class RowWise(JointLaw):
    """A law by its scalar function; one that is not `compiled` hides it, so that engines use their Python paths."""

    actuation_name = "pressure_pa"
    axes: tuple[str, ...] = ("y",)
    compiled = True
    form: ScalarLaw

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        n, a = deformation.shape
        effort = Effort(np.empty((n, a)), np.empty((n, a)), np.empty((n, a, a)))
        for row, p in enumerate(actuation):
            parts = (effort.tau[row], effort.dtau_dp[row], effort.dtau_du[row])
            self.form.function(float(p), deformation[row], self.form.parameters, *parts)
        return effort

    def scalar(self) -> ScalarLaw | None:
        return self.form if self.compiled else None

    def record(self) -> LawRecord:
        return LawRecord("of_tests", {}, {})


class ScalarStudy(RowWise):
    joint = "revolute"

    def __init__(
        self,
        k_n: float = 1.637e-6,
        m_a: float = -1.704e-6,
        b_a: float = 0.0,
        m_e: float = 0.1012,
        b_e: float = 0.0245,
        domain: Domain | None = None,
    ) -> None:
        self.form = ScalarLaw(study, np.array([k_n, m_a, b_a, m_e, b_e]))
        self.domain = domain or Domain.unbounded(1)


class ScalarSpatial(RowWise):
    joint = "spherical"
    axes = ("x", "y", "z")
    domain = Domain.unbounded(3)
    function = staticmethod(spatial)
    gain = np.array([0.2, 1.0, -0.3]) * 1e-6

    def __init__(self, stiffness: Array | None = None, gain: Array = gain, cubic: float = 0.02) -> None:
        k = np.diag([0.02, 0.05, 0.03]) + 0.004 if stiffness is None else stiffness
        self.form = ScalarLaw(self.function, np.concatenate([gain, k.ravel(), [cubic]]))


class ScalarGrowing(RowWise):
    joint, axes, domain = "extensible", EXTENSIBLE_AXES, Domain.unbounded(4)
    function = staticmethod(growing)

    def __init__(self) -> None:
        k = np.zeros((4, 4))
        k[:3, :3] = np.diag([0.02, 0.05, 0.03]) + 0.004
        k[3] = k[:, 3] = [0.1, 0.4, -0.3, 600.0]
        gain = np.array([0.2e-6, 1e-6, -0.3e-6, 4e-5])
        self.form = ScalarLaw(self.function, np.concatenate([gain, k.ravel(), [2.0, 0.02]]))


class GrowingLaw(ScalarGrowing):
    compiled = False


class ScalarStretch(RowWise):
    joint, axes, domain = "prismatic", ("x",), Domain.unbounded(1)
    form = ScalarLaw(stretch, np.array([1e-4, 200.0, 1e5]))


class StudyLaw(ScalarStudy):
    compiled = False


class SpatialLaw(ScalarSpatial):
    compiled = False


class StretchLaw(ScalarStretch):
    compiled = False


SCALAR = {
    "revolute": ScalarStudy,
    "spherical": ScalarSpatial,
    "prismatic": ScalarStretch,
    "extensible": ScalarGrowing,
}


def finger(
    law: JointLaw, n: int = 8, module_kg: float = 0.0, com_offset_m: float = 0.0, **changes: object
) -> ChainModel:
    """Return equal modules hanging down, with their centre of mass at `com_offset_m` from the hinge line."""
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
    """Return a spherical chain turned and offset in all directions."""
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


def settle(engine: PhysicsBackend, chain: ChainModel, inputs: Inputs) -> Equilibrium:
    """Return the settled state of a new simulation of this chain."""
    with engine.build(chain) as simulation:
        simulation.apply(inputs)
        return simulation.settle()


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
def make_finger() -> Callable[..., ChainModel]:
    """Return a finger by kind of joint and number of modules."""
    laws = {
        "revolute": StudyLaw,
        "spherical": SpatialLaw,
        "prismatic": StretchLaw,
        "extensible": GrowingLaw,
    }
    return lambda kind, n: finger(laws[kind](), n, module_kg=0.0016, com_offset_m=0.01)


@pytest.fixture
def massless_finger() -> ChainModel:
    """Return the chain of the worked number: no masses, no gravity."""
    return finger(StudyLaw(), gravity_m_s2=np.zeros(3))


@pytest.fixture
def loaded_finger() -> ChainModel:
    """Return modules of 1.6 g whose centre of mass is 10 mm off the hinge line, 13 g at the tip."""
    return finger(StudyLaw(), module_kg=0.0016, com_offset_m=0.01, payload_kg=0.013)


@pytest.fixture(params=["loaded_finger", "random_chain", "spatial_finger", "stretcher"])
def heavy_chain(request: pytest.FixtureRequest, loaded_finger: ChainModel) -> ChainModel:
    """Return chains of every kind of joint, with own weight and payload."""
    return {
        "loaded_finger": loaded_finger,
        "random_chain": random_chain(),
        "spatial_finger": loaded_finger.with_(laws=(SpatialLaw(),)),
        "stretcher": loaded_finger.with_(laws=(StretchLaw(),)),
    }[request.param]
