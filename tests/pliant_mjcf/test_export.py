"""Improved MuJoCo models as files: plain MuJoCo does what the study predicts."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from tests.command import called
from tests.pliant_mjcf.mjcf_models import BOX, drive, model_of
from tests.pliant_mjcf.stepping import REGISTRY
from tests.pliant_mjcf.test_own_effect import DRAG

from pliant.errors import UserError
from pliant.interfaces.model import Drive, Exported, Improved, SystemParts
from pliant.registry.files import with_files
from pliant_mjcf.model import MjcfModel

# A shoulder with a position servo and a spring, an elbow with a motor, a finger that a tendon pulls.
LIMB = """<mujoco model="limb"><compiler angle="radian"/><option timestep="0.002" integrator="implicitfast"/>
<default><joint damping="0.05" armature="0.004"/><geom contype="0" conaffinity="0"/></default><worldbody>
<body name="upper" pos="0 0 1"><joint name="shoulder" axis="0 1 0" stiffness="0.3"/>
<geom type="capsule" size=".02" fromto="0 0 0 .2 0 0" mass=".4"/>
<body name="lower" pos=".2 0 0"><joint name="elbow" axis="0 1 0" stiffness="0.8"/>
<geom type="capsule" size=".015" fromto="0 0 0 .15 0 0" mass=".2"/>
<body name="finger" pos=".15 0 0"><joint name="knuckle" axis="0 0 1" stiffness="0.2" frictionloss="0.01"/>
<geom type="capsule" size=".01" fromto="0 0 0 .08 0 0" mass=".05"/><site name="tip" pos=".08 0 0"/></body></body></body>
</worldbody>
<tendon><fixed name="cord"><joint joint="knuckle" coef="0.02"/></fixed></tendon>
<actuator><position name="servo" joint="shoulder" kp="15" kv="0.5" ctrlrange="-1.2 1.2"/>
<motor name="motor" joint="elbow" gear="0.5"/>
<position name="puller" tendon="cord" kp="900"/></actuator>
<sensor><jointpos name="shoulder_angle" joint="shoulder"/><jointpos name="elbow_angle" joint="elbow"/>
<jointpos name="knuckle_angle" joint="knuckle"/><framepos name="tip" objtype="site" objname="tip"/></sensor></mujoco>"""
COLUMNS = ("servo_rad", "motor_n_m", "puller")
TIME = np.arange(0.0, 1.5, 0.01)


def runs(time_s: Any = TIME) -> list[Drive]:
    """Return two runs within and beyond the servo's range."""
    found = []
    for k in range(2):
        inputs = {
            "servo_rad": (0.7 + 0.2 * k) * np.sin(2.0 * np.pi * (0.7 + 0.3 * k) * time_s),
            "motor_n_m": 1.2 * np.sin(2.0 * np.pi * 1.1 * time_s + 0.5),
            "puller": 0.01 * np.sin(2.0 * np.pi * (0.9 + 0.2 * k) * time_s),
        }
        first = {"shoulder_angle_rad": 0.05 * k, "elbow_angle_rad": 0.1, "knuckle_angle_rad": -0.05}
        found.append(drive(time_s, first, run=f"run_{k}", **inputs))
    return found


def built(registry: Any, kind: str, **values: Any) -> Any:
    name = kind.partition("@")[0]
    config = registry.get("effect", name).config_model()(kind=kind, **values)
    return registry.build("effect", config)


def improved(system: MjcfModel, effects: list[Any], drives: list[Drive]) -> Improved:
    """Return a study's model with effects, and what it predicts."""
    names = tuple(one.name for one in system.inputs), tuple(one.name for one in system.outputs)
    scales = {name: max(np.abs(one.history.actuation[name]).max() for one in drives) for name in names[0]}
    parts = SystemParts(scales={**scales, **dict.fromkeys(names[1], 1.0)}, names=names)
    whole = parts
    for effect in effects:
        whole = effect.apply(whole)
    acting = [Drive(whole.commanded(one.history), one.first) for one in drives]
    predicted = []
    for one, read in zip(drives, system.simulate(whole, acting), strict=True):
        seen = whole.reported({**read, "time_s": one.history.time_s})
        predicted.append({name: np.asarray(seen[name]) for name in names[1]})
    told = tuple(f"{one.config.kind}: told" for one in effects)
    return Improved("limb", tuple(effects), told, parts, tuple(drives), tuple(predicted))


