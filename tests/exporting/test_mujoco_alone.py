"""An exported robot in plain MuJoCo settles where Pliant predicts, in a separate process without Pliant."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.exporting.alone import run_alone
from tests.mechanics.test_several_actuations import make_chain, several_law

from pliant import api
from pliant.pipeline.carried import carried_chain
from pliant.records.chain import Actuator
from pliant.records.law import EXTENSIBLE_AXES
from pliant.records.mount import Mount
from pliant.records.rollout import Inputs
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig

LOADS_KG = (0.0, 0.01, 0.02, 0.05)
CLOSE_M = 5e-5
LAW = """
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
  domain: {actuation: [0 kPa, 16 kPa], deformation: [-0.6, 0.7]}
"""
FINGER = f"""
pliant: 1
name: finger
{LAW}
chain: {{modules: 8, module_length: 11 mm, module_mass: 1.1 g, module_radius: 7 mm}}
task: {{kind: tip_load, pressure: 15 kPa, payload: 5 g}}
"""
OPPOSED = FINGER.replace(
    "modules: 8,",
    "modules: 4, actuators: [{input: pressure_1_pa, sign: 1}, {input: pressure_2_pa, sign: -1}],",
)
SCRIPT = """
import robot_law
model, data = robot_law.load()
tip = model.body("tip").id
said = []
for load, inputs in CASES:
    for name, value in inputs.items():
        data.ctrl[model.actuator(name).id] = value
    data.xfrc_applied[tip, 2] = -9.81 * load
    settled = robot_law.settle(model, data)
    said.append([settled, *data.site("tip").xpos, robot_law.outside(model, data)])
