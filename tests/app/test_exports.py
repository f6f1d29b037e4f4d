"""The exports of a session: commands and a notebook that run, and a self-contained page."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from tests.command import called

from pliant import api
from pliant.errors import UserError
from pliant.notebook.study import StudyHandle
from pliant_app.controller import SessionController
from pliant_app.exports import ModelHistory, anywhere, commands, notebook

GAIN = ({"kind": "actuation_gain", "gain": 1.25},)


def test_the_page_stands_alone_and_says_what_was_doubted(controller: SessionController) -> None:
    controller.step(({"kind": "sensor_bias", "bias_rad": 0.3},), [], "a bias that is not there")
    kept = Path(controller.exports.keep("page")["kept_path"])
    html = kept.read_text("utf-8")
    assert "a bias that is not there" in html and "unseen runs become worse" in html
    assert "17.19" in html  # 0.3 rad, in the page's unit of degrees
    shown = controller.view()["model"]["steps"][-1]
    assert f"{shown['aside']:.3g}" in html
    assert not re.search(r"(?:src|href)=\"http", html)
    assert controller.exports.keep("page", "mine")["kept"] == "mine.html" and kept.exists()


def test_a_copied_study_reads_its_files_from_anywhere(controller: SessionController, tmp_path: Path) -> None:
    controller.step(GAIN, [], "by hand")
    copy = tmp_path / "downloads" / "mine.yaml"
    copy.parent.mkdir()
    for text in (anywhere(Path(controller.exports.save()["path"])), controller.exports.as_yaml()["yaml"]):
        copy.write_text(text)
        assert api.compare(api.open_study(copy, store=tmp_path / "store")).rmse_over_floor < 1.2


def test_commands_run_and_give_the_saved_study_error(controller: SessionController, bench: Path) -> None:
    controller.step(GAIN, [], "by hand")
    said = controller.exports.keep("commands")
    lines = [shlex.split(one) for one in Path(said["kept_path"]).read_text().splitlines()[2:]]
    assert [line[:2] for line in lines] == [["pliant", "compare"]] * 2
    told, where = bench / "told.json", [f"--store={bench / 'store'}", f"--out={bench / 'out'}"]
    called(*lines[-1][1:], f"--json={told}", *where).done()
    found = json.loads(told.read_text())
    expected = api.compare(api.open_study(said["path"], store=bench / "store"))
    assert np.isclose(_value(found, "rmse_over_floor"), expected.rmse_over_floor)


def _value(found: object, key: str) -> float:
    """Return the first value of a key at any depth."""
    if isinstance(found, dict):
        if key in found and isinstance(found[key], float):
            return found[key]
        found = list(found.values())
    if isinstance(found, list):
        for one in found:
            if (inner := _value(one, key)) == inner:
                return inner
    return float("nan")


def test_a_notebook_is_one_and_its_code_names_what_there_is(tmp_path: Path) -> None:
    way = ModelHistory(
        tmp_path / "a.yaml", (tmp_path / "b's.csv",), True, "fit", ("leak",), False, tmp_path / "c.yaml"
    )
    made = json.loads(notebook(way, "bend"))
    assert (made["nbformat"], made["nbformat_minor"]) == (4, 5)
    assert len({cell["id"] for cell in made["cells"]}) == len(made["cells"])
    code = "\n".join("".join(cell["source"]) for cell in made["cells"] if cell["cell_type"] == "code")
    compile(code, "notebook", "exec")
    assert f"robot.extend('leak', data=[{str(way.data[0])!r}])" in code
    assert all(hasattr(StudyHandle, verb) for verb in re.findall(r"robot\.(\w+)\(", code))
    improved = notebook(ModelHistory(way.study, (), False, "improve", (), True, way.saved), "bend")
    assert "robot.improve(learned=True)" in improved


def test_the_way_for_each_kind_in_commands(tmp_path: Path) -> None:
    study, data, saved = tmp_path / "a.yaml", (tmp_path / "b c.csv",), tmp_path / "s.yaml"
    fitted = commands(ModelHistory(study, data, True, "fit", ("leak", "backlash"), False, saved))
    assert [shlex.split(line)[1] for line in fitted] == ["compare", "diagnose", "extend", "compare"]
    again = ["--out", str(tmp_path / "s-fitted.yaml"), "--force"]  # the script can be run a second time
    assert shlex.split(fitted[2])[3:] == [
        *("--effect", "leak", "--effect", "backlash", "--data", str(data[0])),
        *again,
    ]
    improved = commands(ModelHistory(study, (), False, "improve", (), True, saved))
    assert shlex.split(improved[1])[:4] == ["pliant", "improve", str(study), "--learned"]


def test_nothing_else_is_kept(controller: SessionController) -> None:
    with pytest.raises(UserError, match="page, notebook and commands"):
        controller.exports.keep("../x")
    assert not list(controller.folder.saved.iterdir())
