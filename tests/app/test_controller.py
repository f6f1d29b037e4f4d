"""A session loses and recomputes nothing, reports errors on unseen runs, and saves a study with the fitted values."""

from __future__ import annotations

import json
import re
import shlex
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pliant import api
from pliant.diagnosis.data_split import split_runs
from pliant.diagnosis.extension import Ground, extend
from pliant.errors import UserError
from pliant_app import work
from pliant_app.controller import SessionController
from pliant_app.folder import SessionFolder
from pliant_app.open_model import AnswerCache
from pliant_app.view_model import predicted_points
from pliant_app.work import varied_forms

from .conftest import recording


def _ticked(controller: SessionController, kind: str) -> tuple[dict[str, object], ...]:
    catalogue = controller.view()["model"]["catalogue"]
    return ({**next(one["begun"] for one in catalogue if one["kind"] == kind)},)


def _fitted(controller: SessionController, kind: str) -> dict[str, object]:
    controller.run("fit", [kind])
    controller.runner.wait()
    return controller.view()["model"]


def test_a_fit_gives_what_the_command_gives_on_the_training_runs(
    controller: SessionController, bench: Path
) -> None:
    model = _fitted(controller, "actuation_gain")
    opened = api.open_study(bench / "bend.yaml", store=bench / "store")
    training = split_runs(api.read_measurement(opened)).training
    found = extend(Ground.from_study(opened.context, opened.study, training), (), ["actuation_gain"])
    assert model["effects"][0]["gain"] == found.values["actuation_gain.gain"]
    estimate = model["fit"]["estimates"][0]
    assert estimate["low"] < 1.25 < estimate["high"]
    first, last = model["steps"][0], model["steps"][-1]
    assert last["aside"] < 0.3 * first["aside"]
    assert 0.7 < last["aside"] < 1.5
    assert not model["warnings"]


