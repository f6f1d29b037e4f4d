"""New effects in a study's text: every other line stays as it was."""

import difflib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruamel.yaml import YAML

from pliant.cli.best_study import write_best
from pliant.config.loading import load_study
from pliant.config.writing import EffectEntry, flow_text, study_with_effects
from pliant.errors import UserError
from pliant.registry.discovery import discover

HEAD = "# my finger\npliant: 1  # version\nname: finger\nphysics: quasistatic\n"
TAIL = "\n# measured in May\nchain:\n  modules: 3\n  # keep three\n"
NEW = EffectEntry(
    "viscoelastic", {"share": "0.21", "time": "4.6 s"}, {"share": "0.21 ± 0.01"}, "fitted to bench.csv"
)
AGAIN = EffectEntry("stiffness", {"factor": "1.05"}, {"factor": "1.05 ± 0.01"}, "fitted to bench.csv", at=0)
OLD = [{"kind": "stiffness", "factor": 1.1}]
READ = {"kind": "viscoelastic", "share": 0.21, "time": "4.6 s"}


def plain(text):
    return YAML(typ="safe", pure=True).load(text)


@pytest.fixture
def rewrite(tmp_path):
    def call(text, entries, present=(), overrides=(), target="new.yaml"):
        source = tmp_path / "study.yaml"
        source.write_text(text)
        (tmp_path / target).parent.mkdir(exist_ok=True)
        return study_with_effects(source, tmp_path / target, entries, present, overrides)

    return call


@pytest.mark.parametrize("none", ["", "effects: []  # none yet\n", "effects:\n", "effects: null\n"])
def test_a_first_effect(rewrite, none):
    text = HEAD + none + TAIL
    new = rewrite(text, [NEW])
    assert plain(new) == {**plain(text), "effects": [READ]}
    assert (
        "  - kind: viscoelastic  # fitted to bench.csv\n    share: 0.21  # 0.21 ± 0.01\n    time: 4.6 s\n"
        in new
    )
    gone = [d for d in difflib.ndiff(text.splitlines(), new.splitlines()) if d.startswith("- ")]
    assert all("effects" in line for line in gone)
    assert ("# none yet" in new) == ("# none yet" in text)


LISTS = {
    "block": "effects:\n  - kind: stiffness   # of the wall\n    factor: 1.1  # 1.1 ± 0.3  # seen in March\n",
    "indentless": "effects:\n- kind: stiffness\n  factor: 1.1   # seen in March\n",
    "flow items": "effects:\n  - {kind: stiffness, factor: 1.1}   # seen in March\n",
    "flow": "effects: [{kind: stiffness, factor: 1.1}]   # seen in March\n",
    "flow on lines": "effects: [\n  {kind: stiffness, factor: 1.1},  # seen in March\n]\n",
}


@pytest.mark.parametrize("listed", LISTS.values(), ids=LISTS)
def test_a_further_effect_stands_behind_those_that_are_there(rewrite, listed):
    new = rewrite(HEAD + listed + TAIL, [NEW], OLD)
    assert plain(new)["effects"] == [*OLD, READ]
    assert "# seen in March" in new
    assert new.startswith(HEAD) and new.endswith(TAIL)


@pytest.mark.parametrize("listed", LISTS.values(), ids=LISTS)
def test_an_effect_that_is_there_is_refitted_in_its_place(rewrite, listed):
    new = rewrite(HEAD + listed + TAIL, [AGAIN, NEW], OLD)
    assert plain(new)["effects"] == [{"kind": "stiffness", "factor": 1.05}, READ]
    assert "# seen in March" in new and "1.05 ± 0.01" in new
    assert "± 0.3" not in new  # the old uncertainty went with the old value
    assert new.startswith(HEAD) and new.endswith(TAIL)


def test_writing_twice_changes_nothing_more(rewrite):
    once = rewrite(HEAD + LISTS["block"] + TAIL, [AGAIN], OLD)
    assert rewrite(once, [AGAIN], OLD) == once


def test_effects_of_a_base_study_are_written_out(rewrite):
    new = rewrite("extends: base.yaml\nname: mine\n", [NEW], OLD)
    assert plain(new) == {"extends": "base.yaml", "name": "mine", "effects": [*OLD, READ]}


def test_a_study_on_one_line(rewrite):
    new = rewrite("{pliant: 1, chain: {modules: 2}}\n", [NEW])
    assert plain(new) == {"pliant": 1, "chain": {"modules": 2}, "effects": [READ]}


