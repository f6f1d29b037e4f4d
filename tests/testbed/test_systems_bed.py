"""The bed of MuJoCo systems: disjoint forms, truths that repeat, strengths that are reached, labels that stay shut."""

from __future__ import annotations

import dataclasses
import json
from itertools import product
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from benchmarks.evidence import seal
from benchmarks.evidence.counting import wilson
from benchmarks.evidence.sets import signal
from benchmarks.evidence.truths import CLEAN
from benchmarks.systems import publish
from benchmarks.systems import tasks as tasks_of_the_bed
from benchmarks.systems.form_table import EVERY, KINDS, PLACES, UNKNOWN, Form
from benchmarks.systems.judging import judged_twice, summary, without_places
from benchmarks.systems.plausible import PLAUSIBLE, Plausible
from benchmarks.systems.protocol import RUNS, protocol
from benchmarks.systems.robots import ROBOTS, mjcf, present
from benchmarks.systems.sets import ENOUGH, SystemSpec, largest_at, make_set, within_reach
from benchmarks.systems.tasks import CODE, SystemPlan, SystemTask, kinds_of, make, small_plan, spread
from benchmarks.systems.truth import FINER, FailedTruthError, Hidden, Truth

from benchmarks import pages
from pliant.registry.discovery import discover

KEY = bytes(range(32))
SHORT = dataclasses.replace(ROBOTS["reacher"], duration_s=2.0)
CANDIDATES = ("plugins/pliant_systems", "plugins/pliant_mjcf")


def apart(one: Form, other: Form) -> bool:
    """Return whether the equations differ, or a number is drawn from ranges without a common point."""
    if (one.equation, one.shape) != (other.equation, other.shape):
        return True
    numbers = {*one.ranges, *other.ranges} - set(PLACES)
    if any((name in one.ranges) != (name in other.ranges) for name in numbers):
        return True
    pairs = [(one.ranges[name], other.ranges[name]) for name in numbers]
    return any(b < c or d < a for (a, b), (c, d) in pairs)


def test_no_form_of_a_kind_is_in_both_splits() -> None:
    shared = [
        (kind, one.name, other.name)
        for kind, table in EVERY.items()
        for one, other in product(table.calibration, table.judged)
        if not apart(one, other)
    ]
    assert not shared
    form = KINDS["viscous_damping"].calibration[0]
    assert not apart(form, dataclasses.replace(form, name="other", ranges={"p": (0.8, 0.9)}))


def test_every_effect_of_mujoco_models_is_hidden_but_that_of_floors() -> None:
    shipped = {one.kind for one in discover().for_model("mjcf").by_interface("effect")}
    assert shipped - {"floor_friction"} == set(KINDS)
    assert not set(UNKNOWN) & shipped and len(UNKNOWN) >= 6


def test_there_are_systems_of_packages_that_are_always_there() -> None:
    there = present()
    assert len(there) >= 4
    for robot in there:
        model = mujoco.MjModel.from_xml_string(mjcf(robot.name))
        assert model.ngeom == 0 and model.nsensor == len(robot.joints) + len(robot.sites)
        assert kinds_of(robot.name, tuple(KINDS)) and kinds_of(robot.name, tuple(UNKNOWN))


def test_runs_begin_at_rest_and_two_are_repeated() -> None:
    runs = {run.name: run for run in protocol(ROBOTS["reacher"], np.random.default_rng(0))}
    assert tuple(runs) == RUNS
    for name in ("slow", "many"):
        assert np.array_equal(runs[f"{name}_1"].commands, runs[f"{name}_2"].commands)
    assert all(not run.commands[:10].any() and run.commands.any() for run in runs.values())


def test_a_truth_is_not_the_file_and_is_the_same_again() -> None:
    runs = protocol(SHORT, np.random.default_rng(0))
    truth = Truth(SHORT, runs, 3)
    file = mujoco.MjModel.from_xml_string(mjcf("reacher"))
    model = truth.model()
    assert model.opt.timestep == file.opt.timestep / FINER and model.opt.integrator != file.opt.integrator
    off = model.dof_damping / file.dof_damping - 1.0
    assert 0.0 < np.abs(off).max() < 0.02
    for one, other in zip(truth.readings(), Truth(SHORT, runs, 3).readings(), strict=True):
        assert all(np.array_equal(one[name], other[name]) for name in one)
    assert any(np.ptp(run["angle1_rad"]) > 0.1 for run in truth.readings())


