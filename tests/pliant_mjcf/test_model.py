"""The model `mjcf`: physics by formulas, signals, starts, divergence, and what it says about wrong files."""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from tests.pliant_mjcf.mjcf_models import ARM, BOX, MOTOR, drive, model_of, pendulum, simulated

import pliant
from pliant.errors import UserError
from pliant.interfaces.effect import EffectParameter
from pliant.interfaces.model import SystemParts
from pliant_mjcf.changes import DriveChange, ModelChange, SpecChange, StateForce
from pliant_mjcf.sampling import Samples
from pliant_mjcf.stepping import NEVER, Course, March

G, LENGTH = 9.81, 0.5
TIME = np.arange(0.0, 3.0, 0.01)
STILL = 0.0 * TIME


def test_a_pendulum_swings_with_its_period_and_keeps_its_energy(tmp_path: Path) -> None:
    more = '<e_potential name="potential"/><e_kinetic name="kinetic"/>'
    model = model_of(tmp_path, pendulum(more=more))
    read = simulated(model, drive(TIME, {"angle_rad": 0.05}, drive_n_m=0.0 * TIME))
    crossings = np.flatnonzero(np.diff(np.sign(read["angle_rad"])) < 0)
    period = 2.0 * np.pi * np.sqrt(LENGTH / G) * (1.0 + 0.05**2 / 16.0)
    assert np.diff(TIME[crossings]).mean() == pytest.approx(period, abs=0.01)
    assert read["angle_rad"][0] == 0.05
    energy = read["potential"] + read["kinetic"]
    assert np.ptp(energy) < 1e-7 * G * LENGTH


def test_inputs_are_straight_lines_between_samples(tmp_path: Path) -> None:
    more = '<actuatorfrc name="force" actuator="drive"/>'
    model = model_of(tmp_path, pendulum(step=0.003, more=more))
    time = np.array([0.0, 0.1, 0.25, 0.4])  # no multiples of the step
    torque = np.array([0.0, 1.0, -2.0, 0.5])
    read = simulated(model, drive(time, {"angle_rad": 0.0}, drive_n_m=torque))
    at = np.array([0.0, 0.099, 0.249, 0.399])
    # between two steps the reading is interpolated too, which cuts the corners of the input
    assert read["force_n_m"] == pytest.approx(torque, abs=0.003 * 20.0)
    assert read["force_n_m"][0] == 0.0
    fine = simulated(model, drive(at, {"angle_rad": 0.0}, drive_n_m=np.interp(at, time, torque)))
    assert fine["force_n_m"] == pytest.approx(np.interp(at, time, torque), abs=1e-12)


def test_samples_between_steps_are_interpolated() -> None:
    samples = Samples.at(np.array([0.0, 0.004, 0.0055, 0.3]), 0.002)
    assert samples.before.tolist() == [0, 2, 2, 150]
    assert samples.share == pytest.approx([0.0, 0.0, 0.75, 0.0])
    readings = np.zeros((4, 1))
    for begin in (0, 2, 3, 100):  # in pieces
        end = {0: 2, 2: 3, 3: 100, 100: 151}[begin]
        samples.add(readings, begin, np.arange(begin, end, dtype=float)[:, None] ** 2)
    assert readings[:, 0] == pytest.approx([0.0, 4.0, 0.25 * 4.0 + 0.75 * 9.0, 150.0**2])


def test_lock_step_equals_rollout(tmp_path: Path) -> None:
    loaded = model_of(tmp_path, BOX.format(solref="0.02 1")).loaded.model
    data = mujoco.MjData(loaded)
    start = np.empty(mujoco.mj_stateSize(loaded, int(mujoco.mjtState.mjSTATE_INTEGRATION)))
    mujoco.mj_getState(loaded, data, start, int(mujoco.mjtState.mjSTATE_INTEGRATION))
    courses = [
        Course(start, n, TIME, np.sin(k + 5.0 * TIME)[:, None]) for k, n in ((1, 400), (2, 900), (3, 650))
    ]
    tables = []
    for lock_step in (False, True):
        march = March(loaded, courses, threads=2, lock_step=lock_step)
        table = np.full((3, 900, 3), np.nan)
        for piece in march.pieces(("sensordata",)):
            steps = piece.records["sensordata"].shape[1]
            table[piece.runs, piece.begin : piece.begin + steps] = piece.records["sensordata"]
        assert (march.failed_at == NEVER).all()
        tables.append(table)
    assert np.array_equal(np.isnan(tables[0]), np.isnan(tables[1]))
    assert np.nanmax(np.abs(tables[0] - tables[1])) < 1e-12


