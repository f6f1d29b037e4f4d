"""Small complete implementations for checks of other components: a solid, an engine and its scenes."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Literal

import numpy as np

from pliant.interfaces.material import Hyperelastic, Material, MaterialConfig
from pliant.interfaces.physics import Capabilities, PhysicsBackend, PhysicsConfig
from pliant.interfaces.simulation import SceneSimulation, StaticSimulation
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, Inputs, OutsideDomain
from pliant.records.scene import Contact, Scene, SceneState

TOLERANCE_N_M = 1e-12
CONTINUATION_STEPS = 8


class CiarletConfig(MaterialConfig):
    """Lamé constants λ and μ."""

    kind: Literal["ciarlet_sample"] = "ciarlet_sample"
    lame_pa: float = 1.5e5
    shear_modulus_pa: float = 1e5


class Ciarlet(Material):
    """W = μ/2 (I₁ − 3 − 2 ln J) + λ/2 (ln J)², P = μ (F − F⁻ᵀ) + λ ln J F⁻ᵀ (Ciarlet 1988, §4.10)."""

    config: CiarletConfig

    def energy(self, F: Array) -> Array:
        log_j = np.log(np.linalg.det(F))
        mu, lam = self.config.shear_modulus_pa, self.config.lame_pa
        invariant = np.einsum("...ij,...ij->...", F, F)
        return np.asarray(mu / 2 * (invariant - 3 - 2 * log_j) + lam / 2 * log_j**2)

    def evaluate(self, F: Array) -> Hyperelastic:
        mu, lam = self.config.shear_modulus_pa, self.config.lame_pa
        G = np.swapaxes(np.linalg.inv(F), -1, -2)
        log_j = np.log(np.linalg.det(F))[..., None, None]
        stress = mu * (F - G) + lam * log_j * G
        crossed = np.einsum("...il,...kj->...ijkl", G, G)
        outer = np.einsum("...ij,...kl->...ijkl", G, G)
        unit = np.einsum("ik,jl->ijkl", np.eye(3), np.eye(3))
        tangent = mu * unit + (mu - lam * log_j[..., None, None]) * crossed + lam * outer
        return Hyperelastic(self.energy(F), stress, tangent)

    @property
    def shear_modulus_pa(self) -> float:
        return self.config.shear_modulus_pa

    @property
    def bulk_modulus_pa(self) -> float:
        return self.config.lame_pa + 2 / 3 * self.config.shear_modulus_pa

    @property
    def young_pa(self) -> float:
        """E at small strain."""
        mu, lam = self.config.shear_modulus_pa, self.config.lame_pa
        return mu * (3 * lam + 2 * mu) / (lam + mu)

    @property
    def poisson(self) -> float:
        """ν at small strain."""
        mu, lam = self.config.shear_modulus_pa, self.config.lame_pa
        return lam / (2 * (lam + mu))


def sample_material() -> Ciarlet:
    """Return a soft solid with ν = 0.3."""
    return Ciarlet(CiarletConfig())


def scaled_sample(factor: float) -> Ciarlet:
    """Return the soft solid, `factor` times as stiff."""
    plain = CiarletConfig()
    return Ciarlet(
        CiarletConfig(lame_pa=factor * plain.lame_pa, shear_modulus_pa=factor * plain.shear_modulus_pa)
    )


class StandInConfig(PhysicsConfig):
    """Config of the stand-in engine, without settings."""

    kind: Literal["stand_in"] = "stand_in"


class StandIn(PhysicsBackend):
    """Engine of equilibria by Newton's method with a few load steps, for short chains."""

    capabilities = Capabilities(joints=("revolute", "spherical", "prismatic"), dynamic=False)

    def build(self, chain: ChainModel) -> StandInSimulation:
        return StandInSimulation(chain)


