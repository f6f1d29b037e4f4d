"""Chains that turn and extend in MuJoCo: equilibria of the quasi-static engine, inertia, and engines without them."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from tests.physics.conftest import ENGINES, GrowingLaw, ScalarGrowing, finger, settle

from pliant.errors import UserError
from pliant.interfaces.simulation import SimulationState
from pliant.mechanics.inertia import mass_matrix
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.law import JointLaw
from pliant.records.rollout import Inputs, PointForce
from pliant_plugins.exporting.urdf import write_urdf
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.pybullet.backend import Pybullet
from pliant_plugins.physics.quasistatic.backend import Quasistatic

INPUTS = Inputs(
    {"pressure_pa": 12e3},
    np.array([0.02, 0.01, -0.03]),
    forces=(PointForce(2, np.array([0.0, 0.0, 0.004]), np.array([0.0, 0.05, 0.02])),),
)


@pytest.mark.parametrize("law", [ScalarGrowing, GrowingLaw])
def test_mujoco_settles_where_the_statics_says(law: type[JointLaw]) -> None:
    """With laws compiled or not the pose agrees to 1 µm, with joints that have all turned, twisted and extended."""
    chain = finger(law(), 4, 0.0016, 0.01, payload_kg=0.013)
    end, wanted = (settle(ENGINES[name](), chain, INPUTS) for name in ("mujoco", "quasistatic"))
    assert end.converged and wanted.converged
    np.testing.assert_allclose(end.markers_m, wanted.markers_m, atol=1e-6)
    np.testing.assert_allclose(end.joint_angles, wanted.joint_angles, atol=1e-5)
    assert (np.abs(wanted.joint_angles) > [1e-4, 0.05, 1e-3, 3e-4]).all()


def test_mujoco_has_the_same_inertia_on_joints_that_have_grown() -> None:
    chain = finger(ScalarGrowing(), 3, 0.0016, 0.01, payload_kg=0.013)
    q = np.zeros((3, 4))
    q[:, 3] = [1e-3, -5e-4, 2e-3]
    with ENGINES["mujoco"]().build(chain) as simulation:
        simulation.restore(SimulationState(0.0, q, np.zeros_like(q)))
        model, data = simulation.model, simulation.data  # type: ignore[attr-defined]
        mujoco.mj_forward(model, data)
        theirs = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, theirs)
        np.testing.assert_allclose(
            simulation.markers(), ChainGeometry.from_chain(chain).markers(q), atol=1e-12
        )
    np.testing.assert_allclose(theirs, mass_matrix(chain, q), rtol=1e-6, atol=1e-11)


def test_energy_is_kept_while_a_chain_swings_bends_and_grows() -> None:
    """The loss is proportional to the step: Richardson's extrapolation to zero steps gives no loss."""
    chain = finger(ScalarGrowing(), 2, 0.0016, 0.01, payload_kg=0.05)
    inputs, none = Inputs({"pressure_pa": 9e3}), {"joint_damping": 0.0, "drag_1_s": 0.0}
    statics, loads = ChainStatics(chain), Loads.from_inputs(chain, inputs)
    losses = []
    for step_s in (1e-6, 5e-7):
        engine = Mujoco(MujocoConfig(timestep_s=step_s, **none))
        with engine.build(chain) as simulation:
            simulation.apply(inputs)
            before = statics.potential(simulation.snapshot().position, loads)
            simulation.step(0.01)
            state = simulation.snapshot()
        rates = state.velocity.ravel()
        kinetic = 0.5 * float(rates @ mass_matrix(chain, state.position) @ rates)
        losses.append(before - statics.potential(state.position, loads) - kinetic)
    assert kinetic > 5e-5
    assert losses[0] == pytest.approx(2 * losses[1], rel=0.05)
    assert abs(2 * losses[1] - losses[0]) < 5e-3 * kinetic


def test_a_urdf_file_cannot_hold_it_and_says_so(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="turns and extends; write the robot as MJCF"):
        write_urdf(finger(ScalarGrowing(), 2, 0.0016), tmp_path / "chain.urdf")
    assert list(tmp_path.iterdir()) == []


def test_pybullet_does_not_claim_it() -> None:
    assert "extensible" not in Pybullet.capabilities.joints
    assert all("extensible" in engine.capabilities.joints for engine in (Quasistatic, Mujoco))