def test_runs_do_not_depend_on_each_other_or_on_threads(tmp_path: Path) -> None:
    model = model_of(tmp_path, pendulum())
    runs = [
        drive(TIME[: 100 + 50 * k], {"angle_rad": 0.1 * k}, drive_n_m=np.sin(k * TIME[: 100 + 50 * k]))
        for k in range(4)
    ]
    together = model.simulate(SystemParts(), runs)
    with ThreadPoolExecutor(3) as pool:
        alone = list(pool.map(lambda one: simulated(model, one), runs))
    again = pickle.loads(pickle.dumps(model)).simulate(SystemParts(), runs)
    for a, b, c in zip(together, alone, again, strict=True):
        assert all(np.array_equal(a[name], b[name]) and np.array_equal(a[name], c[name]) for name in a)


class Damping(ModelChange):
    def change(self, model: Any) -> None:
        model.dof_damping[:] = 0.4


class Heavier(SpecChange):
    def edit(self, spec: Any) -> None:
        spec.body("arm").mass = 2.0


class Spring(StateForce):
    def start(self, model: Any, q: Any, v: Any) -> Any:
        return 0

    def advance(self, model: Any, state: Any, q: Any, v: Any, step_s: float) -> Any:
        return -3.0 * q, state + 1


class Broken(Spring):
    def advance(self, model: Any, state: Any, q: Any, v: Any, step_s: float) -> Any:
        force = np.zeros_like(v)
        force[q[:, 0] > 0.2] = np.nan
        return force, state


class Doubled(DriveChange):
    def start(self, model: Any) -> Any:
        return None

    def advance(self, model: Any, state: Any, q: Any, v: Any, controls: Any, step_s: float) -> Any:
        return 2.0 * controls, state


def test_changes_act_as_in_a_changed_file(tmp_path: Path) -> None:
    model = model_of(tmp_path, pendulum(integrator="implicitfast"))
    damped = model_of(tmp_path, pendulum(integrator="implicitfast", damping=0.4), "damped.xml")
    heavy = model_of(
        tmp_path, pendulum(integrator="implicitfast").replace('mass="1"', 'mass="2"'), "heavy.xml"
    )
    run = drive(TIME, {"angle_rad": 0.4}, drive_n_m=np.sin(TIME))
    before = simulated(model, run)
    for change, same in ((Damping(), damped), (Heavier(), heavy)):
        found, expected = simulated(model, run, change), simulated(same, run)
        assert all(np.allclose(found[name], expected[name], atol=1e-9) for name in found)
    both = simulated(model, run, Damping(), Heavier())["angle_rad"]
    assert np.abs(both - simulated(heavy, run, Damping())["angle_rad"]).max() < 1e-9
    assert np.array_equal(simulated(model, run)["angle_rad"], before["angle_rad"])  # copies were changed


def test_forces_of_effects_act_at_every_step(tmp_path: Path) -> None:
    model = model_of(tmp_path, pendulum(step=0.0005, integrator="implicitfast"))
    run = drive(TIME, {"angle_rad": 0.01}, drive_n_m=0.0 * TIME)
    read = simulated(model, run, Spring())["angle_rad"]
    rate = np.sqrt(G / LENGTH + 3.0 / LENGTH**2)
    assert read == pytest.approx(0.01 * np.cos(rate * TIME), abs=2e-4)


def test_controls_of_effects_act_at_every_step(tmp_path: Path) -> None:
    model = model_of(tmp_path, pendulum())
    torque = 0.3 * np.sin(4.0 * TIME)
    found = simulated(model, drive(TIME, {"angle_rad": 0.0}, drive_n_m=torque), Doubled())
    expected = simulated(model, drive(TIME, {"angle_rad": 0.0}, drive_n_m=2.0 * torque))
    assert np.allclose(found["angle_rad"], expected["angle_rad"], atol=1e-12)


class Explosion(ModelChange):
    """Damping that is negative: the pendulum speeds up without end."""

    def change(self, model: Any) -> None:
        model.dof_damping[:] = -5.0