@pytest.mark.parametrize(
    ("kind", "split"),
    [
        ("actuation_gain", "judged"),
        ("supply_lag", "calibration"),
        ("sensor_delay", "judged"),
        ("viscous_damping", "judged"),
        ("supply_sag", "calibration"),
    ],
)
def test_a_set_reaches_its_strength_and_is_the_same_again(kind: str, split: Any, monkeypatch: Any) -> None:
    monkeypatch.setitem(ROBOTS, "reacher", SHORT)
    made, again = (make_set(SystemSpec(kind, 1, "reacher", split)) for _ in range(2))
    assert made.csv == again.csv and made.label == again.label
    label = made.label
    assert label["snr_reached"] >= ENOUGH * label["snr_wanted"] and 1.5 <= label["snr_wanted"] <= 4.0
    assert signal(made.clean, made.hidden, label["sigma"]) == pytest.approx(label["snr_reached"])
    assert label["forms"][0] in [form.name for form in EVERY[kind].of(split)]
    assert label["unknown"] == (kind in UNKNOWN)
    other = make_set(SystemSpec(kind, 1, "reacher", split, "drawn for other code"))
    assert other.csv != made.csv


def test_labels_are_shut_and_files_do_not_tell(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setitem(ROBOTS, "reacher", SHORT)
    task = SystemTask("effect", spec=SystemSpec("viscous_damping", 0, "reacher", "judged"))
    name = task.secret_id(KEY)
    make(task, name, tmp_path, KEY)
    files = {file.name: file.read_text() for file in tmp_path.iterdir()}
    assert set(files) == {f"{name}.csv", f"{name}.xml", f"{name}_study.yaml", f"{name}.sealed"}
    assert not any(word in text for text in files.values() for word in ("viscous", "reached", "judged"))
    assert files[f"{name}.xml"] == mjcf("reacher")
    label = seal.unseal(files[f"{name}.sealed"], KEY)
    assert label["kind"].startswith("viscous_damping")
    with pytest.raises(seal.BrokenSealError):
        seal.unseal(files[f"{name}.sealed"], bytes(32))
    assert task.public_id != name and task.secret_id(bytes(32)) != name


def test_the_plan_has_every_kind_and_group_and_more_of_cheap_systems(monkeypatch: Any) -> None:
    plan = SystemPlan(tuple(one.name for one in present()))
    tasks = plan.tasks()
    assert len({task.public_id for task in tasks}) == len(tasks) and 110 <= len(tasks) <= 130
    kinds = [task.spec.kind for task in tasks]
    somewhere = {kind for robot in plan.robots for kind in kinds_of(robot, tuple(EVERY))}
    assert {*kinds} == {*somewhere, CLEAN} and {task.spec.robot for task in tasks} == set(plan.robots)
    assert all(kinds.count(kind) == plan.seeds for kind in somewhere & set(KINDS))
    groups = [task.group for task in tasks]
    assert groups.count("clean") >= 30 and groups.count("unknown") >= 20
    half = dataclasses.replace(plan, share=0.5).tasks()
    assert half == tasks[: len(half)] and {task.spec.robot for task in half} == set(plan.robots)
    assert {task.spec.kind for task in small_plan().tasks()} == set(small_plan().kinds)
    assert set(CANDIDATES) <= set(CODE)
    monkeypatch.setitem(ROBOTS, "pusher", dataclasses.replace(ROBOTS["pusher"], weight=0.2))
    spread_out = spread({"supply_lag": 2, "sensor_lag": 2, CLEAN: 8}, ("reacher", "pusher"))
    of_pusher = sum(robots.count("pusher") for robots in spread_out.values())
    assert [len(robots) for robots in spread_out.values()] == [2, 2, 8] and 0 < of_pusher <= 3


def test_every_kind_has_a_plausible_range() -> None:
    assert set(PLAUSIBLE) == set(EVERY) and all(one.largest > 0.0 and one.unit for one in PLAUSIBLE.values())


def test_targets_are_drawn_within_reach() -> None:
    assert within_reach(3.0, 40.0) == 3.0 and within_reach(3.0, 1.4) is None
    assert within_reach(1.5, 2.0) == 1.5 and within_reach(4.0, 2.0) == 2.0


def test_a_strength_beyond_the_plausible_is_hidden_elsewhere(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setitem(ROBOTS, "reacher", SHORT)
    usual = make_set(SystemSpec("actuation_gain", 1, "reacher", "judged")).label
    assert 0.0 < usual["strength"] <= PLAUSIBLE["actuation_gain"].largest
    monkeypatch.setitem(PLAUSIBLE, "actuation_gain", Plausible(1e-4, "of the stated gain"))
    with pytest.raises(FailedTruthError, match="plausible"):
        make_set(SystemSpec("actuation_gain", 1, "reacher", "judged"))
    monkeypatch.setattr("benchmarks.systems.sets.PLAUSIBLE", {"payload": Plausible(0.5, "", 0.1)})
    truth, far = Truth(ROBOTS["swimmer"], (), 0), {"away": 0.5, "x": 1.0, "y": 0.0, "z": 0.0}
    payload = Hidden("payload", KINDS["payload"].judged[0], ("torso",), far)
    assert largest_at(truth, payload) == 0.0
    assert largest_at(truth, dataclasses.replace(payload, numbers=far | {"away": 0.2})) == 0.5


def test_an_effect_that_a_system_cannot_show_is_hidden_in_another(tmp_path: Path, monkeypatch: Any) -> None:
    seen: list[SystemSpec] = []

    def made(spec: SystemSpec, name: str) -> Any:
        seen.append(spec)
        if spec.robot != "swimmer":
            raise FailedTruthError("not here")
        return make_set(dataclasses.replace(spec, kind=CLEAN), name)

    monkeypatch.setattr(tasks_of_the_bed, "make_set", made)
    task = SystemTask("effect", spec=SystemSpec("dead_zone", 0, "reacher", "judged"))
    make(task, "one", tmp_path, KEY)
    assert seal.unseal((tmp_path / "one.sealed").read_text(), KEY)["robot"] == "swimmer"
    assert seen[0] == task.spec and all(spec.draw != task.spec.draw for spec in seen[1:])
    monkeypatch.setattr(tasks_of_the_bed, "present", lambda: [ROBOTS["reacher"]])
    with pytest.raises(FailedTruthError, match="reacher: not here"):
        make(task, "other", tmp_path, KEY)


def answer(kind: str, **result: Any) -> dict[str, Any]:
    """Return a stored answer to a set that hides this kind."""
    right = ["nothing_missing"] if kind == CLEAN else ["missing_effect"]
    group = "clean" if kind == CLEAN else "unknown" if kind in UNKNOWN else "effect"
    label = {"kind": kind, "forms": [], "engine": "implicit", "robot": "reacher", "protocol": "driven"}
    label |= {"snr_reached": 2.0, "excited": True, "right": right, "unknown": kind in UNKNOWN}
    if kind in UNKNOWN:
        label["right"] = ["unknown_effect", "not_repeatable"]
    return {"group": group, "mode": "diagnose", "label": label, "result": result, "wall_s": 60.0}


def test_a_right_kind_at_a_wrong_place_is_right_but_for_its_place() -> None:
    found = [
        answer("viscous_damping@joint0", verdict="missing_effect", selected=["viscous_damping@joint0"]),
        answer("viscous_damping@joint0", verdict="missing_effect", selected=["viscous_damping@joint1"]),
        answer("viscous_damping@joint0", verdict="missing_effect", selected=["stiffness@joint0"]),
        answer("supply_sag", verdict="unknown_effect", selected=[]),
        answer(CLEAN, verdict="nothing_missing", selected=[]),
    ]
    data = summary(judged_twice(found))
    assert (data["placed"]["right"], data["effects"]["right"], data["effects"]["n"]) == (1, 2, 3)
    assert data["wrong_kind"]["right"] == 1 and data["unknown"]["right"] == 1
    assert data["false_alarms"]["right"] == 0 and data["clean_right"]["right"] == 1
    assert (data["effects"]["low"], data["effects"]["high"]) == wilson(2, 3)
    text = publish.as_text(data)
    assert "**66.7 %**" in text and "`viscous_damping` | 1/3 | 2/3" in text


def test_a_class_of_one_kind_at_several_places_is_that_kind() -> None:
    places = ["viscous_damping@joint0", "viscous_damping"]
    found = answer("viscous_damping@joint0", verdict="ambiguous", selected=[], selected_class=places)
    bare = without_places(found)
    assert bare["result"]["selected"] == ["viscous_damping"] and bare["result"]["selected_class"] == []
    (twice,) = judged_twice([found])
    assert twice.kind.is_right and not twice.placed.is_right and twice.placed.by_class
    both = answer(
        "saturation", verdict="ambiguous", selected_class=["saturation", "saturation@b"], selected=[]
    )
    both["result"]["beside_class"] = ["saturation@a"]
    assert without_places(both)["result"]["selected"] == ["saturation"]


def test_the_page_has_the_stored_answers() -> None:
    text = publish.PAGE.read_text()
    assert pages.rendered(text, publish.MARK, publish.TABLES, publish.stored()) == text


def test_a_set_end_to_end(tmp_path: Path, monkeypatch: Any) -> None:
    from pliant import api

    monkeypatch.setitem(ROBOTS, "reacher", SHORT)
    task = SystemTask("effect", spec=SystemSpec("actuation_gain", 0, "reacher", "calibration"))
    make(task, "one", tmp_path, KEY)
    opened = api.open_study(tmp_path / "one_study.yaml", store=tmp_path / "store")
    assert [run.name for run in api.read_measurement(opened, tmp_path / "one.csv").runs] == list(RUNS)
    model = api.predictor(opened, tmp_path / "one.csv")
    label = seal.unseal((tmp_path / "one.sealed").read_text(), KEY)
    left = [
        (run.outputs[name] - read[name]) / sigma
        for run, read in zip(model.measurement.runs, model.predict(), strict=True)
        for name, sigma in label["sigma"].items()
    ]
    error = float(np.sqrt(np.mean(np.concatenate(left) ** 2)))
    assert error == pytest.approx(np.hypot(label["snr_reached"], 1.0), rel=0.3)
    kinds = ["actuation_gain"] if "@" not in label["kind"] else [label["kind"]]
    fitted = api.extend(opened, kinds, tmp_path / "one.csv")
    assert fitted.after.over_floor < 0.6 * fitted.before.over_floor
    assert json.dumps(label)
