"""Free bending and tip load on the quasi-static engine."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from pydantic import ValidationError

from pliant.errors import UserError
from pliant.interfaces.physics import PhysicsBackend
from pliant.interfaces.task import Task
from pliant.records.chain import Actuator, ChainModel
from pliant.records.law import Domain, JointLaw
from pliant.records.rollout import TaskResult
from pliant_plugins.tasks.ramp import FreeBending, FreeBendingConfig, TipLoad, TipLoadConfig


def perform(task: Task, chain: ChainModel, engine: PhysicsBackend) -> TaskResult:
    with engine.build(task.prepare(chain)) as simulation:
        return task.run(simulation)


def test_free_bending_ramps_to_the_worked_number(
    quasistatic: PhysicsBackend, massless_finger: ChainModel
) -> None:
    result = perform(FreeBending(FreeBendingConfig(pressure="15 kPa")), massless_finger, quasistatic)
    assert result.final.converged
    assert result.metrics["tip_x_m"] == pytest.approx(0.059451, abs=1e-6)
    assert result.metrics["bend_angle_rad"] == pytest.approx(8 * 0.359718, abs=1e-5)
    assert result.metrics["max_joint_angle_rad"] == pytest.approx(0.359718, abs=1e-6)
    assert result.metrics["unsettled_levels"] == 0
    straight = np.array([0.0, 0.0, -0.088])
    assert result.metrics["tip_displacement_m"] == pytest.approx(
        np.linalg.norm(result.final.tip_m - straight)
    )
    rollout = result.rollout
    assert rollout is not None
    assert rollout.actuation.shape == (11, 1) and rollout.markers_m.shape == (11, 10, 3)
    np.testing.assert_allclose(rollout.actuation[:, 0], np.linspace(0, 15e3, 11))
    np.testing.assert_allclose(rollout.joint_angles[0], 0.0, atol=1e-9)
    np.testing.assert_array_equal(rollout.markers_m[-1], result.final.markers_m)


def test_tip_load_hangs_its_payload(quasistatic: PhysicsBackend, loaded_finger: ChainModel) -> None:
    config = TipLoadConfig(pressure_pa=15e3, payload="13 g", steps=1)
    own = perform(TipLoad(config), loaded_finger.with_(payload_kg=0.0), quasistatic)
    chains = perform(TipLoad(TipLoadConfig(pressure_pa=15e3, steps=1)), loaded_finger, quasistatic)
    np.testing.assert_array_equal(own.final.markers_m, chains.final.markers_m)
    weight = TipLoadConfig(pressure_pa=15e3, payload_kg=0.0, tip_force_n=(0.0, 0.0, -0.013 * 9.81), steps=1)
    force = perform(TipLoad(weight), loaded_finger, quasistatic)
    np.testing.assert_allclose(force.final.markers_m, own.final.markers_m, atol=1e-10)


def test_numbered_chambers_take_the_pressure_in_the_first(
    quasistatic: PhysicsBackend, massless_finger: ChainModel
) -> None:
    opposed = massless_finger.with_(actuators=(Actuator("pressure_1_pa"), Actuator("pressure_2_pa", -1.0)))
    result = perform(FreeBending(FreeBendingConfig(pressure_pa=15e3, steps=2)), opposed, quasistatic)
    assert result.rollout is not None
    np.testing.assert_array_equal(result.rollout.actuation[-1], [15e3, 0.0])
    assert result.final.joint_angles.min() > 0.1


def test_extrapolation_anywhere_on_the_ramp_is_reported(
    quasistatic: PhysicsBackend, massless_finger: ChainModel, study_law: Callable[..., JointLaw]
) -> None:
    law = study_law(domain=Domain(np.array([0.0, 10e3]), np.array([[-0.1, 0.3]])))
    result = perform(
        FreeBending(FreeBendingConfig(pressure_pa=15e3)), massless_finger.with_(laws=(law,)), quasistatic
    )
    worst = {(entry.module, entry.variable): entry for entry in result.final.outside_domain}
    assert len(worst) == 16
    assert worst[3, "pressure_pa"].excess == pytest.approx(5e3)
    assert worst[3, "angle_rad"].excess == pytest.approx(0.059718, abs=1e-6)
    assert worst[3, "angle_rad"].time_s == 1.0


@pytest.mark.parametrize("drive", [{}, {"pressure_pa": 1.0, "tendon_force_n": 1.0}])
def test_exactly_one_drive(drive: dict[str, float]) -> None:
    with pytest.raises(ValidationError, match="exactly one of 'pressure' and 'tendon_force'"):
        FreeBendingConfig(**drive)


def test_tendon_task_on_a_pressure_chain(quasistatic: PhysicsBackend, massless_finger: ChainModel) -> None:
    task = FreeBending(FreeBendingConfig(tendon_force="2 N"))
    with pytest.raises(
        UserError, match="gives 'tendon_force', but the laws of the chain are driven by pressure_pa"
    ):
        perform(task, massless_finger, quasistatic)