"""


def settled_tips(study: str | Path, folder: Path, inputs: dict[str, float], loads=LOADS_KG) -> None:
    """Export, settle alone under each load, compare with the quasi-static engine."""
    if not isinstance(study, Path):
        (folder / "robot.yaml").write_text(study)
        study = folder / "robot.yaml"
    opened = api.open_study(study, store=folder / "store")
    chain = carried_chain(opened.context, opened.study).chain
    Mujoco(MujocoConfig()).export(chain, folder / "robot.xml")
    found = run_alone(SCRIPT.replace("CASES", repr([(load, inputs) for load in loads])), folder)
    with Quasistatic(QuasistaticConfig()).build(chain) as simulation:
        for load, (settled, *tip, _) in zip(loads, found, strict=True):
            simulation.apply(Inputs(inputs, np.array([0.0, 0.0, -9.81 * load])))
            ours = simulation.settle()
            assert settled and ours.converged
            assert np.linalg.norm(ours.tip_m - tip) < CLOSE_M


def test_a_finger_with_eight_modules_under_loads(tmp_path) -> None:
    settled_tips(FINGER, tmp_path, {"pressure_pa": 15e3})


def test_a_law_with_two_pressures_takes_both(tmp_path) -> None:
    """The study has a table of two pressures, its law in every joint, gravity and a load at the tip."""
    from tests.cli.test_fit_table import two_chambers

    rows = [",".join(map(repr, map(float, row))) for row in two_chambers()]
    head = "pressure_1_pa,pressure_2_pa,angle_rad,moment_n_m"
    (tmp_path / "bench.csv").write_text("\n".join([head, *rows]))
    study = FINGER.replace(LAW, "surrogate: {kind: polynomial, data: bench.csv}\n").replace(
        "modules: 8", "modules: 4"
    )
    settled_tips(study, tmp_path, {"pressure_1_pa": 12e3, "pressure_2_pa": 3e3}, loads=(0.0, 0.01))


def test_opposed_chambers_take_two_inputs(tmp_path) -> None:
    settled_tips(OPPOSED, tmp_path, {"pressure_1_pa": 12e3, "pressure_2_pa": 3e3}, (0.0,))


def test_a_chain_with_ball_joints_under_loads(tmp_path) -> None:
    helix = Path(__file__).parents[2] / "examples" / "helix" / "helix.yaml"
    settled_tips(helix, tmp_path, {"pressure_pa": 15e3})


def test_segments_that_bend_twist_and_grow_under_separate_pressures(tmp_path) -> None:
    """Balls with slides, laws of two pressures and four coordinates; the load acts along and across."""
    law = several_law(2, EXTENSIBLE_AXES)
    own = [tuple(Actuator(f"pressure_{2 * s + k}_pa") for k in (1, 2)) for s in range(2)]
    chain = make_chain(law, 2, 2, own, gravity=[1.0, 2.0, -9.0])
    Mujoco(MujocoConfig()).export(chain, tmp_path / "robot.xml")
    inputs = {f"pressure_{k}_pa": 4e3 * k for k in range(1, 5)}
    said = SCRIPT.replace("CASES", repr([(load, inputs) for load in (0.0, 0.02)]))
    found = run_alone(said.replace("robot_law.outside(model, data)", "list(data.qpos)"), tmp_path)
    with Quasistatic(QuasistaticConfig()).build(chain) as simulation:
        for load, (settled, *tip, qpos) in zip((0.0, 0.02), found, strict=True):
            simulation.apply(Inputs(inputs, np.array([0.0, 0.0, -9.81 * load])))
            ours = simulation.settle()
            assert settled and ours.converged
            assert np.linalg.norm(ours.tip_m - tip) < 1e-6
            np.testing.assert_allclose(qpos[4::5], ours.joint_angles[:, 3], atol=1e-8)
            assert np.abs(ours.joint_angles[:, 3]).max() > 1e-5


def test_it_moves_on_its_own_and_leaves_other_models_alone(tmp_path) -> None:
    """Released from rest under pressure it swings about the equilibrium; a model without laws is not changed."""
    (tmp_path / "robot.yaml").write_text(FINGER)
    opened = api.open_study(tmp_path / "robot.yaml", store=tmp_path / "store")
    chain = carried_chain(opened.context, opened.study).chain
    Mujoco(MujocoConfig()).export(chain, tmp_path / "robot.xml")
    swings, spring = run_alone(
        "import mujoco, numpy as np, robot_law\nmodel, data = robot_law.load()\n"
        "robot_law.pause()\nplain = mujoco.MjModel.from_xml_path('robot.xml')\n"
        "robot_law.resume()\nother = mujoco.MjData(plain)\n"
        "data.ctrl[0] = other.ctrl[0] = 15e3\nseen = []\n"
        "for _ in range(2000):\n"
        "    mujoco.mj_step(model, data); mujoco.mj_step(plain, other); seen.append(float(data.qpos[0]))\n"
        "robot_law.settle(model, data)\nseen = np.array(seen) - data.qpos[0]\n"
        "said = [[float(seen.min()), float(seen.max()), float(abs(seen[-1]))], float(abs(other.qpos).max())]",
        tmp_path,
    )
    assert swings[0] < -0.1 and swings[1] > 0.0 and swings[2] < 0.05
    assert spring < 0.2  # the weights alone, against the stiffness at rest


ARM = """
<mujoco model="arm">
  <compiler angle="degree"/>
  <option integrator="Euler" timestep="0.004"/>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 0.1" pos="0 0 -2"/>
    <body name="upper" pos="0.1 0 1">
      <joint name="shoulder" axis="0 1 0" armature="1" damping="20"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" density="500"/>
      <site name="flange" pos="0.4 0 0" euler="0 -20 40"/>
      <body name="hand" pos="0.4 0.1 0" euler="0 -20 0"/>
    </body>
  </worldbody>
  <actuator><position name="servo" joint="shoulder" kp="2000"/></actuator>
