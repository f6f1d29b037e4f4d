"""A chain on another robot's arm: the result on a fixed base at the same pose, and the arm deflects as in statics."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pliant.config.chain import MountConfig
from pliant.errors import UserError
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.rotations import exp_map
from pliant.records.chain import ChainModel
from pliant.records.mount import Mount
from pliant.records.rollout import Inputs
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig

ENGINE = Mujoco(MujocoConfig())
PLACE, TURN = np.array([0.3, -0.1, 0.4]), np.array([0.4, -0.7, 0.3])
KP, HINGE_STIFFNESS, LINK_M = 50.0, 0.8, 0.2
WELDED = """
<mujoco><worldbody><body name="link" pos="0.3 -0.1 0.4" quat="{quat}">
  <inertial pos="0 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/><site name="flange"/></body></worldbody></mujoco>
"""
HINGED = f"""
<mujoco><compiler angle="radian" autolimits="true"/><option timestep="0.002" gravity="0 0 0"/>
  <worldbody><body name="link" pos="0 0 0.5">
    <inertial pos="0 0 0" mass="0.05" diaginertia="1e-4 1e-4 1e-4"/>
    <joint name="hinge" axis="0 -1 0" stiffness="{{stiffness}}" damping="0.01"/>
    <site name="flange" pos="{LINK_M} 0 0"/></body></worldbody>
  {{more}}</mujoco>
"""
SERVO = f"""<actuator><position name="servo" joint="hinge" kp="{KP}" kv="1"/></actuator>
  <keyframe><key name="home" qpos="0.3" ctrl="0.3"/><key name="down" qpos="-0.6" ctrl="-0.6"/></keyframe>"""


def arm(folder: Path, text: str, at: str = "flange", **more: object) -> Mount:
    (folder / "arm.xml").write_text(text)
    return Mount(folder / "arm.xml", at, **more)  # type: ignore[arg-type]


def hinged(folder: Path, stiffness: float = 0.0, more: str = SERVO, **told: object) -> Mount:
    return arm(folder, HINGED.format(stiffness=stiffness, more=more), **told)


def settled(chain: ChainModel, pressure_pa: float = 9e3, engine: object = ENGINE):
    with engine.build(chain) as simulation:  # type: ignore[attr-defined]
        simulation.apply(Inputs({"pressure_pa": pressure_pa}, np.array([0.0, 0.02, 0.01])))
        return simulation.settle()


def fixed(chain: ChainModel, place: np.ndarray, rotation: np.ndarray) -> ChainModel:
    """Return the chain with its base fixed at the pose of a mount's frame."""
    return chain.with_(
        mount=None,
        base_position_m=rotation @ chain.base_position_m + place,
        base_rotation=rotation @ chain.base_rotation,
    )


@pytest.fixture(params=["revolute", "spherical"])
def chain(request, make_finger):
    found = make_finger(request.param, 4)
    return found.with_(base_position_m=np.array([0.01, 0.02, 0.03]), payload_kg=0.01)


def test_on_a_welded_arm_it_stands_as_on_a_base_there(tmp_path, chain):
    half = np.linalg.norm(TURN) / 2
    quat = [np.cos(half), *(np.sin(half) / (2 * half) * TURN)]
    mount = arm(tmp_path, WELDED.format(quat=" ".join(map(repr, map(float, quat)))))
    found = settled(chain.with_(mount=mount))
    wanted = settled(fixed(chain, PLACE, exp_map(TURN)))
    assert found.converged
    assert np.abs(found.markers_m - wanted.markers_m).max() < 1e-6
    assert np.allclose(found.carrier.on_mount(found.tip_m), exp_map(TURN).T @ (found.tip_m - PLACE))


def test_a_soft_hinge_yields_as_the_moment_balance_says(tmp_path, chain):
    found = settled(chain.with_(mount=hinged(tmp_path, HINGE_STIFFNESS, "")))
    assert found.converged
    # the chain in its settled pose, on a base at the turned hinge's pose
    q, carrier = float(found.carrier.coordinates[0]), found.carrier
    placed = fixed(chain, carrier.position_m, carrier.rotation)
    again = settled(placed)
    assert np.abs(found.markers_m - again.markers_m).max() < 1e-6
    # the turn of the hinge by the chain's weights, payload and tip force
    pose, hinge = ChainGeometry.from_chain(placed).forward(again.joint_angles), np.array([0.0, 0.0, 0.5])
    gravity = np.asarray(placed.gravity_m_s2)
    moment = np.cross(again.tip_m - hinge, placed.payload_kg * gravity + [0.0, 0.02, 0.01])
    assert placed.bodies[0].mass_kg > 0.0  # the piece on the base hangs on the arm, too
    for k, body in enumerate(placed.bodies):
        centre = pose.origins[k] + pose.rotations[k] @ body.com_m
        moment = moment + np.cross(centre - hinge, body.mass_kg * gravity)
    assert -moment[1] == pytest.approx(HINGE_STIFFNESS * q, abs=1e-8)  # the link's own centre is on the hinge
    assert abs(q) > 0.01


