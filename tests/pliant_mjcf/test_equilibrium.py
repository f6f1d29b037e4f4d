"""States of rest by Newton's method: they balance, are stable, and agree with dynamic relaxation."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from tests.pliant_mjcf.mjcf_models import ARM, pendulum

from pliant.records.design import Array
from pliant_mjcf import starts
from pliant_mjcf.config import SETTLED
from pliant_mjcf.equilibrium import settle
from pliant_mjcf.starts import AT_REST, hold_inputs, start_state

LIMITED = pendulum().replace('damping="0.0"', 'damping="0.0" limited="true" range="-0.2 0.2"')
SPINNING = pendulum().replace("<option", '<option gravity="0 0 0"')


def started(text: str, *control: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    hold_inputs(model, data, np.array(control))
    return model, data


def positions(text: str, *control: float) -> Array:
    model = mujoco.MjModel.from_xml_string(text)
    state = start_state(model, SETTLED, {}, (), np.array(control))
    return state[1 : 1 + model.nq]


@pytest.mark.parametrize(
    ("text", "control"),
    [
        (ARM.format(step=0.002, integrator="implicitfast", gain=1), (0.8, -0.1)),
        (ARM.format(step=0.002, integrator="implicitfast", gain=1), (-1.1, 0.2)),
        (LIMITED, (1.5,)),  # pushed against the limit
    ],
)
def test_rest_is_that_of_dynamic_relaxation(
    text: str, control: tuple[float, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    model, data = started(text, *control)
    assert settle(model, data, AT_REST) == "rest"
    assert np.abs(data.qacc).max() < 1e-6
    monkeypatch.setattr(starts, "settle", lambda *_: "unknown")
    assert data.qpos == pytest.approx(positions(text, *control), abs=1e-6)


def test_a_coordinate_without_limit_and_balance_has_no_rest() -> None:
    model, data = started(SPINNING, 0.5)
    assert settle(model, data, AT_REST) == "no rest"
    assert positions(SPINNING, 0.5) == pytest.approx([0.0])


def test_an_unstable_equilibrium_is_left_for_the_stable_one() -> None:
    model, data = started(pendulum(), 0.0)
    data.qpos[:] = np.pi - 0.3
    assert settle(model, data, AT_REST) == "unknown"


def test_dry_friction_is_left_to_relaxation() -> None:
    rough = pendulum().replace('damping="0.0"', 'damping="0.0" frictionloss="0.5"')
    model, data = started(rough, 2.0)
    assert settle(model, data, AT_REST) == "unknown"


def test_a_servo_between_limits_rests_where_its_force_is_the_weight() -> None:
    servo = '<position name="servo" joint="hinge" kp="50"/>'
    angle = positions(pendulum(actuator=servo), 0.4)[0]
    assert 50.0 * (0.4 - angle) == pytest.approx(9.81 * 0.5 * np.sin(angle), rel=1e-6)