def test_sensors_with_noise_cutoff_and_delay(tmp_path: Path) -> None:
    more = (
        '<jointpos name="late" joint="hinge" delay="0.02" nsample="24"/>'
        '<jointpos name="cut" joint="hinge" cutoff="0.2"/><jointpos name="rough" joint="hinge" noise="0.1"/>'
    )
    model = model_of(tmp_path, pendulum(more=more))
    run = drive(TIME, {"angle_rad": 0.5}, drive_n_m=STILL)
    read, again = simulated(model, run), simulated(model, run)
    assert all(np.array_equal(read[name], again[name]) for name in read)
    assert np.array_equal(read["rough_rad"], read["angle_rad"])
    assert np.allclose(read["cut_rad"], np.clip(read["angle_rad"], -0.2, 0.2), atol=1e-12)
    assert read["late_rad"][0] == pytest.approx(0.5, abs=1e-12)
    assert np.allclose(read["late_rad"][2:], read["angle_rad"][:-2], atol=3e-3)


@pytest.mark.parametrize("force", [False, True])
def test_a_run_that_diverges_is_nan_from_there_on(
    tmp_path: Path, force: bool, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    model = model_of(tmp_path, pendulum(step=0.01))
    calm = drive(TIME, {"angle_rad": 0.0}, drive_n_m=0.0 * TIME)  # at its unstable rest
    wild = drive(TIME, {"angle_rad": 0.5}, drive_n_m=0.0 * TIME)
    changes = (Explosion(), Spring()) if force else (Explosion(),)
    rest, read = model.simulate(SystemParts(changes=changes), [calm, wild])
    bad = np.isnan(read["angle_rad"])
    assert not bad[:50].any() and bad[-1] and (np.diff(bad.astype(int)) >= 0).all()
    assert np.isfinite(rest["angle_rad"]).all()
    assert capfd.readouterr() == ("", "")
    assert not Path("MUJOCO_LOG.TXT").exists()


def test_a_force_that_is_not_a_number_stops_its_own_run_only(tmp_path: Path) -> None:
    model = model_of(tmp_path, pendulum())
    runs = [drive(TIME, {"angle_rad": a}, drive_n_m=0.0 * TIME) for a in (0.1, -0.3)]
    small, large = model.simulate(SystemParts(changes=(Broken(),)), runs)
    assert np.isfinite(small["angle_rad"]).all()
    assert np.isnan(large["angle_rad"][-1]) and large["angle_rad"][0] == -0.3


KEY = '<keyframe><key name="up" qpos="3.0" qvel="0.5"/></keyframe>'


@pytest.mark.parametrize(
    ("initial", "first", "angle", "speed"),
    [
        (None, {"angle_rad": 0.3, "speed": 0.2}, 0.3, 0.2),
        ("first", {"angle_rad": 0.3}, 0.3, 0.0),
        ("settled", {"angle_rad": 0.3}, np.arcsin(2.0 / (G * LENGTH)), 0.0),
        (None, {}, np.arcsin(2.0 / (G * LENGTH)), 0.0),
        ("up", {"angle_rad": 0.3}, 3.0, 0.5),
        ({"hinge": -0.7}, {"angle_rad": 0.3}, -0.7, 0.0),
    ],
)
def test_initial_states(
    tmp_path: Path, initial: Any, first: dict[str, float], angle: float, speed: float
) -> None:
    model = model_of(tmp_path, pendulum(last=KEY), initial=initial)
    read = simulated(model, drive(TIME, first, drive_n_m=STILL + 2.0))
    assert read["angle_rad"][0] == pytest.approx(angle, abs=1e-7)
    assert read["speed"][0] == pytest.approx(speed, abs=1e-12)


def test_a_settled_run_stays_at_rest(tmp_path: Path) -> None:
    model = model_of(tmp_path, ARM.format(step=0.002, integrator="implicitfast", gain=1), initial="settled")
    torques = {"shoulder_n_m": STILL + 0.8, "elbow_n_m": STILL - 0.1}
    read = simulated(model, drive(TIME, **torques))
    assert abs(read["elbow_angle_rad"][0]) > 0.1
    assert all(np.ptp(values) < 1e-6 for values in read.values())


def test_actuators_with_activation_start_as_after_a_long_time(tmp_path: Path) -> None:
    servo = '<position name="servo" joint="hinge" kp="50" timeconst="0.2" inheritrange="0"/>'
    model = model_of(tmp_path, pendulum(actuator=servo, damping=1.0), initial="settled")
    assert [one.name for one in model.inputs] == ["servo_rad"]
    read = simulated(model, drive(TIME, servo_rad=STILL + 0.4))
    assert np.ptp(read["angle_rad"]) < 1e-6
    assert read["angle_rad"][0] == pytest.approx(0.4, abs=0.05)


def test_names_and_units_of_channels(tmp_path: Path) -> None:
    actuators = MOTOR + '<velocity name="wheel" joint="hinge" kv="2"/><general name="valve" joint="hinge"/>'
    more = '<framepos objtype="site" objname="tip"/><accelerometer name="imu" site="tip"/>'
    model = model_of(tmp_path, pendulum(actuator=actuators, more=more))
    assert [(one.name, one.unit) for one in model.inputs] == [
        ("drive_n_m", "N*m"),
        ("wheel", "rad/s"),
        ("valve_n_m", "N*m"),
    ]
    assert (model.inputs[0].low, model.inputs[0].high, model.inputs[1].low) == (-4.0, 4.0, None)
    assert [one.name for one in model.outputs] == [
        "angle_rad",
        "speed",
        *(f"tip_framepos_{axis}_m" for axis in "xyz"),
        *(f"imu_{axis}_m_s2" for axis in "xyz"),
    ]


def test_mapped_columns_and_curves(tmp_path: Path) -> None:
    model = model_of(
        tmp_path,
        pendulum(actuator=MOTOR + '<motor name="brake" joint="hinge"/>'),
        inputs={"pressure_pa": {"actuator": "drive", "curve": [[0, 0], [20e3, 1.0], [50e3, 3.0]]}},
        outputs={
            "bend_rad": "hinge",
            "rate": "hinge.velocity",
            "tip": "tip",
            "height_m": "site:tip.z",
            "encoder": "angle",
        },
        fixed=["brake"],
        initial="first",
    )
    (pressure,) = model.inputs
    assert (pressure.name, pressure.unit, pressure.low, pressure.high) == (
        "pressure_pa",
        "Pa",
        -2500.0,
        52500.0,
    )
    names = [one.name for one in model.outputs]
    assert names == ["bend_rad", "rate", "tip_x_m", "tip_y_m", "tip_z_m", "height_m", "encoder"]
    read = simulated(model, drive(TIME, {"bend_rad": 0.2}, pressure_pa=STILL + 35e3))
    plain = model_of(tmp_path, pendulum(), "plain.xml")
    same = simulated(plain, drive(TIME, {"angle_rad": 0.2}, drive_n_m=STILL + 2.0))
    assert np.allclose(read["bend_rad"], same["angle_rad"], atol=1e-12)
    assert np.array_equal(read["encoder"], read["bend_rad"])
    assert np.allclose(read["rate"], same["speed"], atol=1e-12)
    assert np.allclose(read["tip_x_m"], -LENGTH * np.sin(read["bend_rad"]), atol=1e-12)
    assert np.array_equal(read["tip_z_m"], read["height_m"])


@pytest.mark.parametrize(
    ("text", "settings", "message"),
    [
        ("<mujoco><worldbody>", {}, "is not XML"),
        ("<mujoco><worldbody><bodi/></worldbody></mujoco>", {}, "MuJoCo does not read it: XML Error"),
        (pendulum(actuator=""), {}, "has no actuator"),
        (ARM.format(step=0.002, integrator="Euler", gain=1).partition("<sensor>")[0] + "</mujoco>", {}, "no sensor"),
        (pendulum(), {"inputs": {"a": "drives"}}, "did you mean 'drive'?"),
        (pendulum(), {"inputs": {"a": "drive", "b": "drive"}}, "'a' and 'b' both drive"),
        (pendulum(), {"fixed": ["drve"]}, "'fixed' names actuator 'drve'"),
        (pendulum(), {"fixed": ["drive"]}, "every actuator is fixed"),
        (pendulum(), {"outputs": {"a": "angel"}}, "did you mean 'angle'?"),
        (pendulum(), {"outputs": {"a": "tip.q"}}, "has no 'q'; it has x, y, z"),
        (pendulum(), {"outputs": {"a": "angle.x"}}, "one number, without components"),
        (pendulum(), {"outputs": {"time_s": "angle"}}, "something else; rename it"),
        (pendulum(), {"outputs": {"A": "angle", "a": "speed"}}, "give the same column 'A'"),
        (BOX.format(solref="1 1"), {"outputs": {"a": "float"}}, "ball or free"),
        (pendulum(last=KEY), {"initial": "pu"}, "which is no keyframe; it may be first, settled, up"),
        (pendulum(), {"initial": {"hing": 1.0}}, "did you mean 'hinge'?"),
    ],
)  # fmt: skip
def test_wrong_files_and_names(tmp_path: Path, text: str, settings: dict[str, Any], message: str) -> None:
    model = model_of(tmp_path, text, **settings)
    with pytest.raises(UserError) as error:
        model.outputs  # noqa: B018
    assert message in str(error.value) and "robot.xml" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_file_and_a_wrong_curve(tmp_path: Path) -> None:
    from pliant_mjcf.config import MjcfModelConfig
    from pliant_mjcf.model import MjcfModel

    with pytest.raises(UserError, match="no such file"):
        MjcfModel(MjcfModelConfig(file=tmp_path / "none.xml")).inputs  # noqa: B018
    for curve in ([[0.0, 1.0]], [[1.0, 0.0], [0.0, 1.0]]):
        with pytest.raises(ValueError, match="two points or more"):
            MjcfModelConfig(file=tmp_path, inputs={"p": {"actuator": "a", "curve": curve}})
    assert MjcfModelConfig(
        file=tmp_path, initial={"a": "30 deg", "b": "5 mm", "c": 1}
    ).initial == pytest.approx({"a": np.pi / 6.0, "b": 0.005, "c": 1.0})
    for wrong in ({"a": "5 kPa"}, {"a": None}, 3):
        with pytest.raises(ValueError, match="write an angle or a length|needs a word"):
            MjcfModelConfig(file=tmp_path, initial=wrong)


def test_a_file_that_diverges_at_once(tmp_path: Path) -> None:
    model = model_of(tmp_path, pendulum(step=0.002, damping=-1e6, integrator="Euler"))
    with pytest.raises(UserError, match="diverges at once, in run 'run'"):
        simulated(model, drive(TIME, {"angle_rad": 0.1}, drive_n_m=STILL + 1.0))


def test_remarks(tmp_path: Path) -> None:
    box = model_of(tmp_path, BOX.format(solref="0.02 1"), "soft.xml")
    push = drive(TIME, push=0.5 * STILL)
    assert box.remarks([push]) == ()
    hard = model_of(tmp_path, BOX.format(solref="-2e5 -2"), "hard.xml")
    assert any(one.startswith("Contacts chatter in run 'run'") for one in hard.remarks([push]))
    model = model_of(tmp_path, pendulum())
    (said,) = model.remarks([drive(TIME, {"angle_rad": 0.0}, drive_n_m=STILL + 5.0)])
    assert said.startswith("Input 'drive_n_m' leaves the range of actuator 'drive', −4 to 4, in run 'run'")
    wild = model_of(tmp_path, pendulum(step=0.01, damping=-5.0), "wild.xml")
    (said,) = wild.remarks([drive(TIME, {"angle_rad": 0.5}, drive_n_m=STILL)])
    assert said.startswith("The simulation of run 'run' diverges from ")


def test_a_coarse_time_step_is_said(tmp_path: Path) -> None:
    """The recording comes from a short step; a file with a long one is off by more than the noise."""
    push = drive(TIME, {"angle_rad": 0.0}, drive_n_m=np.sin(6.0 * TIME))
    fine = model_of(tmp_path, pendulum(step=0.0005, integrator="Euler"), "fine.xml")
    half = simulated(model_of(tmp_path, pendulum(step=0.01, integrator="Euler"), "half.xml"), push)
    coarse = model_of(tmp_path, pendulum(step=0.02, integrator="Euler"), "coarse.xml")
    change = half["angle_rad"] - simulated(coarse, push)["angle_rad"]
    assert coarse.step_error([push])["angle_rad"] == pytest.approx(np.sqrt(np.mean(change**2)))
    rows = zip(TIME, np.sin(6.0 * TIME), simulated(fine, push)["angle_rad"], strict=True)
    noise = np.random.default_rng(0).normal(0.0, 2e-4, len(TIME))
    lines = [f"{t:.3f},{u:.6f},{a + e:.6f}" for (t, u, a), e in zip(rows, noise, strict=True)]
    (tmp_path / "bench.csv").write_text("\n".join(["time_s,drive_n_m,angle_rad", *lines]) + "\n")
    remarks = {}
    for name in ("fine", "coarse"):
        model = pliant.MjcfModel(tmp_path / f"{name}.xml", initial="first", store=tmp_path / "store")
        remarks[name] = model.compare(tmp_path / "bench.csv").remarks
    assert not any("time step" in one for one in remarks["fine"])
    (said,) = (one for one in remarks["coarse"] if "time step" in one)
    assert "half the model's time step changes angle_rad by " in said and "a smaller step" in said


def test_the_fingerprint_changes_with_an_included_file(tmp_path: Path) -> None:
    (tmp_path / "part.xml").write_text("<mujoco><option timestep='0.001'/></mujoco>")
    text = pendulum().replace("<worldbody>", '<include file="part.xml"/><worldbody>')
    model = model_of(tmp_path, text)
    before = model.fingerprint()
    assert sorted(before["files"]) == ["part.xml", "robot.xml"] and before["mujoco"] == mujoco.__version__
    (tmp_path / "part.xml").write_text("<mujoco><option timestep='0.002'/></mujoco>")
    assert model.fingerprint() != before


def test_kinds_that_have_a_place(tmp_path: Path) -> None:
    model = model_of(tmp_path, pendulum())
    kinds = ["actuation_gain", "stiffness", "tendon_slack", "payload", "gravity_scale", "floor_friction"]
    assert model.default_kinds([*kinds, "stiffness@hinge"]) == [
        "actuation_gain",
        "stiffness",
        "payload",
        "gravity_scale",
    ]
    assert model.attachments == {"joint": ("hinge",), "tendon": (), "body": ("arm",), "world": ("world",)}


def test_ranges_have_the_size_of_the_system(tmp_path: Path) -> None:
    model = model_of(tmp_path, pendulum())
    torque = G * LENGTH  # more than the motor's 4 N m; the range is 1 rad
    declared = EffectParameter("d", "N*m*s", 0.0, (-1e5, 1e5), (0.0, 0.2))
    speed = np.sqrt(torque / LENGTH**2)
    assert model.adapted("viscous_damping@hinge", declared).plausible[1] == pytest.approx(
        0.2 * torque / speed, rel=0.05
    )
    mass = EffectParameter("m", "kg", 0.0, (0.0, 1e4), (0.0, 0.2))
    assert model.adapted("payload", mass).plausible == (0.0, 0.2)
    share = EffectParameter("f", "1", 1.0, (0.0, 10.0), (0.8, 1.2))
    assert model.adapted("body_mass", share) is share
    narrow = EffectParameter("d", "N*m", 0.0, (0.0, 1.0), (0.0, 0.5))
    assert model.adapted("coulomb_friction", narrow).plausible == (0.0, 1.0)


def test_ranges_of_tendons_and_of_stated_damping(tmp_path: Path) -> None:
    text = pendulum(damping=7.0, actuator='<motor name="cable" tendon="cable" ctrlrange="0 30"/>')
    cable = '<tendon><fixed name="cable"><joint joint="hinge" coef="0.02"/></fixed></tendon><actuator>'
    model = model_of(tmp_path, text.replace("<actuator>", cable))
    assert model.attachments["tendon"] == ("cable",)
    friction = EffectParameter("f", "N", 0.0, (-1e5, 1e5), (-5.0, 5.0))
    assert model.adapted("tendon_friction", friction).plausible == (
        -15.0,
        15.0,
    )  # 30 N, the reference has 10 N
    slack = EffectParameter("s", "m", 0.0, (0.0, 1.0), (0.0, 0.01))
    assert model.adapted("tendon_slack@cable", slack).plausible == (0.0, 0.002)  # 0.02 m of 0.1 m
    damping = EffectParameter("d", "N*m*s", 0.0, (-1e5, 1e5), (-0.2, 0.2))
    assert model.adapted("viscous_damping", damping).plausible == (-1.4, 1.4)
    assert model.adapted("viscous_damping@elbow", damping) is damping


@pytest.mark.parametrize(
    ("settings", "right"),
    [({"outputs": {"angle_deg": "hinge"}}, "angle_rad"), ({"inputs": {"pull_kPa": "drive"}}, "pull_pa")],
)
def test_columns_of_a_study_are_in_si(tmp_path: Path, settings: dict[str, Any], right: str) -> None:
    with pytest.raises(UserError, match=f"write '{right}'"):
        _ = model_of(tmp_path, pendulum(), **settings).inputs
