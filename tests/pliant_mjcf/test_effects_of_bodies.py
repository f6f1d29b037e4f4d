"""Effects at bodies and the world of MuJoCo models, each by a physical law."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco")

from tests.pliant_mjcf.stepping import changes, compiled, effect, exported, moved, pendula, rotor
from tests.pliant_mjcf.test_effects import crossings

from pliant.errors import UserError
from pliant.mechanics.rotations import exp_map

# m l² + J about the hinge, of the pendulum in `stepping`.
ABOUT_HINGE = 1.0 * 0.5**2 + 0.01
G = 9.81


def period(about_hinge: float, moment: float) -> float:
    return float(2 * np.pi * np.sqrt(about_hinge / moment))


def swung(*effects: Any) -> float:
    run = moved(pendula(), *effects, q=[[0.05, 0.0]], seconds=4.0)
    return crossings(run.q[:, 0, 0])


def test_a_mass_changes_the_period_on_a_spring_and_not_under_gravity() -> None:
    heavy = effect("body_mass", factor=2.0)
    assert swung(heavy) == pytest.approx(swung(), rel=1e-3)
    on_spring = moved(rotor('stiffness="1"'), heavy, q=[[0.3]], seconds=3.0)
    assert crossings(on_spring.q[:, 0, 0]) == pytest.approx(2 * np.pi * np.sqrt(0.02), rel=0.01)


def test_an_inertia_changes_the_period_as_steiner_says() -> None:
    wanted = period(0.25 + 0.05, G * 0.5)
    assert swung(effect("body_inertia@left", factor=5.0)) == pytest.approx(wanted, rel=0.005)


@pytest.mark.parametrize(("site", "arm"), [("tip", 0.5), ("", 0.0)])
def test_a_payload_changes_the_period_by_its_own_arm(site: str, arm: float) -> None:
    load = effect("payload@left", mass_kg=2.0, site=site)
    wanted = period(ABOUT_HINGE + 2.0 * arm**2, G * (0.5 + 2.0 * arm))
    assert swung(load) == pytest.approx(wanted, rel=0.005)


def test_a_payload_is_the_body_that_mujoco_makes_of_two_geoms() -> None:
    parts = """<mujoco><worldbody><body name="a" pos="0 0 1"><joint/><site name="far" pos="0.3 -0.2 0.1"/>
    <geom type="box" size="0.1 0.2 0.3" pos="0.1 0 0.05" euler="10 20 30" mass="2"/>{more}</body>
</worldbody></mujoco>"""
    point = '<geom size="0.001" pos="0.3 -0.2 0.1" mass="0.7"/>'
    both = compiled(parts.format(more=point))
    one = compiled(parts.format(more=""), effect("payload", mass_kg=0.7, site="far"))
    for name in ("body_mass", "body_ipos", "body_inertia", "dof_M0"):
        there, here = getattr(both, name), getattr(one, name)
        assert np.allclose(np.sort(there, axis=-1), np.sort(here, axis=-1), rtol=1e-4, atol=1e-12), name


def test_payloads_need_their_site() -> None:
    with pytest.raises(UserError, match="has no site 'hand'"):
        compiled(pendula(), effect("payload@left", mass_kg=1.0, site="hand"))
    with pytest.raises(UserError, match="is on none of its bodies"):
        compiled(pendula(), effect("payload@right", mass_kg=1.0, site="tip"))


def test_a_centre_of_mass_aside_hangs_at_its_angle() -> None:
    run = moved(pendula('damping="0.5"'), effect("centre_of_mass@left", x_m=0.1), q=[[0.0, 0.0]], seconds=8.0)
    assert run.q[-1, 0] == pytest.approx([np.arctan(0.1 / 0.5), 0.0], abs=1e-3)


def test_a_free_symmetric_body_gets_another_centre_of_mass() -> None:
    """MuJoCo compiles it with a diagonal mass matrix, which then is no longer right."""
    mjcf = rotor().replace('<joint name="hinge" axis="0 1 0" />', "<freejoint/>")
    model = compiled(mjcf, effect("centre_of_mass", x_m=0.05))
    assert model.dof_M0[5] == pytest.approx(0.01 + 0.05**2, rel=1e-6)
    turning = moved(mjcf, effect("centre_of_mass", x_m=0.05), q=[[0.0, 0.0, 1.0, 1.0]], v=[[0.0] * 5 + [2.0]])
    centre = turning.q[:, 0, :2] + 0.05 * np.array(
        [[np.cos(2 * t), np.sin(2 * t)] for t in np.arange(1000) * 1e-3]
    )
    assert np.abs(centre[:, 0] - 0.05).max() < 1e-3  # the centre moves in a straight line


def test_gravity_scales_the_period() -> None:
    assert swung(effect("gravity_scale", factor=0.5)) == pytest.approx(
        period(ABOUT_HINGE, 0.5 * G * 0.5), rel=0.005
    )


@pytest.mark.parametrize("kind", ["gravity_direction", "base_misalignment"])
def test_a_tilt_changes_the_angle_at_which_it_hangs(kind: str) -> None:
    gravity = kind == "gravity_direction"
    tilt = effect(kind, **({"about_y_rad": 0.2} if gravity else {"pitch_rad": 0.2}))
    run = moved(pendula('damping="0.5"'), tilt, q=[[0.0, 0.0]], seconds=8.0)
    assert run.q[-1, 0] == pytest.approx(2 * [0.2 if gravity else -0.2], abs=1e-3)


def test_a_turned_base_is_gravity_and_the_frame_turned_back() -> None:
    """Roll, pitch and yaw together: the joints move as under gravity R'g, and sites are at R times those."""
    turn = exp_map(np.array([0.1, -0.3, 0.2]))
    one = moved(
        pendula(), effect("base_misalignment", roll_rad=0.1, pitch_rad=-0.3, yaw_rad=0.2), q=[[0.3, 0.1]]
    )
    gravity = " ".join(str(x) for x in turn.T @ np.array([0.0, 0.0, -G]))
    back = moved(pendula().replace("<option ", f'<option gravity="{gravity}" '), q=[[0.3, 0.1]])
    assert np.abs(one.q - back.q).max() < 1e-9
    assert np.abs(one.sites - back.sites @ turn.T).max() < 1e-9