@pytest.mark.parametrize(
    ("told", "command"), [({"keyframe": "down"}, -0.6), ({"joints": {"hinge": 0.9}}, 0.9)]
)
def test_a_moved_joint_turns_gravity(tmp_path, chain, told, command):
    found = settled(chain.with_(mount=hinged(tmp_path, **told)))
    carrier = found.carrier
    assert float(carrier.coordinates[0]) == pytest.approx(command, abs=5e-3)  # the servo deflects a little
    wanted = settled(
        fixed(chain, carrier.position_m, carrier.rotation), engine=Quasistatic(QuasistaticConfig())
    )
    assert np.abs(found.markers_m - wanted.markers_m).max() < 1e-6


def test_in_time_both_come_to_the_rest_that_settle_finds(tmp_path, make_finger):
    chain = make_finger("revolute", 3).with_(mount=hinged(tmp_path))
    wanted = settled(chain)
    with ENGINE.build(chain) as simulation:
        simulation.apply(Inputs({"pressure_pa": 9e3}, np.array([0.0, 0.02, 0.01])))
        start = simulation.snapshot()
        simulation.step(0.3)
        moved = simulation.markers()
        simulation.step(4.0)
        assert np.abs(simulation.markers() - wanted.markers_m).max() < 2e-5
        simulation.restore(start)
        simulation.step(0.3)
        assert np.array_equal(simulation.markers(), moved)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"at": "flang"}, "did you mean 'flange'"),
        ({"keyframe": "hom"}, "did you mean 'home'"),
        ({"joints": {"hinges": 1.0}}, "did you mean 'hinge'"),
        ({"ctrl": {"serv": 1.0}}, "did you mean 'servo'"),
        ({"file": Path("arms.xml")}, "is no file"),
    ],
)
def test_what_is_not_there_is_named(tmp_path, changes, word):
    with pytest.raises(UserError, match=word):
        ENGINE.check_mount(replace(hinged(tmp_path), **changes))


def test_a_length_is_no_hinge_position(tmp_path):
    written = {"file": hinged(tmp_path).file, "at": "flange", "joints": {"hinge": "20 mm"}}
    with pytest.raises(UserError, match="'hinge' is a hinge; give an angle such as '30 deg'"):
        ENGINE.check_mount(MountConfig.model_validate(written).record())
    ENGINE.check_mount(MountConfig.model_validate({**written, "joints": {"hinge": "20 deg"}}).record())
    ENGINE.check_mount(MountConfig.model_validate({**written, "joints": {"hinge": 0.2}}).record())


def test_a_floating_arm_and_no_mjcf_are_refused(tmp_path):
    with pytest.raises(UserError, match="moves freely"):
        ENGINE.check_mount(arm(tmp_path, WELDED.format(quat="1 0 0 0").replace("<site", "<freejoint/><site")))
    with pytest.raises(UserError, match="no MJCF"):
        ENGINE.check_mount(arm(tmp_path, "<arm name='a'/>"))


def test_dry_friction_carries_nothing_at_rest(tmp_path, make_finger):
    chain = make_finger("revolute", 3)
    smooth = settled(chain.with_(mount=hinged(tmp_path)))
    rough = hinged(tmp_path)
    rough.file.write_text(
        rough.file.read_text().replace('damping="0.01"', 'damping="0.01" frictionloss="0.2"')
    )
    found = settled(chain.with_(mount=rough))
    assert found.converged and np.abs(found.markers_m - smooth.markers_m).max() < 1e-9


def test_names_that_both_have_stay_apart(tmp_path, make_finger):
    text = WELDED.format(quat="1 0 0 0").replace('name="link"', 'name="soft_base"')
    chain = make_finger("revolute", 2)
    found = settled(chain.with_(mount=arm(tmp_path, text)))
    assert np.abs(found.markers_m - settled(fixed(chain, PLACE, np.eye(3))).markers_m).max() < 1e-6


def test_a_box_on_the_floor_a_metre_away_changes_nothing(tmp_path, make_finger):
    box = '<body pos="1 0 0.03"><freejoint/><geom type="box" size=".03 .03 .03" mass=".1"/></body>'
    floor = '<geom size="0 0 .05" type="plane"/>'
    chain = make_finger("revolute", 4)
    alone = settled(chain.with_(mount=hinged(tmp_path)))
    text = HINGED.format(stiffness=0.0, more=SERVO.replace('qpos="', 'qpos="1 0 0.03 1 0 0 0 '))
    beside = settled(
        chain.with_(mount=arm(tmp_path, text.replace("<worldbody>", f"<worldbody>{floor}{box}")))
    )
    assert alone.converged and beside.converged
    assert np.abs(alone.markers_m - beside.markers_m).max() < 1e-9
