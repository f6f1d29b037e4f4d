"""`pliant export`: files that plain MuJoCo and plain PyBullet load, with the chain's masses and positions."""

import importlib.util
import json
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from pliant.registry.component import Component
from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig

BELLOW = """\
pliant: 1
name: bellow
family:
  kind: bellow_bending
  inner_radius: 2 mm
  average_radius: 6 mm
  wall: 1.5 mm
  module_length: 11 mm
material: {kind: neo_hookean, shear_modulus: 240 kPa, density: 1150 kg/m^3}
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
chain:
  segments: [{modules: 2}, {modules: 2, rotation: 90 deg}]
  base: {position: [0.1, 0.2, 0.3], direction: [1, 0, 0]}
  payload: 5 g
"""
LENGTH_M, MODULES = 0.011, 4
needs_pybullet = pytest.mark.skipif(
    importlib.util.find_spec("pybullet") is None, reason="pybullet is not installed"
)


@pytest.fixture
def study(workplace: Path) -> Path:
    path = workplace / "bellow.yaml"
    path.write_text(BELLOW)
    return path


def module_mass_kg() -> float:
    config = BellowBendingConfig(
        kind="bellow_bending",
        inner_radius_m=0.002,
        average_radius_m=0.006,
        wall_m=0.0015,
        module_length_m=LENGTH_M,
    )
    mass = BellowBending(config).mass(1150.0)
    return mass.start.mass_kg + mass.end.mass_kg


def test_mjcf_loads_in_plain_mujoco(pliant, study, workplace) -> None:
    call = pliant("export", study, "--out", "out/robot.xml", "--json", "done.json").done()
    assert "robot_law.py" in call.out and "data.ctrl takes the inputs" in call.out
    model = mujoco.MjModel.from_xml_path(str(workplace / "out" / "robot.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert model.njnt == MODULES and model.nmesh == 2
    # Four modules, of which the first half is fixed to the base, and the payload: an arm carries all of it.
    np.testing.assert_allclose(model.body_mass.sum(), 4 * module_mass_kg() + 0.005, rtol=1e-6)
    np.testing.assert_allclose(data.body("tip").xpos, [0.1 + MODULES * LENGTH_M, 0.2, 0.3], atol=1e-9)
    np.testing.assert_allclose(model.jnt_stiffness, 0.0245, rtol=1e-9)
    shown = model.geom_group == 2
    assert shown.sum() == 2 * MODULES and not model.geom_contype[shown].any()
    files = json.loads((workplace / "done.json").read_text())["files"]
    assert [Path(file).is_file() for file in files] == [True] * 5
    assert [model.actuator(k).name for k in range(model.nu)] == ["pressure_pa"]
    assert model.site("tip").id >= 0 and model.nsensor == 2 + 2 * MODULES


def test_the_exported_mjcf_moves_like_a_spring(pliant, study, workplace) -> None:
    """Plain MuJoCo settles where k u balances the weights, as in linear statics of the same chain."""
    assert pliant("export", study, "--out", "robot.xml").code == 0
    model = mujoco.MjModel.from_xml_path("robot.xml")
    data = mujoco.MjData(model)
    model.dof_damping[:] = 1e-3
    for _ in range(3000):
        mujoco.mj_step(model, data)
    assert np.abs(data.qvel).max() < 1e-6
    mujoco.mj_forward(model, data)
    weights = -data.qfrc_bias  # at rest: gravity in joint coordinates
    np.testing.assert_allclose(model.jnt_stiffness * data.qpos, weights, atol=1e-8)
    assert np.abs(data.qpos).max() > 0.05


@needs_pybullet
def test_urdf_loads_in_plain_pybullet(pliant, study, workplace, monkeypatch) -> None:
    import pybullet

    assert pliant("export", study, "--out", "out/robot.urdf").code == 0
    monkeypatch.chdir("/")  # mesh paths are relative to the file, independent of the working folder
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = pybullet.loadURDF(
            str(workplace / "out" / "robot.urdf"),
            useFixedBase=True,
            flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
            physicsClientId=client,
        )
        links = {
            pybullet.getJointInfo(body, j, physicsClientId=client)[12].decode(): j
            for j in range(pybullet.getNumJoints(body, physicsClientId=client))
        }
        assert list(links) == ["base", "body_1", "body_2", "body_3", "body_4", "tip", "base_piece"]
        masses = [pybullet.getDynamicsInfo(body, j, physicsClientId=client)[0] for j in links.values()]
        np.testing.assert_allclose(sum(masses), 4 * module_mass_kg() + 0.005, rtol=1e-6)
        tip = pybullet.getLinkState(
            body, links["tip"], computeForwardKinematics=True, physicsClientId=client
        )[4]
        np.testing.assert_allclose(tip, [0.1 + MODULES * LENGTH_M, 0.2, 0.3], atol=1e-6)
        assert len(pybullet.getVisualShapeData(body, physicsClientId=client)) == 2 * MODULES
    finally:
        pybullet.disconnect(client)


@pytest.mark.parametrize("name", ["robot.xml", "robot.urdf"])
def test_the_file_says_that_the_law_is_not_in_it(pliant, study, workplace, name) -> None:
    if name.endswith("urdf") and importlib.util.find_spec("pybullet") is None:
        pytest.skip("pybullet is not installed")
    assert pliant("export", study, "--out", name).code == 0
    written = (workplace / name).read_text()
    assert "law is not in this file" in written
    assert ElementTree.fromstring(written).tag in ("mujoco", "robot")
    if name.endswith("urdf"):
        assert written.count("stiffness at rest about y: 0.0245 N m/rad") == MODULES


def test_a_chain_without_a_family_has_no_meshes(pliant, workplace) -> None:
    text = BELLOW.replace(BELLOW[BELLOW.index("family:") : BELLOW.index("surrogate:")], "")
    text = text.replace(
        "chain:\n", "chain:\n  module_length: 11 mm\n  module_mass: 2 g\n  module_radius: 5 mm\n"
    )
    (workplace / "rods.yaml").write_text(text)
    pliant("export", "rods.yaml", "--out", "rods.xml").done()
    model = mujoco.MjModel.from_xml_path("rods.xml")
    assert model.nmesh == 0 and model.ngeom > 0
    written = ["rods.xml", "rods.xml.check.json", "rods.yaml", "rods_law.py"]
    assert sorted(p.name for p in workplace.glob("rods*")) == written


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--out", "robot.sdf"], "no engine writes 'sdf'"),
        (["--out", "robot"], "the name has no ending"),
        (["--out", "robot.txt", "--format", "urdff"], "did you mean 'urdf'"),
        (["--out", "/proc/pliant/robot.xml"], "cannot be written"),
        (["--out", "."], "is a folder"),
        (["--out", "robot.urdf", "--part", "scene"], "--part scene is for MJCF"),
        (["--out", "robot.xml", "--part", "scene"], "'task'"),
        (
            ["task={kind: free_bending, pressure: 1 kPa}", "--out", "robot.xml", "--part", "scene"],
            "has no scene",
        ),
    ],
)
def test_wrong_input_is_one_sentence(pliant, study, arguments, says) -> None:
    if "urdf" in says and importlib.util.find_spec("pybullet") is None:
        pytest.skip("pybullet is not installed")
    pliant("export", study, *arguments).refused(says)