def plain(mjcf: Path, one: Drive, state: Any, inputs: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return what an MJCF alone reads in a run, stepped by MuJoCo, at samples that are steps."""
    model = mujoco.MjModel.from_xml_path(str(mjcf))
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, np.array(state), mujoco.mjtState.mjSTATE_INTEGRATION)
    time_s = one.history.time_s
    assert time_s is not None
    records = []
    for k in range(round(time_s[-1] / model.opt.timestep) + 1):
        at = k * model.opt.timestep
        data.ctrl[:] = [np.interp(at, time_s, (inputs or one.history.actuation)[name]) for name in COLUMNS]
        mujoco.mj_step(model, data)
        records.append(data.sensordata.copy())
    table = np.array(records)[np.round(time_s / model.opt.timestep).astype(int)]
    names = ("shoulder_angle_rad", "elbow_angle_rad", "knuckle_angle_rad", "tip_x_m", "tip_y_m", "tip_z_m")
    return dict(zip(names, table.T, strict=True))


def checked(script: Path) -> list[str]:
    """Return what the module's check finds, in a Python that has imported nothing of Pliant."""
    code = (
        f"import json, sys, {script.stem} as m; found = m.check(); "
        "assert not [one for one in sys.modules if one.startswith('pliant')]; print(json.dumps(found))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=script.parent,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": ""},
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert isinstance(found, list)
    return found


def export(folder: Path, *effects: Any, xml: str = LIMB, **settings: Any) -> tuple[Exported, Improved]:
    (folder / "out").mkdir()
    system = model_of(folder, xml, **settings)
    study = improved(system, list(effects), runs())
    return system.export(study, folder / "out" / "limb_improved.xml"), study


NATIVE = {
    "stiffness@elbow": {"stiffness_n_m_per_rad": 0.4},
    "rest_angle@shoulder": {"shift_rad": 0.1},
    "viscous_damping@elbow": {"damping_n_m_s": 0.03},
    "coulomb_friction@elbow": {"moment_n_m": 0.05},
    "tendon_friction@cord": {"force_n": 0.5},
    "tendon_stiffness@cord": {"stiffness_n_per_m": 300.0},
    "body_mass@lower": {"factor": 1.3},
    "centre_of_mass@lower": {"x_m": 0.01, "z_m": 0.02},
    "body_inertia@upper": {"factor": 1.4},
    "payload@finger": {"mass_kg": 0.1, "site": "tip"},
    "gravity_scale": {"factor": 0.9},
    "gravity_direction": {"about_x_rad": 0.1},
    "base_misalignment": {"pitch_rad": 0.1},
    "actuation_gain": {"factor": 1.23456789},
    "actuation_gain@servo*": {"factor": -0.8},
    "input_offset": {"share": 0.07},
}


@pytest.mark.parametrize("kind", NATIVE)
def test_what_mjcf_can_say_is_in_the_mjcf_alone(tmp_path: Path, kind: str) -> None:
    exported, study = export(tmp_path, built(REGISTRY, kind, **NATIVE[kind]))
    mjcf, script, check = exported.files
    said = json.loads(check.read_text())
    for one, run, wanted in zip(study.drives, said["runs"], study.predicted, strict=True):
        seen = plain(mjcf, one, run["state"])
        for name, values in wanted.items():
            assert np.abs(seen[name] - values).max() < 1e-9, name
    assert script.name not in exported.acts[kind]
    assert f"<!-- {kind}: told -->" in mjcf.read_text()
    assert checked(script) == []


SAMPLED = {
    "saturation@servo*": {"loss": 0.3},
    "supply_lag@motor*": {"time_s": 0.08},
    "dead_time": {"delay_s": 0.033},
}


@pytest.mark.parametrize("kind", SAMPLED)
def test_lags_and_limits_agree_to_the_spacing_of_samples(tmp_path: Path, kind: str) -> None:
    exported, study = export(tmp_path, built(REGISTRY, kind, **SAMPLED[kind]))
    mjcf, script, check = exported.files
    said = json.loads(check.read_text())
    assert "to the spacing of the samples" in exported.acts[kind] and script.name not in exported.acts[kind]
    without = improved(model_of(tmp_path, LIMB), [], runs()).predicted
    for one, run, wanted, bare in zip(study.drives, said["runs"], study.predicted, without, strict=True):
        seen = plain(mjcf, one, run["state"])
        off = {name: np.abs(seen[name] - values).max() for name, values in wanted.items()}
        moved = {name: np.abs(bare[name] - values).max() for name, values in wanted.items()}
        assert all(off[name] <= said["tolerance"][name] for name in off)
        assert max(moved.values()) > 20.0 * max(off.values())
    assert checked(script) == []


MODULE = {
    "dead_zone": {"share": 0.1},
    "backlash@servo*": {"share": 0.05},
    "leak": {"rate_per_s": 0.5},
    "stribeck_friction@elbow": {"moment_n_m": 0.05, "speed_rad_s": 0.2},
    "friction_hysteresis@shoulder": {"yield_n_m": 0.1, "break_away_rad": 0.05},
    "viscoelastic@elbow": {"stiffness_n_m_per_rad": 0.3, "time_s": 0.4},
    "viscous_damping": {"damping_n_m_s": 0.05, "rate_power": 0.6},
    "joint_play@shoulder": {"play_rad": 0.05},
    "tendon_slack": {"slack_m": 0.001},
    "sensor_bias": {"share": 0.03},
    "sensor_scale@elbow*": {"factor": 1.1},
    "sensor_lag": {"time_s": 0.05},
    "sensor_delay": {"delay_s": 0.017},
    "misaligned_frame": {"about_z_rad": 0.2},
}


@pytest.mark.parametrize("kind", MODULE)
def test_the_module_does_what_mjcf_cannot_say(tmp_path: Path, kind: str) -> None:
    exported, study = export(tmp_path, built(REGISTRY, kind, **MODULE[kind]))
    script, check = exported.files[1:]
    assert script.name in exported.acts[kind]
    assert checked(script) == []
    said = json.loads(check.read_text())
    largest = {name: max(np.abs(one[name]).max() for one in study.predicted) for name in study.predicted[0]}
    assert all(said["tolerance"][name] <= max(1e-9 * largest[name], 1e-12) for name in largest)
    said["runs"][0]["commanded"]["servo_rad"] = [0.0] * len(TIME)  # another command is another motion
    check.write_text(json.dumps(said))
    assert any("shoulder_angle_rad" in one for one in checked(script))


def test_effects_together_keep_their_order(tmp_path: Path) -> None:
    effects = [
        built(REGISTRY, "dead_zone@motor*", share=0.1),
        built(REGISTRY, "input_offset", share=0.05),
        built(REGISTRY, "actuation_gain@motor*", factor=1.3),
        built(REGISTRY, "joint_play@shoulder", play_rad=0.03),
        built(REGISTRY, "payload@finger", mass_kg=0.05),
        built(REGISTRY, "body_mass@finger", factor=1.5),
        built(REGISTRY, "stribeck_friction@elbow", moment_n_m=0.03),
        built(REGISTRY, "sensor_scale", factor=0.9),
    ]
    exported, _ = export(tmp_path, *effects)
    assert checked(exported.files[1]) == []
    assert exported.acts["input_offset"].count("general") == 3
    assert exported.acts["dead_zone@motor*"] == "limb_improved.py"
    # behind a dead zone of the same input a gain is in the module too
    first = [built(REGISTRY, "actuation_gain", factor=1.3), built(REGISTRY, "dead_zone@motor*", share=0.1)]
    (tmp_path / "second").mkdir()
    again, _ = export(tmp_path / "second", *first)
    assert checked(again.files[1]) == [] and "limb_improved.py" in again.acts["actuation_gain"]


def test_curves_fixed_actuators_and_an_effect_of_ones_own(tmp_path: Path) -> None:
    file = tmp_path / "my_effect.py"
    file.write_text(DRAG)
    registry = with_files(REGISTRY, [file])
    settings = {
        "inputs": {"motor_n_m": {"actuator": "motor", "curve": [(-2.0, -1.0), (0.0, 0.0), (2.0, 1.5)]}},
        "fixed": {"puller": 0.004},
        "outputs": {"elbow_angle_rad": "elbow", "tip": "tip", "speed": "shoulder.velocity"},
    }
    effects = [built(registry, "drag@elbow", drag=0.05), built(registry, "actuation_gain@motor*", factor=1.2)]
    exported, _ = export(tmp_path, *effects, **settings)
    assert checked(exported.files[1]) == []
    assert exported.acts["actuation_gain@motor*"] == "limb_improved.py"


def test_meshes_come_along(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    corners = [(x, y, z) for x in (0, 0.1) for y in (0, 0.05) for z in (0, 0.02)]
    vertices = "\n".join(f"v {x} {y} {z}" for x, y, z in corners)
    faces = "\n".join(
        f"f {a} {b} {c}" for a, b, c in ((1, 3, 5), (3, 7, 5), (2, 6, 4), (4, 6, 8), (1, 5, 2), (2, 5, 6))
    )
    (tmp_path / "meshes" / "hand.obj").write_text(f"{vertices}\n{faces}\n")
    xml = LIMB.replace('<compiler angle="radian"/>', '<compiler angle="radian" meshdir="meshes"/>').replace(
        "<worldbody>", '<asset><mesh name="hand" file="hand.obj" inertia="convex"/></asset><worldbody>', 1
    )
    xml = xml.replace('<site name="tip"', '<geom type="mesh" mesh="hand" mass=".05"/><site name="tip"')
    exported, _ = export(tmp_path, built(REGISTRY, "stiffness@elbow", stiffness_n_m_per_rad=0.4), xml=xml)
    assert exported.files[3] == tmp_path / "out" / "limb_improved_files" / "hand.obj"
    (tmp_path / "meshes" / "hand.obj").unlink()
    assert checked(exported.files[1]) == []


def test_comments_of_the_file_are_kept(tmp_path: Path) -> None:
    xml = LIMB.replace("<compiler", "<!-- measured in May -->\n<compiler", 1)
    xml = xml.replace('<joint name="elbow"', '<!-- worn --> <joint name="elbow"')
    xml = xml.replace("</worldbody>", "<!-- more arms -->\n</worldbody>", 1)
    xml = xml.replace('<motor name="motor"', '<!-- 12 V --><motor name="motor"')
    exported, _ = export(tmp_path, built(REGISTRY, "stiffness@elbow", stiffness_n_m_per_rad=0.4), xml=xml)
    text = exported.files[0].read_text()
    lines = [line.strip() for line in text.splitlines()]
    for words, element in (
        ("measured in May", "<compiler"),
        ("worn", '<joint name="elbow"'),
        ("more arms", "<worldbody"),
        ("12 V", '<general name="motor"'),
    ):
        behind = lines[lines.index(f"<!-- {words} -->") + 1 :]
        assert next(line for line in behind if not line.startswith("<!--")).startswith(element), words
    assert checked(exported.files[1]) == []


def test_one_comment_for_an_inertial_and_none_for_the_storage_of_its_body(tmp_path: Path) -> None:
    effects = [built(REGISTRY, kind, **NATIVE[kind]) for kind in ("body_mass@lower", "centre_of_mass@lower")]
    exported, _ = export(tmp_path, *effects)
    text = exported.files[0].read_text()
    assert text.count("<!-- body_mass@lower") == text.count("<!-- centre_of_mass@lower") == 1


def test_the_command_writes_model_and_parameters(tmp_path: Path) -> None:
    (tmp_path / "limb.xml").write_text(LIMB)
    system = model_of(tmp_path, LIMB)
    effect = built(REGISTRY, "coulomb_friction@elbow", moment_n_m=0.05)
    truth = improved(system, [effect], runs())
    lines = [["run", "time_s", *COLUMNS, *truth.predicted[0]]]
    for one, read in zip(truth.drives, truth.predicted, strict=True):
        rows = np.column_stack([TIME, *(one.history.actuation[name] for name in COLUMNS), *read.values()])
        lines += [[one.history.run, *(f"{value:.10g}" for value in row)] for row in rows]
    with (tmp_path / "bench.csv").open("w", newline="") as file:
        csv.writer(file).writerows(lines)
    (tmp_path / "limb.yaml").write_text(
        "name: limb\nmodel: {kind: mjcf, file: limb.xml}\nmeasurements: {file: bench.csv}\n"
        "effects: [{kind: coulomb_friction@elbow, moment: 0.05 N*m}]\n"
        "posterior:\n  parameters: [coulomb_friction@elbow.moment_n_m]\n  values: [0.05]\n  sd: [0.002]\n"
        "  correlation: [[1.0]]\n  noise: {}\n  left: {}\n  freedom: 100\n"
    )
    said = called("export", tmp_path / "limb.yaml", "--out", tmp_path / "improved.xml").done().out
    assert "joint elbow" in said and "it does what the study predicts of 2 recorded runs" in said
    text = (tmp_path / "improved.xml").read_text()
    assert "0.05 ± 0.002 N*m, 90 % between 0.0467" in text and "fitted to bench.csv (sha256" in text
    assert checked(tmp_path / "improved.py") == []
    called("export", tmp_path / "limb.yaml", "--out", tmp_path / "parameters.csv").done()
    with (tmp_path / "parameters.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert row["acts_at"] == "elbow" and row["unit"] == "N*m" and float(row["sd"]) == pytest.approx(0.002)
    assert float(row["low"]) == pytest.approx(0.05 - 1.645 * 0.002, rel=1e-3)
    own = ("export", tmp_path / "limb.yaml", "--out", tmp_path / "limb.xml")
    called(*own).refused("limb.xml is there already", "--force")
    called(*own, "--force").refused("the study's own MJCF")
    again = ("export", tmp_path / "limb.yaml", "--out", tmp_path / "improved.xml")
    (tmp_path / "improved.xml").unlink()
    called(*again).refused("improved.py", "improved.check.json", "are there already", "--force")
    assert not (tmp_path / "improved.xml").exists()
    called(*again, "--force").done()
    assert (tmp_path / "improved.xml").read_text() == text


def test_an_effect_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    file = tmp_path / "my_effect.py"
    file.write_text(
        "from pliant import units\n" + DRAG.replace("abs(v)", "abs(v) * len(units.UNIT_SUFFIXES) ** 0")
    )
    registry = with_files(REGISTRY, [file])
    with pytest.raises(UserError, match="uses the module pliant.units as a whole"):
        export(tmp_path, built(registry, "drag@elbow", drag=0.05))


def test_friction_of_the_floor_and_a_keyframe(tmp_path: Path) -> None:
    """A box is pushed over the floor; it starts from a keyframe."""
    key = '<keyframe><key name="left" qpos="-.3 0 .1 1 0 0 0"/></keyframe></mujoco>'
    xml = BOX.format(solref="0.02 1").replace(' refsite="push"', "").replace("</mujoco>", key)
    system = model_of(tmp_path, xml, initial="left")
    name = system.inputs[0].name
    drives = [drive(TIME[:80], {}, **{name: 30.0 * np.sin(3.0 * TIME[:80])})]
    effects = [built(REGISTRY, "floor_friction", factor=0.7), built(REGISTRY, "actuation_gain", factor=1.1)]
    study = improved(system, effects, drives)
    exported = system.export(study, tmp_path / "box_improved.xml")
    assert "module" not in exported.sentences[0] and checked(exported.files[1]) == []
    moved = study.predicted[0]["box_x_m"]
    assert moved[0] == -0.3 and np.ptp(moved) > 0.05
    assert np.abs(improved(system, effects[1:], drives).predicted[0]["box_x_m"] - moved).max() > 1e-4


def test_a_model_without_a_file_format_exports_its_parameters_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = Path(__file__).parents[2] / "examples" / "own_model" / "pendulum"
    for file in source.iterdir():
        if file.is_file():
            (tmp_path / file.name).write_bytes(file.read_bytes())
    monkeypatch.chdir(tmp_path)
    text = (tmp_path / "study.yaml").read_text()
    (tmp_path / "better.yaml").write_text(f"{text}effects: [{{kind: state@coulomb, value: 0.12}}]\n")
    called("export", "better.yaml", "--out", "better.xml").refused("kind 'python'", "--out parameters.csv")
    called("export", "better.yaml", "--out", "better.stl", "--part", "module").refused("chains of modules")
    called("export", "better.yaml", "--out", "numbers.json").done()
    (row,) = json.loads((tmp_path / "numbers.json").read_text())["parameters"]
    assert (row["effect"], row["value"], row["sd"], row["acts_at"]) == (
        "state@coulomb",
        0.12,
        None,
        ["coulomb"],
    )
    called("export", "study.yaml", "--out", "none.csv").refused("has no effects")
