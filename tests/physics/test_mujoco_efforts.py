"""Efforts at MuJoCo's dofs: conservative on closed paths, the same compiled and plain; energy of a swing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pliant.interfaces.physics import SimulationState
from pliant.mechanics.inertia import mass_matrix
from pliant.mechanics.rotations import right_jacobian
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.law import Domain, Effort, JointLaw, LawRecord, ScalarLaw
from pliant.records.rollout import Cord, Inputs, PointForce
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.simulation import MujocoChain

INPUTS = Inputs({"pressure_pa": 9e3})


def spatial(p: float, u: Any, c: Any, tau: Any, dtau_dp: Any, dtau_du: Any) -> None:
    """τ = p g − K u − c |u|² u, with g and the rows of K in c."""
    square = u[0] * u[0] + u[1] * u[1] + u[2] * u[2]
    for a in range(3):
        tau[a] = c[a] * p - c[12] * square * u[a]
        dtau_dp[a] = c[a]
        for b in range(3):
            tau[a] -= c[3 + 3 * a + b] * u[b]
            dtau_du[a, b] = -c[3 + 3 * a + b] - 2.0 * c[12] * u[a] * u[b]
        dtau_du[a, a] -= c[12] * square


class CompiledSpatialLaw(JointLaw):
    """A conservative three-axis law that has a scalar form."""

    joint, axes, actuation_name, domain = "spherical", ("x", "y", "z"), "pressure_pa", Domain.unbounded(3)
    gain = np.array([0.2, 1.0, -0.3]) * 1e-6
    stiffness = np.diag([0.02, 0.05, 0.03]) + 0.004

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        n = len(deformation)
        tau, in_p, in_u = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3, 3))
        for k in range(n):
            spatial(actuation[k], deformation[k], self.scalar().parameters, tau[k], in_p[k], in_u[k])
        return Effort(tau, in_p, in_u)

    def scalar(self) -> ScalarLaw:
        return ScalarLaw(spatial, np.concatenate([self.gain, self.stiffness.ravel(), [0.02]]))

    def record(self) -> LawRecord:
        return LawRecord("spatial", {}, {})


class PlainSpatialLaw(CompiledSpatialLaw):
    """The same law without the scalar form."""

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        return CompiledSpatialLaw().evaluate(actuation, deformation)

    def scalar(self) -> None:  # type: ignore[override]
        return None


def engine_of(chain: ChainModel) -> MujocoChain:
    engine = MujocoChain(chain, ChainStatics(chain), MujocoConfig())
    engine.model.opt.timestep = 0.01
    return engine


@pytest.mark.parametrize("law", [CompiledSpatialLaw, PlainSpatialLaw])
def test_no_work_on_closed_paths(law: type[JointLaw], finger_of: Callable[..., ChainModel]) -> None:
    """Σ force · ω over a loop of large turns vanishes against the elastic energy on it."""
    chain = finger_of("spherical", 3).with_(laws=(law(),))
    engine, loads = engine_of(chain), Loads.of(chain, INPUTS)
    random = np.random.default_rng(3)
    size, phase = random.uniform(0.3, 0.9, (3, 3)), random.uniform(0, 6, (3, 3))
    work, energy, steps = 0.0, 0.0, 400
    for s in 2 * np.pi * np.arange(steps) / steps:
        q, rate = size * np.sin(s + phase), size * np.cos(s + phase)
        engine.place(q, np.zeros_like(q))
        engine.joints.drive(loads, 0.0)
        spin = np.einsum("nij,nj->ni", right_jacobian(q), rate)
        work += float(engine.data.qfrc_applied @ spin.ravel()) * 2 * np.pi / steps
        energy = max(energy, abs(engine.joints.statics.efforts.potential(q, loads.actuation)))
    assert abs(work) <= 1e-6 * energy


@pytest.mark.parametrize("moment", [0.0, 2e-3])
def test_compiled_and_plain_efforts_are_the_same(moment: float, finger_of: Callable[..., ChainModel]) -> None:
    q = np.random.default_rng(5).uniform(-0.9, 0.9, (4, 3))
    found = []
    for law in (CompiledSpatialLaw(), PlainSpatialLaw()):
        chain = finger_of("spherical", 4).with_(laws=(law,))
        engine = engine_of(chain)
        engine.place(q, np.zeros_like(q))
        loads = Loads.of(chain, Inputs({"pressure_pa": 9e3}, moment_n_m=moment))
        engine.joints.drive(loads, 1e-3, np.full(4, 0.01), 2.0)
        found.append((engine.data.qfrc_applied.copy(), engine.model.dof_damping.copy()))
    np.testing.assert_allclose(found[0][0], found[1][0], rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(found[0][1], found[1][1], rtol=1e-12)


def test_an_undamped_swing_keeps_its_energy_as_steps_shrink(finger_of: Callable[..., ChainModel]) -> None:
    """What the implicit integrator takes is proportional to the step, and goes to nothing with it."""
    chain = finger_of("spherical", 4).with_(laws=(CompiledSpatialLaw(),))
    statics, loads = ChainStatics(chain), Loads.of(chain, INPUTS)

    def energy(state: SimulationState) -> float:
        rates = state.velocity.ravel()
        kinetic = 0.5 * rates @ mass_matrix(chain, state.position) @ rates
        return float(kinetic + statics.potential(state.position, loads))

    lost = []
    for step in (4e-6, 2e-6):
        config = MujocoConfig(timestep_s=step, joint_damping=0.0, drag_1_s=0.0)
        with Mujoco(config).build(chain) as simulation:
            simulation.apply(INPUTS)
            start = energy(simulation.snapshot())
            simulation.step(0.01)
            end = simulation.snapshot()
            lost.append(start - energy(end))
            moved = statics.efforts.potential(end.position, loads.actuation)
    assert abs(moved) > 1e-5
    assert lost[0] / lost[1] == pytest.approx(2.0, rel=0.15)
    assert 0.0 < lost[1] < 0.05 * abs(moved)


def test_point_loads_and_cords_move_the_chain_to_the_equilibrium_of_statics(
    finger_of: Callable[..., ChainModel],
) -> None:
    """Stepped through time, not settled: MuJoCo's own forces on its bodies end where statics has the balance."""
    chain = finger_of("spherical", 4).with_(laws=(CompiledSpatialLaw(),))
    inputs = Inputs(
        {"pressure_pa": 9e3},
        forces=(PointForce(2, np.array([0.003, 0.004, 0.0]), np.array([0.05, 0.1, 0.0])),),
        cords=(Cord(4, np.array([0.0, 0.005, 0.0]), np.array([0.05, 0.0, 0.02]), 0.2),),
    )
    with Mujoco(MujocoConfig(joint_damping=1e-3)).build(chain) as simulation:
        simulation.apply(inputs)
        simulation.step(4.0)
        q = simulation.snapshot().position
        settled = simulation.settle()
    residual = np.abs(ChainStatics(chain).residual(q, Loads.of(chain, inputs))).max()
    assert settled.converged
    assert residual < 1e-6
    np.testing.assert_allclose(q, settled.joint_angles, atol=1e-4)