def test_work_that_was_done_is_not_done_again(
    controller: SessionController, bench: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = _fitted(controller, "actuation_gain")
    monkeypatch.setattr(work, "fit", lambda *_: pytest.fail("fitted twice"))
    again = SessionController(SessionFolder(bench / "session"), bench / "store")
    again.begin(bench / "bend.yaml", [])
    after = again.view()["model"]
    assert json.dumps(after["steps"]) == json.dumps(before["steps"])
    again.go(0)
    again.run("fit", ["actuation_gain"])
    assert again.runner.job is None
    assert again.view()["model"]["effects"] == before["effects"]


def test_a_diagnosis_in_another_session_is_answered_from_the_store(
    controller: SessionController, bench: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    controller.run("diagnose")
    controller.runner.wait(600.0)
    before = controller.view()["model"]["diagnosis"]
    aside = controller.now().split.runs
    assert aside and work.ASKS_ALL in before["asked"] and f"{len(aside)} of" in before["asked"]
    assert work.ASKS_ALL in (controller.folder.results / before["report"]).read_text().replace("&#39;", "'")
    monkeypatch.setattr(work, "diagnose_with", lambda *_, **__: pytest.fail("diagnosed twice"))
    other = SessionFolder(bench / "other")
    again = SessionController(other, bench / "store")
    again.begin(bench / "bend.yaml", [])
    again.run("diagnose")
    again.runner.wait(600.0)
    assert again.view()["model"]["diagnosis"] == before
    assert (other.results / before["report"]).is_file()
    if before["protocol"]:
        assert (other.results / before["protocol"]).is_file()


def test_work_that_was_cut_off_is_taken_up(controller: SessionController, bench: Path) -> None:
    folder = SessionFolder(bench / "session")
    folder.keep(replace(controller.state, pending={"what": "fit", "kinds": ["actuation_gain"]}))
    again = SessionController(folder, bench / "store")
    again.begin(bench / "bend.yaml", [])
    again.runner.wait()
    assert again.view()["model"]["steps"][-1]["fitted"]
    assert folder.state().pending is None


def test_stopped_work_changes_nothing(controller: SessionController) -> None:
    steps = controller.state.steps
    controller.run("diagnose")
    controller.stop()
    controller.runner.wait()
    assert controller.state.steps == steps
    assert controller.state.pending is None
    assert "stopped" in controller.said[-1] or controller.view()["model"]["diagnosis"]


def test_undo_redo_and_a_new_step_behind_an_undone_one(controller: SessionController) -> None:
    effects = _ticked(controller, "actuation_gain")
    controller.step(effects, [], "ticked")
    controller.go(0)
    assert controller.view()["model"]["effects"] == ()
    controller.go(1)
    assert controller.view()["model"]["effects"][0]["kind"] == "actuation_gain"
    controller.go(0)
    controller.step((), ["r5"], "r5 off")
    assert [step.words for step in controller.state.steps] == ["the study as it is", "r5 off"]


def test_a_run_that_is_off_counts_in_no_error(controller: SessionController) -> None:
    model = controller.now().without(["r0"])
    assert not np.isfinite(model.read.runs[0].outputs["angle_rad"]).any()
    assert "r0" not in [model.read.runs[k].name for k in model.split.runs]
    with pytest.raises(UserError, match="one run"):
        controller.step((), [f"r{k}" for k in range(6)], "all off")


def test_switching_runs_off_moves_no_run_between_fitted_and_put_aside(controller: SessionController) -> None:
    """Otherwise switching off one run would show and fit another run that was held out."""
    whole = {run["name"]: run["aside"] for run in controller.curves()["runs"]}
    first = controller.view()["model"]["steps"][0]
    for run in [name for name, aside in whole.items() if not aside][:3]:
        controller.toggle(run, on=False)
    off = set(controller.state.now.off)
    assert {run["name"]: run["aside"] for run in controller.curves()["runs"]} == whole and len(off) == 3
    steps = controller.view()["model"]["steps"]
    assert len({(one["error"], one["aside"]) for one in steps}) == 1  # the same model, on the same runs
    for run in off:
        controller.toggle(run, on=True)
    assert controller.view()["model"]["steps"][0] == first


def test_choices_that_come_at_once_are_all_kept(controller: SessionController) -> None:
    """Two tabs, or fast clicks: each choice is applied to the newest state."""
    training = [run["name"] for run in controller.curves()["runs"] if not run["aside"]]
    kinds = ["actuation_gain", "stiffness", "sensor_bias"]
    with ThreadPoolExecutor(6) as pool:
        asked = [pool.submit(controller.toggle, run, False) for run in training[:3]]
        asked += [pool.submit(controller.tick, kind, True) for kind in kinds]
        for one in asked:
            one.result()
    assert set(controller.state.now.off) == set(training[:3])
    assert sorted(str(one["kind"]) for one in controller.state.now.effects) == sorted(kinds)
    controller.tick("stiffness", on=False)
    assert "stiffness" not in [one["kind"] for one in controller.state.now.effects]
    with pytest.raises(UserError, match="no effect 'nonsense'"):
        controller.tick("nonsense", on=True)


def test_a_recording_is_added_to_what_the_study_names_and_undo_leaves_it_out(
    controller: SessionController, bench: Path
) -> None:
    controller.tick("actuation_gain", on=True)
    before = {run["name"]: run["aside"] for run in controller.curves()["runs"]}
    lines = recording(seed=4).splitlines()
    more = "\n".join([lines[0], *(f"s{line[1:]}" for line in lines[1:])]) + "\n"
    (controller.folder.files / "more.csv").write_text(more)
    controller.take("more.csv")
    assert (
        controller.said[-1]
        == "bench.csv and more.csv are one measurement now. Undo leaves more.csv out again."
    )
    after = {run["name"]: run["aside"] for run in controller.curves()["runs"]}
    assert len(after) == 12 and {name: after[name] for name in before} == before
    assert any(aside for name, aside in after.items() if name not in before)
    assert [one["kind"] for one in controller.state.now.effects] == ["actuation_gain"]
    again = SessionController(SessionFolder(bench / "session"), bench / "store")
    again.begin(bench / "bend.yaml", [])
    assert {run["name"]: run["aside"] for run in again.curves()["runs"]} == after
    again.go(1)
    assert {run["name"]: run["aside"] for run in again.curves()["runs"]} == before
    (controller.folder.files / "bad.csv").write_text("a,b\n1,2\n")
    state = replace(again.state, version=0)
    with pytest.raises(UserError):
        again.take("bad.csv")
    assert replace(again.state, version=0) == state and not (controller.folder.files / "bad.csv").exists()


def test_an_effect_that_makes_unseen_runs_worse_is_warned_about(controller: SessionController) -> None:
    """The warning also appears for values set by hand, before any fit."""
    controller.step(({"kind": "sensor_bias", "bias_rad": 0.3},), [], "a bias that is not there")
    assert any("unseen runs become worse" in one for one in controller.view()["model"]["warnings"])


@pytest.mark.parametrize("false", ["permanent_set", "dead_zone"])
def test_a_false_add_is_warned_about(controller: SessionController, bench: Path, false: str) -> None:
    """A gain explains all of the error: an additional effect lowers the fitted error by chance only."""
    assert not _fitted(controller, "actuation_gain")["warnings"]
    right = SessionController(SessionFolder(bench / "right"), bench / "store")
    right.begin(Path(controller.exports.save("right")["path"]), [])
    model = _fitted(right, false)
    assert model["steps"][-1]["fitted"], right.said
    assert any("not predicted better" in one for one in model["warnings"])


def test_a_false_effect_next_to_a_true_one_is_warned_about(controller: SessionController) -> None:
    """A joint fit must not hide behind the true effect that the other one gains nothing."""
    controller.run("fit", ["actuation_gain", "permanent_set"])
    controller.runner.wait()
    warnings = controller.view()["model"]["warnings"]
    assert any(one.startswith("permanent_set: ") for one in warnings)
    assert not any(one.startswith("actuation_gain") for one in warnings)


def test_an_effect_ticked_without_a_gain_on_unseen_runs_is_said(controller: SessionController) -> None:
    """An effect that neither worsens nor improves unseen runs gets a note; an effect that improves them gets none."""
    controller.step(({"kind": "sensor_bias", "bias_rad": 1e-5},), [], "next to nothing")
    (said,) = controller.view()["model"]["warnings"]
    assert "unseen runs do not show that it is missing" in said
    controller.step(({"kind": "actuation_gain", "gain": 1.1},), [], "better, and far from enough")
    (said,) = controller.view()["model"]["warnings"]
    assert re.search(r"actuation_gain .* still [2-9]\.\d+ times the noise: .*'Diagnose'", said)
    controller.step(({"kind": "actuation_gain", "gain": 1.25},), [], "right")
    assert not controller.view()["model"]["warnings"]


def test_a_fit_that_explains_little_is_said_without_a_diagnosis(controller: SessionController) -> None:
    assert any(
        "still" in one and "'Diagnose'" in one for one in _fitted(controller, "sensor_bias")["warnings"]
    )


def test_copying_changes_no_saved_study(controller: SessionController) -> None:
    controller.step(({"kind": "actuation_gain", "gain": 1.2},), [], "nearly right")
    saved = Path(controller.exports.save()["path"])
    before = saved.read_text()
    controller.step(({"kind": "actuation_gain", "gain": 1.1},), [], "another")
    assert "gain: 1.1" in controller.exports.as_yaml()["yaml"]
    assert saved.read_text() == before
    assert [one.name for one in controller.folder.saved.iterdir()] == [saved.name]


def test_saving_again_writes_over_no_other_study(controller: SessionController) -> None:
    controller.step(({"kind": "actuation_gain", "gain": 1.2},), [], "nearly right")
    first, same = Path(controller.exports.save()["path"]), Path(controller.exports.save()["path"])
    before = first.read_text()
    controller.step(({"kind": "actuation_gain", "gain": 1.1},), [], "another")
    second = Path(controller.exports.save()["path"])
    assert same == first and second.name == f"{first.stem}-2.yaml"
    assert first.read_text() == before and "gain: 1.1" in second.read_text()


def test_what_several_threads_ask_is_worked_out_once() -> None:
    kept, begun = AnswerCache(2), threading.Barrier(4)
    made: list[int] = []

    def work() -> int:
        time.sleep(0.02)
        made.append(1)
        return len(made)

    def ask() -> int:
        begun.wait()
        return int(kept.get("same", work))

    with ThreadPoolExecutor(4) as pool:
        assert [one.result() for one in [pool.submit(ask) for _ in range(4)]] == [1] * 4
    kept.get("a", lambda: 0), kept.get("b", lambda: 0)
    assert kept.get("same", work) == 2  # the oldest entry was removed
    with pytest.raises(ZeroDivisionError):
        kept.get("wrong", lambda: 1 // 0)
    assert kept.get("wrong", lambda: 5) == 5


def test_a_saved_study_reads_back_with_the_same_error(controller: SessionController, bench: Path) -> None:
    model = _fitted(controller, "actuation_gain")
    said = controller.exports.save()
    saved = Path(said["path"])
    assert shlex.split(said["commands"][1])[:2] == ["pliant", "extend"]
    assert "actuation_gain" in said["commands"][1]
    opened = api.open_study(saved, store=bench / "store")
    assert [effect.canonical() for effect in opened.study.effects] == [dict(one) for one in model["effects"]]
    assert opened.study.posterior is not None
    assert np.isclose(api.compare(opened).outputs["angle_rad"].rmse, _rmse(controller), rtol=1e-6)
    by_hand = (dict(model["effects"][0]) | {"gain": 1.1},)
    controller.step(by_hand, [], "by hand")
    mine = controller.exports.save("my own")
    assert shlex.split(mine["commands"][-1]) == ["pliant", "compare", mine["path"]]
    again = api.open_study(mine["path"], store=bench / "store")
    assert again.study.effects[0].canonical()["gain"] == 1.1
    assert again.study.posterior is None


def _rmse(controller: SessionController) -> float:
    model = controller.now()
    predicted = model.predicted(controller.state.now.effects)
    pairs = zip(model.measurement.runs, predicted, strict=True)
    return float(
        np.sqrt(np.mean(np.concatenate([r.outputs["angle_rad"] - p["angle_rad"] for r, p in pairs]) ** 2))
    )


def test_the_pictures_have_every_reading_and_the_screen_the_hidden_effect(
    controller: SessionController,
) -> None:
    shown = controller.curves()
    assert sum(run["points"] for run in shown["runs"]) == 240 == len(shown["outputs"][0]["measured"])
    model = controller.now()
    packed = predicted_points(model, model.predicted(()))["angle_rad"]
    assert len(packed) == 4 * 240 * 4 / 3
    found = controller.screen()["kinds"]
    assert found["actuation_gain"]["explains"] > 0.9
    assert found["actuation_gain"]["explains"] >= max(one["explains"] for one in found.values()) - 0.05
    assert not found["thermal_softening"]["shown"] if "thermal_softening" in found else True


def test_effects_that_cannot_be_are_refused(controller: SessionController) -> None:
    for wrong in (
        {"kind": "no_such"},
        {"kind": "actuation_gain", "gain": 1e9},
        {"kind": "actuation_gain", "x": 1},
    ):
        with pytest.raises(UserError):
            controller.step((wrong,), [], "wrong")


def test_an_own_effect_is_listed_and_read_anew_when_its_file_changes(bench: Path) -> None:
    text = (Path(__file__).parents[2] / "docs" / "write_an_effect.md").read_text("utf-8")
    code = text.split("```python\n", 1)[1].split("```", 1)[0]
    file = bench / "stiffening.py"
    file.write_text(code)
    study = bench / "own.yaml"
    study.write_text((bench / "bend.yaml").read_text() + "plugins: [stiffening.py]\n")
    controller = SessionController(SessionFolder(bench / "own"), bench / "store")
    with pytest.warns(match="stiffening.py"):  # the warning that every command prints before it runs code
        controller.begin(study, [])

    def listed() -> dict[str, object]:
        return next(one for one in controller.view()["model"]["catalogue"] if one["kind"] == "stiffening")

    assert listed()["file"] == "stiffening.py"
    before = listed()["sliders"][0]["high"]
    version, key = controller.status()["version"], controller.now().key
    assert controller.status()["version"] == version
    file.write_text(code.replace("plausible=(0.5, 5.0)", "plausible=(0.5, 8.0)") + "# other\n")
    assert controller.status()["version"] > version
    assert listed()["sliders"][0]["high"] > before
    assert controller.now().key != key  # results of the former code are not reused for the new one
    file.write_text("x =")
    controller.status()
    assert "not Python" in controller.view()["refused"]
    file.write_text(code)
    controller.status()
    assert listed()["sliders"][0]["high"] == before


@pytest.mark.slow
def test_a_learned_term_is_drawn_where_there_are_data_and_saved(bench: Path) -> None:
    """The sensor adds 0.03 sin(30 u), which no listed effect describes."""
    lines = recording(hidden=1.0).splitlines()
    rows = [line.split(",") for line in lines[1:]]
    angles = [float(row[-1]) for row in rows]
    waved = [[*row[:-1], f"{a + 0.03 * np.sin(30 * a):.6f}"] for row, a in zip(rows, angles, strict=True)]
    (bench / "bench.csv").write_text("\n".join([lines[0], *map(",".join, waved)]) + "\n")
    controller = SessionController(SessionFolder(bench / "session"), bench / "store")
    controller.begin(bench / "bend.yaml", [])
    controller.run("improve", learned=True)
    controller.runner.wait()
    model = controller.view()["model"]
    first, last = model["steps"][0], model["steps"][-1]
    assert last["aside"] < 0.3 * first["aside"]
    curve = model["fit"]["learned"]["curve"]
    x, value = np.array(curve["x"]), np.array(curve["value"])
    at, knots = np.array(curve["knots"])
    assert np.allclose(np.interp(at, x, value), knots, atol=0.03 * np.ptp(knots))
    assert (x[0] < curve["ends"][0]) and (x[-1] > curve["ends"][1])
    assert abs(value[[0, -1]]).max() < 1e-9 < np.ptp(value)  # beyond the data it makes no statement
    saved = api.open_study(controller.exports.save()["path"], store=bench / "store")
    assert [effect.canonical() for effect in saved.study.effects] == [dict(one) for one in model["effects"]]


def test_forms_that_a_diagnosis_on_the_way_lets_vary_are_fitted_as_improve_fits_them() -> None:
    first = {
        "forms": {"viscoelastic": ["viscoelastic"], "backlash": [], "backlash+viscoelastic": ["backlash"]}
    }
    later = {"forms": {"backlash": ["backlash"]}}
    effects = ({"kind": "viscoelastic", "share": 0.5},)
    assert varied_forms(["viscoelastic"], [((), first)]) == ["viscoelastic"]
    assert varied_forms(["backlash", "viscoelastic"], [((), first)]) == ["backlash"]  # the fit of the pair
    assert varied_forms(["dead_zone", "viscoelastic"], [((), first)]) == ["viscoelastic"]
    assert varied_forms(["backlash", "viscoelastic"], [(effects, later)]) == ["backlash"]
    assert varied_forms(["backlash"], [((), {})]) == []


def test_the_robot_in_space_is_the_models_and_shows_no_error_in_held_out_runs(
    controller: SessionController,
) -> None:
    model = controller.opened()
    k = next(k for k in range(len(model.measurement.runs)) if k not in model.split.runs)
    aside = model.measurement.runs[model.split.runs[0]].name
    effects = ({"kind": "actuation_gain", "gain": 1.25},)
    found = controller.space(effects, model.measurement.runs[k].name)
    bend = next(one for one in found["colourings"] if one["name"] == "bend")
    assert bend["limits"][1] == pytest.approx(
        np.degrees(model.predicted(effects)[k]["angle_rad"].max()), rel=1e-3
    )
    error = next(one for one in found["colourings"] if one["name"] == "error 0")
    apart = model.measurement.runs[k].outputs["angle_rad"] - model.predicted(effects)[k]["angle_rad"]
    assert (
        0.5 * np.degrees(np.abs(apart).max()) < error["limits"][1] <= 1.001 * np.degrees(np.abs(apart).max())
    )
    assert "apart" in [one["name"] for one in found["colourings"]]  # from the unmodified model
    assert not [
        one for one in controller.space(effects, aside)["colourings"] if one["name"].startswith("error")
    ]
    with pytest.raises(UserError, match="no run 'nobody'"):
        controller.space(effects, "nobody")


def test_notes_that_are_dropped_settle_what_a_recording_does_not_say(tmp_path: Path) -> None:
    controller = SessionController(SessionFolder(tmp_path / "session"), tmp_path / "store")

    def drop(name: str, text: str) -> None:
        (controller.folder.files / name).write_text(text)
        controller.take(name)

    with pytest.raises(UserError, match="drop the recording first"):
        drop("bench.yaml", "units: {kanal_3: deg}\n")
    rows = "\n".join(f"{0.1 * k:.1f},{k % 9},{2 * (k % 9)}" for k in range(40))
    drop("bench.csv", f"time_s,pressure_kpa,kanal_3\n{rows}\n")
    assert "kanal_3" in controller.view()["recording"]["refused"]
    with pytest.raises(UserError, match=r"none that was dropped is called so; name it bench.yaml"):
        drop("other.yaml", "rename: {kanal_3: angle_deg}\n")
    with pytest.raises(UserError, match="leaves the session's folder"):
        drop("bench.yaml", "join: ../../secret.csv\n")
    drop("bench.yaml", "measurements:\n  file: bench.csv\n  rename: {kanal_3: angle_deg}\n")
    found = controller.view()["recording"]
    assert {one["heading"]: one["name"] for one in found["columns"]}["kanal_3"] == "angle_rad"


def test_the_page_shows_the_doubts_about_the_study(controller):
    """The study has no gravity; nothing else in it is doubtful."""
    (said,) = controller.view()["model"]["study_doubts"]
    assert "no gravity" in said
