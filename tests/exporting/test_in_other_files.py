"""An exported robot in other files and programs: settings do not spread, and the message names what is needed."""

from pathlib import Path

import numpy as np
import pytest
from tests.exporting.test_mujoco_alone import FINGER
from tests.physics.conftest import needs_pybullet

from pliant import api
from pliant.pipeline.carried import carried_chain
from pliant.records.chain import ChainModel
from pliant_export.command import ACTS
from pliant_plugins.exporting.mjcf import write_mjcf
from pliant_plugins.exporting.urdf import write_urdf

# An arm in degrees, MuJoCo's default, whose inertia is that of its geom: google-deepmind/mujoco#2480.
ARM = """
<mujoco>
  {first}
  <worldbody>
    <body name="arm" pos="0 0 0.3">
      <joint name="lift" type="hinge" axis="0 1 0" range="-90 45"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.1" size="0.01" density="1000"/>
    </body>
  </worldbody>
  {second}
</mujoco>
"""
INCLUDE = '<include file="robot.xml"/>'
ARM_KG = 1000 * np.pi * (0.01**2 * 0.1 + 4 / 3 * 0.01**3)


@pytest.fixture(scope="module")
def chain(tmp_path_factory) -> ChainModel:
    path: Path = tmp_path_factory.mktemp("study") / "finger.yaml"
    path.write_text(FINGER)
    opened = api.open_study(path)
    return carried_chain(opened.context, opened.study).chain


@pytest.mark.parametrize(("first", "second"), [(INCLUDE, ""), ("", INCLUDE)], ids=["above", "below"])
def test_an_included_robot_leaves_the_other_model_as_it_is(
    chain: ChainModel, tmp_path: Path, first: str, second: str
):
    mujoco = pytest.importorskip("mujoco")
    write_mjcf(chain, tmp_path / "robot.xml")
    (tmp_path / "arm.xml").write_text(ARM.format(first=first, second=second))
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    assert model.joint("lift").range == pytest.approx(np.radians([-90, 45]))
    assert model.body("arm").mass == pytest.approx(ARM_KG, rel=1e-6)
    own = [float(model.body(f"body_{k}").mass[0]) for k in range(1, 9)]
    assert own == pytest.approx([body.mass_kg for body in chain.bodies[1:]], rel=1e-9)
    inertia = np.sort(np.linalg.eigvalsh(chain.bodies[1].inertia_kg_m2))
    assert np.sort(model.body("body_1").inertia)[1:] == pytest.approx(inertia[1:], rel=1e-3)


@needs_pybullet
def test_a_urdf_names_the_flag_by_which_pybullet_takes_its_inertias(chain: ChainModel, tmp_path: Path):
    """Bullet takes other inertias without the flag (Rhoban/onshape-to-robot#35), by a factor of 50."""
    import pybullet

    write_urdf(chain, tmp_path / "robot.urdf")
    flag = "URDF_USE_INERTIA_FROM_FILE"
    assert flag in ACTS["urdf"] and flag in (tmp_path / "robot.urdf").read_text()
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = pybullet.loadURDF(
            str(tmp_path / "robot.urdf"),
            useFixedBase=True,
            flags=getattr(pybullet, flag),
            physicsClientId=client,
        )
        count = pybullet.getNumJoints(body, physicsClientId=client)
        names = [pybullet.getJointInfo(body, j, physicsClientId=client)[12].decode() for j in range(count)]
        found = pybullet.getDynamicsInfo(body, names.index("body_1"), physicsClientId=client)[2]
    finally:
        pybullet.disconnect(client)
    inertia = np.sort(np.linalg.eigvalsh(chain.bodies[1].inertia_kg_m2))
    assert np.sort(found)[1:] == pytest.approx(inertia[1:], rel=0.05)  # the file's have a floor of 1e-9 kg·m²
