"""Newton against closed forms, and what it does when there is no equilibrium to be found."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import brentq
from tests.physics.conftest import settle

from pliant.interfaces.physics import PhysicsBackend
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel, Joint, default_base_rotation
from pliant.records.design import MassProperties
from pliant.records.law import JointLaw
from pliant.records.rollout import Inputs

LawType = Callable[..., JointLaw]


def pendulum(law: JointLaw, payload_kg: float = 0.0, base_rotation: np.ndarray | None = None) -> ChainModel:
    """One joint with 50 mm to the tip."""
    return ChainModel(
        joints=(Joint(0, np.zeros(3), np.eye(3)),),
        bodies=(MassProperties.none(), MassProperties.none()),
        laws=(law,),
        tip_offset_m=np.array([0.05, 0.0, 0.0]),
        base_position_m=np.zeros(3),
        base_rotation=default_base_rotation() if base_rotation is None else base_rotation,
        payload_kg=payload_kg,
    )


def test_buckled_pendulum_is_a_minimum(quasistatic: PhysicsBackend, study_law: LawType) -> None:
    """Upright with m g l = 2 k: u = 0 is an equilibrium; the minima are at u / sin u = 2."""
    stiffness = 0.02
    upright = default_base_rotation() @ np.diag([-1.0, 1.0, -1.0])
    law = study_law(m_e=0.0, b_e=stiffness, k_n=0.0, m_a=0.0)
    chain = pendulum(law, 2 * stiffness / (9.81 * 0.05), upright)
    settled = settle(quasistatic, chain, Inputs({"pressure_pa": 0.0}))
    angle = brentq(lambda u: u - 2 * np.sin(u), 1.0, 3.0)
    assert settled.converged and settled.stable
    assert abs(settled.joint_angles[0, 0]) == pytest.approx(angle, abs=1e-7)


def test_residual_is_below_the_tolerance_on_hard_cases(
    quasistatic: PhysicsBackend, heavy_chain: ChainModel
) -> None:
    """Loads up to forty times the design load, applied at once."""
    for payload in (0.0, 0.1, 0.5):
        settled = settle(quasistatic, heavy_chain.with_(payload_kg=payload), Inputs({"pressure_pa": 15e3}))
        assert settled.converged and settled.stable
        assert settled.residual <= 1e-9
        statics = ChainStatics(heavy_chain.with_(payload_kg=payload))
        loads = Loads.of(heavy_chain, Inputs({"pressure_pa": 15e3}))
        assert np.abs(statics.residual(settled.joint_angles, loads)).max() == settled.residual


def test_path_independence(quasistatic: PhysicsBackend, heavy_chain: ChainModel) -> None:
    """At once or in ten levels: the same equilibrium."""
    tips = []
    for levels in (1, 10):
        with quasistatic.build(heavy_chain) as simulation:
            for share in np.linspace(0, 1, levels + 1)[1:]:
                simulation.apply(Inputs({"pressure_pa": share * 15e3}))
                settled = simulation.settle()
            tips.append(settled.tip_m)
    np.testing.assert_allclose(tips[0], tips[1], atol=1e-8)