</mujoco>
"""


@pytest.mark.parametrize("at", ["flange", "hand"])
def test_a_finger_on_a_foreign_arm(tmp_path, at) -> None:
    """The finger settles in one model as in Pliant with its base there, and the arm carries its weight."""
    (tmp_path / "robot.yaml").write_text(FINGER)
    (tmp_path / "arm.xml").write_text(ARM)
    opened = api.open_study(tmp_path / "robot.yaml", store=tmp_path / "store")
    chain = carried_chain(opened.context, opened.study).chain
    Mujoco(MujocoConfig()).export(chain, tmp_path / "robot.xml")
    kind = "site" if at == "flange" else "body"
    settled, place, turn, tip, names = run_alone(
        f"import mujoco, robot_law\nmodel, data = robot_law.mount('arm.xml', '{at}', 'left_')\n"
        "data.ctrl[model.actuator('left_pressure_pa').id] = 12e3\n"
        "data.ctrl[model.actuator('servo').id] = data.joint('shoulder').qpos[0] = 0.5\n"
        "settled = robot_law.settle(model, data, tolerance=1e-6, step_s=model.opt.timestep)\n"
        f"here = data.{kind}('{at}')\n"
        "said = [settled, list(here.xpos), list(here.xmat), list(data.site('left_tip').xpos),\n"
        "        [model.body(k).name for k in range(model.nbody)]]",
        tmp_path,
    )
    rotation = np.reshape(turn, (3, 3))
    mounted = chain.with_(
        base_position_m=place + rotation @ chain.base_position_m,
        base_rotation=rotation @ chain.base_rotation,
    )
    with Quasistatic(QuasistaticConfig()).build(mounted) as simulation:
        simulation.apply(Inputs({"pressure_pa": 12e3}))
        ours = simulation.settle()
    assert settled and ours.converged and {"hand", "left_base", "left_tip"} <= set(names)
    assert np.linalg.norm(ours.tip_m - tip) < CLOSE_M


def test_a_mounted_robot_begins_where_the_study_put_its_arm(tmp_path) -> None:
    """The arm's keyframe is merged with the joints and commands of the study."""
    keyed = ARM.replace("</mujoco>", '<keyframe><key name="home" qpos="0.2" ctrl="0.2"/></keyframe></mujoco>')
    (tmp_path / "arm.xml").write_text(keyed)
    (tmp_path / "robot.yaml").write_text(FINGER)
    opened = api.open_study(tmp_path / "robot.yaml", store=tmp_path / "store")
    chain = carried_chain(opened.context, opened.study).chain
    script = (
        "import robot_law\nmodel, data = robot_law.mount('arm.xml', 'flange', 'left_')\n"
        "said = [float(data.joint('shoulder').qpos[0]), float(data.actuator('servo').ctrl[0])]"
    )
    for joints, wanted in (({}, 0.2), ({"shoulder": 0.7}, 0.7)):
        # a separate folder: Python loads a module rewritten within one second at the same size from its cache
        folder = tmp_path / f"at_{wanted}"
        folder.mkdir()
        (folder / "arm.xml").write_text(keyed)
        mounted = chain.with_(mount=Mount(tmp_path / "arm.xml", "flange", joints=joints))
        Mujoco(MujocoConfig()).export(mounted, folder / "robot.xml")
        assert run_alone(script, folder) == [wanted, wanted]


def test_a_place_that_the_arm_does_not_have_is_named(tmp_path) -> None:
    (tmp_path / "robot.yaml").write_text(FINGER)
    (tmp_path / "arm.xml").write_text(ARM)
    opened = api.open_study(tmp_path / "robot.yaml", store=tmp_path / "store")
    Mujoco(MujocoConfig()).export(carried_chain(opened.context, opened.study).chain, tmp_path / "robot.xml")
    said = run_alone(
        "import robot_law\ntry:\n    robot_law.mount('arm.xml', 'wrist')\nexcept ValueError as e:\n    said = str(e)",
        tmp_path,
    )
    assert said == "arm.xml has no site or body 'wrist'; it has flange, world, upper, hand."


EFFECTS = (
    FINGER
    + "effects: [{kind: gravity_scale, factor: 0.8}, {kind: viscous_damping, time: 0.1 s},"
    + " {kind: pressure_offset, offset: 1 kPa}]\n"
)


def test_what_cannot_be_carried_is_said(tmp_path) -> None:
    (tmp_path / "robot.yaml").write_text(EFFECTS)
    opened = api.open_study(tmp_path / "robot.yaml", store=tmp_path / "store")
    carried = carried_chain(opened.context, opened.study)
    said = " ".join(carried.sentences)
    assert "viscous_damping (it has a memory, or needs time)" in said and "pressure_offset" in said
    assert "gravity_scale" not in said and "no mass" not in said
    light = replace(
        carried,
        chain=carried.chain.with_(bodies=tuple(replace(b, mass_kg=0.0) for b in carried.chain.bodies)),
    )
    assert "give chain.module_mass" in " ".join(light.sentences)
    np.testing.assert_allclose(carried.chain.gravity_m_s2, [0.0, 0.0, -0.8 * 9.81])