class StandInSimulation(StaticSimulation):
    """A chain at rest until `apply` and `settle`."""

    def __init__(self, chain: ChainModel) -> None:
        super().__init__(chain)
        self.statics = ChainStatics(chain)
        self.loads = Loads.none(chain)
        self.applied = self.loads

    def apply(self, inputs: Inputs) -> None:
        self.statics.efforts.values(inputs.actuation)
        self.applied = Loads.from_inputs(self.chain, inputs)

    def settle(self) -> Equilibrium:
        started = time.perf_counter()
        iterations = 0
        before = self.loads
        for fraction in np.linspace(0, 1, CONTINUATION_STEPS + 1)[1:]:
            iterations += self._newton(before.between(self.applied, float(fraction)))
        self.loads = self.applied
        residual = float(np.abs(self.statics.residual(self.q, self.loads)).max())
        stiffness = self.statics.balance(self.q, self.loads).stiffness
        return Equilibrium(
            joint_angles=self.q.copy(),
            markers_m=self.markers(),
            residual=residual,
            converged=residual < 1e3 * TOLERANCE_N_M,
            stable=bool(np.linalg.eigvalsh(0.5 * (stiffness + stiffness.T))[0] > 0),
            iterations=iterations,
            wall_s=time.perf_counter() - started,
            outside_domain=self.statics.efforts.outside_domain(self.q, self.loads.actuation, self.time_s),
        )

    def _newton(self, loads: Loads) -> int:
        for iteration in range(30):
            balance = self.statics.balance(self.q, loads)
            if np.abs(balance.residual).max() < TOLERANCE_N_M:
                return iteration
            step = np.linalg.solve(balance.stiffness, balance.residual.ravel())
            longest = 0.5 / max(0.5, float(np.abs(step).max()))
            self.q = self.q + longest * step.reshape(self.q.shape)
        return 30

    def step(self, duration_s: float) -> None:
        """Move to the equilibrium under the present loads, which are close to the last ones."""
        self.time_s += duration_s
        self.loads = self.applied
        self._newton(self.loads)


class StandInScene(SceneSimulation):
    """Scene with arms in equilibrium on a moving carriage and fixed objects, without contact."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        build = StandIn(StandInConfig()).build
        gravity = scene.gravity_m_s2
        self.arms: list[StandInSimulation] = [build(a.chain.with_(gravity_m_s2=gravity)) for a in scene.arms]
        self.time_s = 0.0
        self.carriage_m, self.velocity_m_s = np.zeros(3), np.zeros(3)

    def apply(self, inputs: Sequence[Inputs]) -> None:
        for arm, given in zip(self.arms, inputs, strict=True):
            arm.apply(given)

    def carry(self, velocity_m_s: Array) -> None:
        self.velocity_m_s = np.array(velocity_m_s, float)

    def push(self, index: int, force_n: Array, moment_n_m: Array | None = None) -> None:
        pass

    def step(self, duration_s: float) -> None:
        self.time_s += duration_s
        self.carriage_m = self.carriage_m + duration_s * self.velocity_m_s
        for arm in self.arms:
            arm.step(duration_s)

    def snapshot(self) -> SceneState:
        objects = self.scene.objects
        return SceneState(
            time_s=self.time_s,
            carriage_m=self.carriage_m,
            coordinates=tuple(arm.q.copy() for arm in self.arms),
            rates=tuple(np.zeros_like(arm.q) for arm in self.arms),
            positions_m=np.array([body.position_m for body in objects], float).reshape(-1, 3),
            rotations=np.array([body.rotation for body in objects], float).reshape(-1, 3, 3),
            velocities=np.zeros((len(objects), 6)),
        )

    def restore(self, state: SceneState) -> None:
        self.time_s, self.carriage_m = state.time_s, state.carriage_m
        for arm, q in zip(self.arms, state.coordinates, strict=True):
            arm.q = q.copy()

    def markers(self, arm: int) -> Array:
        return self.arms[arm].markers() + self.carriage_m

    def contacts(self) -> tuple[Contact, ...]:
        return ()

    def outside_domain(self) -> tuple[OutsideDomain, ...]:
        return ()