FLOOR = """<mujoco><option timestep="0.001" gravity="3 0 -9.81" cone="elliptic"/><worldbody>
<geom name="floor" type="plane" size="9 9 9" friction="{floor} 0.005 0.0001"/>
<body name="box" pos="0 0 0.0999"><freejoint/>
<geom type="box" size="0.2 0.2 0.1" mass="1" friction="{box} 0.005 0.0001"/>
</body></worldbody></mujoco>"""


@pytest.mark.parametrize(("floor", "box"), [(0.4, 0.4), (0.4, 0.1), (0.1, 0.4)])
def test_a_slippery_floor_lets_the_box_slide(floor: float, box: float) -> None:
    """a = g_x − f μ g_z once f μ is below g_x / g_z = 0.31, μ the larger of both."""
    mjcf = FLOOR.format(floor=floor, box=box)
    held, slides = (
        moved(mjcf, *e, q=[[]], seconds=0.8).v[-1, 0, 0]
        for e in ((), (effect("floor_friction", factor=0.5),))
    )
    assert abs(held) < 0.01 and slides == pytest.approx(0.8 * (3.0 - 0.2 * G), rel=0.03)
    assert (
        abs(moved(FLOOR.format(floor=0.2, box=0.1), effect("floor_friction", factor=2.0), q=[[]]).v[-1, 0, 0])
        < 0.01
    )


@pytest.mark.parametrize(("kind", "mjcf", "words"), [
    ("floor_friction", pendula(), "no geom of the world can touch another"),
    ("base_misalignment", "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>", "hangs"),
    ("tendon_friction", pendula(), "the model has no tendon"),
    ("joint_play", pendula(), "needs a position drive"),
])  # fmt: skip
def test_what_a_model_does_not_have_is_refused(kind: str, mjcf: str, words: str) -> None:
    values = {
        "tendon_friction": {"force_n": 1.0},
        "joint_play": {"play_rad": 0.1},
        "base_misalignment": {"yaw_rad": 0.1},
    }
    with pytest.raises(UserError, match=words) as caught:
        moved(mjcf, effect(kind, **values.get(kind, {})), q=[[]])
    assert "\n" not in str(caught.value)


ROBOT = """<mujoco><compiler angle="degree" {compiler}/><worldbody>
<geom name="floor" type="plane" size="1 1 1" friction="0.6 0.005 0.0001"/>
<frame pos="0 0 1" euler="0 0 30"><site name="mark"/>
<body name="a" euler="0 10 0"><joint axis="0 1 0"/><geom size="0.1 0.2" type="capsule" pos="0.2 0 0" euler="0 30 0"/>
<body name="b" pos="0.5 0 0"><joint axis="0 1 0"/><inertial pos="0.1 0 0" mass="1" fullinertia="2 2 2 0.1 0.2 0.3"/>
<geom size="0.1"/></body></body></frame><body name="c" pos="1 0 0.3" axisangle="1 0 0 20"><joint axis="1 0 0"/>
<geom size="0.1" type="box" condim="1"/></body></worldbody></mujoco>""".replace(
    'size="0.1" type="box"', 'size="0.1 0.2 0.3" type="box"'
)
NUMBERS = (
    "body_mass",
    "body_ipos",
    "body_inertia",
    "body_pos",
    "body_quat",
    "geom_friction",
    "dof_M0",
    "site_pos",
)


@pytest.mark.parametrize("compiler", ["", 'inertiafromgeom="true"', 'settotalmass="7"'])
@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("body_mass@a", {"factor": 2.0}),
        ("centre_of_mass@b", {"x_m": 0.1, "z_m": -0.05}),
        ("body_inertia", {"factor": 2.0}),
        ("payload@c", {"mass_kg": 2.0}),
        ("gravity_scale", {"factor": 0.9}),
        ("gravity_direction", {"about_x_rad": 0.9}),
        ("base_misalignment", {"pitch_rad": 0.3, "yaw_rad": -0.2}),
        ("floor_friction", {"factor": 0.5}),
    ],
)
def test_an_improved_file_has_the_bodies(kind: str, values: dict[str, float], compiler: str) -> None:
    mjcf = ROBOT.format(compiler=compiler)
    found, wanted, before = (
        exported(mjcf, effect(kind, **values)),
        compiled(mjcf, effect(kind, **values)),
        compiled(mjcf),
    )
    same = [np.allclose(getattr(wanted, name), getattr(before, name)) for name in NUMBERS]
    assert not all(same) or not np.allclose(wanted.opt.gravity, before.opt.gravity)
    assert np.allclose(found.opt.gravity, wanted.opt.gravity, atol=1e-5)
    for name in NUMBERS:
        assert np.allclose(getattr(found, name), getattr(wanted, name), rtol=1e-4, atol=1e-5), name


def test_changes_are_values() -> None:
    """A model compiles once for equal changes, in any process."""
    a, b, c = (effect("centre_of_mass", x_m=x) for x in (0.1, 0.2, 0.1))
    assert changes(a)[0] == changes(b)[0] and changes(a) == changes(c) != changes(b)
    assert (
        pickle.loads(pickle.dumps(changes(a))) == changes(a)
        and len({changes(a), changes(b), changes(c)}) == 2
    )