def test_paths_still_lead_to_their_files(rewrite, tmp_path):
    text = (
        "extends: base/finger.yaml\nplugins: [mine.py]\nmeasurements: {file: 'my bench.csv'}  # May\n"
        "surrogate:\n  kind: polynomial\n  data: fem.csv\n"
    )
    new = rewrite(text, [NEW], target="further/new.yaml")
    read = plain(new)
    found = [read["extends"], *read["plugins"], read["measurements"]["file"], read["surrogate"]["data"]]
    meant = ["base/finger.yaml", "mine.py", "my bench.csv", "fem.csv"]
    assert [(tmp_path / "further" / f).resolve() for f in found] == [(tmp_path / m).resolve() for m in meant]
    assert "# May" in new
    assert plain(rewrite(text, [NEW]))["measurements"] == {"file": "my bench.csv"}


def test_paths_inside_blocks_and_segments_lead_there_too(rewrite, tmp_path):
    text = (
        "task: {target: {points: a.csv}}\nsurrogate: {axes: {y: {data: y.csv}}}\n"
        "chain:\n  segments:\n    - {modules: 1, surrogate: {data: s.csv}, family: {visual: v.stl}}\n"
    )
    read = plain(rewrite(text, [NEW], target="further/new.yaml"))
    (segment,) = read["chain"]["segments"]
    found = [read["task"]["target"]["points"], read["surrogate"]["axes"]["y"]["data"]]
    found += [segment["surrogate"]["data"], segment["family"]["visual"]]
    assert found == ["../a.csv", "../y.csv", "../s.csv", "../v.stl"]


SHAPED = """\
pliant: 1
name: shaped
surrogate: {kind: polynomial, form: study, coefficients: {k_n: 2e-6, m_a: 0, b_a: 0, m_e: 0, b_e: 0.04}}
chain: {modules: 3, module_length: 10 mm}
task:
  kind: follow_shape
  pressure: 5 kPa  # searched
  target: {points: a.csv}
"""


def test_a_found_design_keeps_its_comments_where_its_target_is_a_file(tmp_path):
    (tmp_path / "a.csv").write_text("x_m,y_m,z_m\n0,0,0\n0,0,0.03\n")
    (tmp_path / "shaped.yaml").write_text(SHAPED)
    registry, target = discover(), tmp_path / "runs/shaped/best.yaml"
    target.parent.mkdir(parents=True)
    winner = load_study(tmp_path / "shaped.yaml", registry, ["task.pressure=7 kPa"])
    write_best(tmp_path / "shaped.yaml", target, winner, [("task", "pressure_pa")], "found", (), registry)
    assert "pressure: 7.0 kPa  # searched" in target.read_text()
    assert "points: ../../a.csv" in target.read_text()


def test_an_absolute_path_stays(rewrite):
    text = "pliant: 1\nmeasurements: {file: /data/bench.csv}\n"
    assert plain(rewrite(text, [NEW], target="further/new.yaml"))["measurements"]["file"] == "/data/bench.csv"


@pytest.mark.parametrize(
    ("override", "path", "value"),
    [
        ("physics.kind=mujoco", ("physics",), {"kind": "mujoco"}),
        ("physics.tolerance=1e-9", ("physics",), {"kind": "quasistatic", "tolerance": 1e-9}),
        ("chain.modules=4", ("chain", "modules"), 4),
        ("chain.gravity=[0, 0, 0]", ("chain", "gravity"), [0, 0, 0]),
        ("chain.base.roll=3 deg", ("chain", "base"), {"roll": "3 deg"}),
        ("chain={payload: 20 g}", ("chain",), {"modules": 3, "payload": "20 g"}),
        ("name=other", ("name",), "other"),
    ],
)
def test_overrides_become_part_of_the_new_study(rewrite, override, path, value):
    new = rewrite(HEAD + TAIL, [NEW], overrides=[override])
    read = plain(new)
    for key in path:
        read = read[key]
    assert read == value
    assert "# keep three" in new and "# version" in new


def test_a_comment_is_one_line(rewrite):
    new = rewrite(HEAD, [EffectEntry("mullins", note="a\nb # c")])
    assert plain(new)["effects"] == [{"kind": "mullins"}]


def test_a_study_that_is_no_yaml(rewrite):
    with pytest.raises(UserError, match="not YAML"):
        rewrite("effects: [\n", [NEW])


def test_a_study_that_is_not_there(tmp_path):
    with pytest.raises(UserError, match="no such file"):
        study_with_effects(tmp_path / "no.yaml", Path("new.yaml"), [NEW], [])


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**9), 10**9) | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(codec="utf-8", categories=["L", "N", "P", "S", "Zs"]), max_size=12),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abcxyz_", min_size=1), inner, max_size=3),
    max_leaves=6,
)  # fmt: skip


@given(VALUES)
def test_values_on_one_line_read_back(value):
    text = flow_text(value)
    assert "\n" not in text
    assert plain(f"key: {text}\n")["key"] == value
