"""The JSON of every verb and of the published studies has the keys of docs/formats.md; one cheap run per verb."""

import csv
import json
import re
import shutil
from pathlib import Path

import pytest
from tests.cli.search_study import STUDY as SEARCHED
from tests.cli.test_commands import BENCH, bench_table
from tests.pliant_view.test_fields import JOINT
from tests.slow import slow_among
from typer.testing import CliRunner

from pliant.cli.options import DEFAULT_STORE
from pliant.cli.verbs import VERBS, app
from pliant.store.store import ArtifactStore, Recipe

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "formats.md").read_text("utf-8")
ROWS = re.findall(r"^\| `([\w-]+)` \| (`.*`) \|$", PAGE, re.M)
COLUMNS = re.findall(r"`(\w+)`", PAGE.partition("has the columns ")[2].partition(", and")[0])
KEYS = {verb: re.findall(r"`([^`]+)`", cells) for verb, cells in ROWS}
FEW = ("--effect", "viscoelastic", "--effect", "stiffness", "--effect", "sensor_lag")
# Verb → arguments; the studies are in the fixture's folder.
CALLS = {
    "fem": ("joint.yaml", "--out", "joint"),
    "fit": ("law.yaml",),
    "doctor": ("law.yaml",),
    "simulate": ("law.yaml", "task.pressure=16 kPa"),
    "run": ("law.yaml",),
    "compare": ("loop/finger.yaml",),
    "diagnose": ("loop/finger.yaml", *FEW),
    "extend": ("loop/finger.yaml", "--effect", "viscoelastic"),
    "improve": ("loop/finger.yaml", *FEW),
    "optimize": ("searched.yaml", "search.budget=6", "--workers", "1"),
    "experiment": ("experiment/finger.yaml", "--effect", "friction_hysteresis", "--effect", "sensor_scale"),
    "plugins": (),
    "calibrate": ("silicone.yaml", "--data", "pull.csv"),
    "plan": ("loop/finger.yaml",),
    "render": ("law.yaml", "--backbone", "--out", "line.png"),
    "export": ("law.yaml", "--out", "chain.xml"),
    "import": ("doubted.csv",),
    "store": (),
    "report": ("ran",),
    "check": ("material", "neo_hookean"),
    "schema": (),
    "example": ("hidden-effect",),
    "new-plugin": ("my-effect",),
}
# Verbs whose own tests check these keys in the fast suite.
COSTLY = ("fem", "experiment", "compare", "plan", "diagnose", "extend", "improve", "optimize", "check")
PUBLISHED = {"study-shape": "shape_matching", "study-gripper": "gripper_codesign"}
# Lists and objects that are empty in these runs: the hidden effect is found and no measurement is proposed.
MAY_BE_EMPTY = {
    *("diagnose.not_excited", "diagnose.indistinguishable", "diagnose.covariates"),
    *("diagnose.smallest_detectable", "diagnose.next_experiment", "plan.runs"),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with studies and their data, with one store for all verbs."""
    place = tmp_path_factory.mktemp("formats")
    shutil.copytree(ROOT / "examples" / "hidden_effect", place / "loop")
    shutil.copytree(ROOT / "examples" / "experiment", place / "experiment")
    for file in ("silicone.yaml", "pull.csv"):
        shutil.copy(ROOT / "examples" / "materials" / file, place)
    for name, text in (("law", BENCH), ("searched", SEARCHED), ("joint", JOINT)):
        (place / f"{name}.yaml").write_text(text)
    bench_table(place)
    rows = "".join(f"{k},{1000 * k},{k}\n" for k in range(20))
    (place / "doubted.csv").write_text(f"time_s,pressure_pa,angle_rad\n{rows}")
    store = place / DEFAULT_STORE
    ArtifactStore(store).make(Recipe("tried", {}, {}, "", {}), lambda parts: {})
    ran = ["run", f"{place / 'law.yaml'}", "--out", f"{place / 'ran'}", "--store", f"{store}", "--quiet"]
    assert CliRunner().invoke(app, ran).exit_code == 0
    return place


def reached(value, path):
    """Return all values at a path; raise KeyError where a mapping lacks the key."""
    values = [value]
    for part in path.replace("[]", ".[]").split("."):
        values = [one for one in values if one is not None]
        if part == "[]":
            values = [item for one in values for item in one]
        elif part == "*":
            values = [item for one in values for item in one.values()]
        else:
            values = [one[part] for one in values]
    return values


def test_the_page_has_every_verb_with_json():
    assert set(KEYS) - set(PUBLISHED) == set(CALLS) == set(VERBS) - {"view", "app"}


@pytest.mark.parametrize("verb", slow_among(CALLS, *COSTLY))
def test_the_keys_are_in_the_result(verb, folder, monkeypatch):
    monkeypatch.chdir(folder)
    monkeypatch.delenv("PLIANT_STORE", raising=False)
    done = CliRunner().invoke(app, [verb, *CALLS[verb], "--json", f"{verb}.json", "--quiet"])
    assert done.exit_code in (0, 3), done.output
    result = json.loads((folder / f"{verb}.json").read_text())
    assert result["command"] == verb and result["pliant"]
    for key in KEYS[verb]:
        assert reached(result, key) or f"{verb}.{re.split(r'[.[]', key)[0]}" in MAY_BE_EMPTY, key


@pytest.mark.slow
def test_the_state_table_has_its_columns(folder, monkeypatch):
    monkeypatch.chdir(folder)
    monkeypatch.delenv("PLIANT_STORE", raising=False)
    done = CliRunner().invoke(app, ["fem", *CALLS["fem"], "--quiet"])  # read from the store
    assert done.exit_code == 0, done.output
    with (folder / "joint" / "fem.csv").open(newline="") as file:
        header = next(csv.reader(file))
    assert {"pressure_pa", "branch", "status"} < set(COLUMNS)
    assert set(COLUMNS) - set(header) == {"pressure_pa"}  # this chain is driven by a tendon


@pytest.mark.parametrize("command", PUBLISHED)
def test_the_keys_are_in_the_published_studies(command):
    result = json.loads((ROOT / "docs" / "studies" / f"{PUBLISHED[command]}.json").read_text())
    assert result["command"] == "optimize" and result["pliant"]
    for key in KEYS[command]:
        assert reached(result, key), key


def test_a_missing_key_is_noticed():
    with pytest.raises(KeyError):
        reached({"runs": [{"a": 1}, {"b": 1}]}, "runs[].a")
    assert reached({"runs": [{"a": {"x": {"u": 1}}}]}, "runs[].a.*.u") == [1]
