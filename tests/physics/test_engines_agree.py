"""Every engine settles in the equilibrium that statics defines."""

from __future__ import annotations

import numpy as np

from pliant.interfaces.physics import PhysicsBackend
from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs

AGREEMENT_M = 1e-6


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


def test_settle_leaves_an_unstable_equilibrium(engine: PhysicsBackend, massless_finger: ChainModel) -> None:
    """A chain that stands upright under a load beyond buckling is in balance, but must not stay there."""
    upright = massless_finger.with_(base_rotation=massless_finger.base_rotation @ np.diag([-1.0, 1.0, -1.0]))
    with engine.build(upright) as simulation:
        assert simulation.markers()[-1, 2] > 0.08
        simulation.apply(Inputs({"pressure_pa": 0.0}, tip_force_n=np.array([0.0, 0.0, -1.0])))
        settled = simulation.settle()
    assert settled.converged and settled.stable
    assert np.abs(settled.joint_angles).max() > 0.1