def test_where_the_tip_can_go_is_a_table_and_a_picture(pliant, study, workplace, read) -> None:
    domain = "surrogate.domain={actuation: [0 kPa, 15 kPa], deformation: [-0.6, 0.7]}"
    out = ("--format", "reachable", "--out", "reach.csv", "--json", "done.json")
    pliant("export", study, domain, *out).done()
    table = np.genfromtxt(workplace / "reach.csv", delimiter=",", names=True)
    tips = np.stack([table[f"tip_{k}_m"] for k in "xyz"], axis=1)
    limits = np.array(read("done.json")["limits_m"])
    np.testing.assert_allclose(limits, np.stack([tips.min(axis=0), tips.max(axis=0)], axis=1), atol=1e-8)
    assert np.ptp(table["pressure_pa"]) > 0.0 and np.ptp(tips, axis=0).max() > 1e-3
    assert (workplace / "reach.png").read_bytes()[:4] == b"\x89PNG"
    pliant("export", study, "--format", "reachable", "--out", "reach.txt").refused("the ending .csv")


def test_a_study_without_a_chain_is_refused(pliant, workplace) -> None:
    (workplace / "law.yaml").write_text(BELLOW[: BELLOW.index("chain:")])
    pliant("export", "law.yaml", "--out", "robot.xml").refused("chain")


def test_an_engine_that_is_missing_is_named(pliant, study, monkeypatch) -> None:
    monkeypatch.setattr(Component, "missing", lambda self: "mujoco" if self.kind == "mujoco" else None)
    call = pliant("export", study, "--out", "robot.xml")
    said = " ".join(call.err.split())
    assert call.code == 2 and "no engine writes 'mjcf'" in said and "pip install 'pliant[mujoco]'" in said


def test_modules_without_a_radius_are_seen_between_rigid_pieces(pliant, write):
    study = write(
        "pliant: 1\nname: mixed\nsurrogate: {kind: polynomial, form: study, "
        "coefficients: {k_n: 1e-6, m_a: 0, m_e: 0.1, b_e: 0.02}}\n"
        "chain: {module_length: 11 mm, segments: [{rigid: {length: 20 mm, radius: 8 mm}}, {modules: 3}]}\n"
    )
    assert pliant("export", study, "--out", "mixed.xml").code == 0
    model = mujoco.MjModel.from_xml_path("mixed.xml")
    drawn = set(model.geom_bodyid.tolist())
    moving = {k for k in range(model.nbody) if model.body_jntnum[k]}
    assert len(moving) == 3
    assert moving <= drawn
