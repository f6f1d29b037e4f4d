"""Every engine settles in the equilibrium that statics defines."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.interfaces.physics import PhysicsBackend
from pliant.records.chain import Actuator, ChainModel
from pliant.records.rollout import Inputs

AGREEMENT_M = 1e-6


def test_worked_number_of_the_contracts(engine: PhysicsBackend, massless_finger: ChainModel) -> None:
    with engine.build(massless_finger) as simulation:
        simulation.apply(Inputs({"pressure_pa": 15e3}))
        settled = simulation.settle()
    assert settled.converged and settled.stable
    np.testing.assert_allclose(settled.joint_angles, 0.359718, atol=1e-6)
    np.testing.assert_allclose(settled.tip_m, [0.059451, 0.0, -0.007889], atol=1e-6)
    np.testing.assert_allclose(settled.markers_m[0], 0.0, atol=1e-15)


def test_weights_and_payload(
    engine: PhysicsBackend, quasistatic: PhysicsBackend, heavy_chain: ChainModel
) -> None:
    """All kinds of joints, own weight and 13 g: every engine within 1 µm of the quasi-static one."""
    inputs = Inputs({"pressure_pa": 12e3}, tip_force_n=np.array([0.02, 0.01, -0.03]))
    with engine.build(heavy_chain) as simulation:
        simulation.apply(inputs)
        settled = simulation.settle()
        markers = simulation.markers()
    reference = quasistatic.build(heavy_chain)
    reference.apply(inputs)
    wanted = reference.settle()
    assert settled.converged and settled.residual <= 1e-8
    np.testing.assert_allclose(markers, wanted.markers_m, atol=AGREEMENT_M)
    np.testing.assert_array_equal(settled.markers_m, markers)
    np.testing.assert_allclose(settled.joint_angles, wanted.joint_angles, atol=1e-5)


def test_large_force_on_a_chain_without_mass(
    engine: PhysicsBackend, quasistatic: PhysicsBackend, massless_finger: ChainModel
) -> None:
    """Stiffening by a load that no inertia accompanies: relaxation must not overshoot."""
    inputs = Inputs({"pressure_pa": 15e3}, tip_force_n=np.array([0.5, 0.0, -1.0]))
    tips = []
    for backend in (engine, quasistatic):
        with backend.build(massless_finger) as simulation:
            simulation.apply(inputs)
            tips.append(simulation.settle().tip_m)
    np.testing.assert_allclose(tips[0], tips[1], atol=AGREEMENT_M)


def test_a_floor_on_inertia_weighs_nothing(engine: PhysicsBackend, massless_finger: ChainModel) -> None:
    """Without mass, gravity changes nothing."""
    with engine.build(massless_finger.with_(gravity_m_s2=np.array([0.0, 3.0, -9.81]))) as simulation:
        simulation.apply(Inputs({"pressure_pa": 15e3}))
        settled = simulation.settle()
    assert settled.converged
    np.testing.assert_allclose(settled.tip_m, [0.059451, 0.0, -0.007889], atol=1e-6)


def test_opposing_moment(engine: PhysicsBackend, massless_finger: ChainModel) -> None:
    """An end moment equal to each joint's own effort at zero angle keeps the chain straight."""
    with engine.build(massless_finger) as simulation:
        simulation.apply(Inputs({"pressure_pa": 15e3}, moment_n_m=1.637e-6 * 15e3))
        settled = simulation.settle()
    np.testing.assert_allclose(settled.joint_angles, 0.0, atol=1e-6)


def test_opposed_chambers(engine: PhysicsBackend, massless_finger: ChainModel) -> None:
    """Swapping the pressures of opposed chambers mirrors the chain; equal pressures stiffen it straight."""
    opposed = massless_finger.with_(
        actuators=(Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -1.0))
    )
    angles = []
    for one, two in ((12e3, 3e3), (3e3, 12e3), (9e3, 9e3)):
        with engine.build(opposed) as simulation:
            simulation.apply(Inputs({"pressure_1_pa": one, "pressure_2_pa": two}))
            angles.append(simulation.settle().joint_angles)
    assert angles[0].min() > 0.05
    np.testing.assert_allclose(angles[0], -angles[1], atol=1e-5)
    np.testing.assert_allclose(angles[2], 0.0, atol=1e-6)


def test_settle_leaves_an_unstable_equilibrium(engine: PhysicsBackend, massless_finger: ChainModel) -> None:
    """A chain that stands upright under a load beyond buckling is in balance, but must not stay there."""
    upright = massless_finger.with_(base_rotation=massless_finger.base_rotation @ np.diag([-1.0, 1.0, -1.0]))
    with engine.build(upright) as simulation:
        assert simulation.markers()[-1, 2] > 0.08
        simulation.apply(Inputs({"pressure_pa": 0.0}, tip_force_n=np.array([0.0, 0.0, -1.0])))
        settled = simulation.settle()
    assert settled.converged and settled.stable
    assert np.abs(settled.joint_angles).max() > 0.1


def test_missing_input_is_a_sentence(engine: PhysicsBackend, massless_finger: ChainModel) -> None:
    with engine.build(massless_finger) as simulation, pytest.raises(UserError, match="pressure_pa"):
        simulation.apply(Inputs({"tendon_force_n": 1.0}))
