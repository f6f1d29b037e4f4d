"""Efforts at MuJoCo's dofs: conservative on closed paths, the same compiled and plain; energy of a swing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.physics.conftest import ScalarSpatial, SpatialLaw

from pliant.interfaces.physics import SimulationState
from pliant.mechanics.inertia import mass_matrix
from pliant.mechanics.rotations import right_jacobian
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.law import JointLaw
from pliant.records.rollout import Cord, Inputs, PointForce
from pliant_plugins.physics.mujoco.backend import Mujoco, MujocoSimulation
from pliant_plugins.physics.mujoco.config import MujocoConfig

INPUTS = Inputs({"pressure_pa": 9e3})


def engine_of(chain: ChainModel) -> MujocoSimulation:
    engine = MujocoSimulation(chain, MujocoConfig())
    engine.model.opt.timestep = 0.01
    return engine


@pytest.mark.parametrize("law", [ScalarSpatial, SpatialLaw])
def test_no_work_on_closed_paths(law: type[JointLaw], finger_of: Callable[..., ChainModel]) -> None:
    """Σ force · ω over a loop of large turns vanishes against the elastic energy on it."""
    chain = finger_of("spherical", 3).with_(laws=(law(),))
    engine, loads = engine_of(chain), Loads.of(chain, INPUTS)
    random = np.random.default_rng(3)
    size, phase = random.uniform(0.3, 0.9, (3, 3)), random.uniform(0, 6, (3, 3))
    work, energy, steps = 0.0, 0.0, 400
    for s in 2 * np.pi * np.arange(steps) / steps:
        q, rate = size * np.sin(s + phase), size * np.cos(s + phase)
        engine.halt(q)
        engine.joints.drive(loads, 0.0)
        spin = np.einsum("nij,nj->ni", right_jacobian(q), rate)
        work += float(engine.data.qfrc_applied @ spin.ravel()) * 2 * np.pi / steps
        energy = max(energy, abs(engine.statics.efforts.potential(q, loads.actuation)))
    assert abs(work) <= 1e-6 * energy


@pytest.mark.parametrize("moment", [0.0, 2e-3])
def test_compiled_and_plain_efforts_are_the_same(moment: float, finger_of: Callable[..., ChainModel]) -> None:
    q = np.random.default_rng(5).uniform(-0.9, 0.9, (4, 3))
    found = []
    for law in (ScalarSpatial(), SpatialLaw()):
        chain = finger_of("spherical", 4).with_(laws=(law,))
        engine = engine_of(chain)
        engine.halt(q)
        loads = Loads.of(chain, Inputs({"pressure_pa": 9e3}, moment_n_m=moment))
        engine.joints.drive(loads, 1e-3, np.full(4, 0.01), 2.0)
        found.append((engine.data.qfrc_applied.copy(), engine.model.dof_damping.copy()))
    np.testing.assert_allclose(found[0][0], found[1][0], rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(found[0][1], found[1][1], rtol=1e-12)


def test_an_undamped_swing_keeps_its_energy_as_steps_shrink(finger_of: Callable[..., ChainModel]) -> None:
    """What the implicit integrator takes is proportional to the step, and goes to nothing with it."""
    chain = finger_of("spherical", 4).with_(laws=(ScalarSpatial(),))
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
    chain = finger_of("spherical", 4).with_(laws=(ScalarSpatial(),))
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
