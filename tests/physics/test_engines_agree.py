"""Every engine settles in the equilibrium that statics defines, under loads beyond those of the conformance suite."""

from __future__ import annotations

import numpy as np
from tests.physics.conftest import settle

from pliant.interfaces.physics import PhysicsBackend
from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs

AGREEMENT_M = 1e-6


def test_weights_and_payload(
    engine: PhysicsBackend, quasistatic: PhysicsBackend, heavy_chain: ChainModel
) -> None:
    """All kinds of joints, own weight and 13 g: every engine within 1 µm of the quasi-static one."""
    inputs = Inputs({"pressure_pa": 12e3}, tip_force_n=np.array([0.02, 0.01, -0.03]))
    end, wanted = (settle(backend, heavy_chain, inputs) for backend in (engine, quasistatic))
    assert end.converged and end.residual <= 1e-8
    np.testing.assert_allclose(end.markers_m, wanted.markers_m, atol=AGREEMENT_M)
    np.testing.assert_allclose(end.joint_angles, wanted.joint_angles, atol=1e-5)


def test_large_force_on_a_chain_without_mass(
    engine: PhysicsBackend, quasistatic: PhysicsBackend, massless_finger: ChainModel
) -> None:
    """Stiffening by a load that no inertia accompanies: relaxation must not overshoot."""
    inputs = Inputs({"pressure_pa": 15e3}, tip_force_n=np.array([0.5, 0.0, -1.0]))
    tips = [settle(backend, massless_finger, inputs).tip_m for backend in (engine, quasistatic)]
    np.testing.assert_allclose(tips[0], tips[1], atol=AGREEMENT_M)


def test_a_floor_on_inertia_weighs_nothing(engine: PhysicsBackend, massless_finger: ChainModel) -> None:
    """Without mass, gravity changes nothing."""
    chain = massless_finger.with_(gravity_m_s2=np.array([0.0, 3.0, -9.81]))
    end = settle(engine, chain, Inputs({"pressure_pa": 15e3}))
    assert end.converged
    np.testing.assert_allclose(end.tip_m, [0.059451, 0.0, -0.007889], atol=1e-6)


def test_settle_leaves_an_unstable_equilibrium(engine: PhysicsBackend, massless_finger: ChainModel) -> None:
    """A chain that stands upright under a load beyond buckling is in balance, but must not stay there."""
    upright = massless_finger.with_(base_rotation=massless_finger.base_rotation @ np.diag([-1.0, 1.0, -1.0]))
    end = settle(engine, upright, Inputs({"pressure_pa": 0.0}, tip_force_n=np.array([0.0, 0.0, -1.0])))
    assert end.converged and end.stable
    assert np.abs(end.joint_angles).max() > 0.1
