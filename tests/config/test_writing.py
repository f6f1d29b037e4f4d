"""Studies written by Pliant: a base with changes, or a self-contained file with the base's comments."""

import os

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from pliant.config.loading import StudyFile, load_study
from pliant.config.paths import change_paths
from pliant.config.writing import StudyDraft, _agree
from pliant.errors import UserError
from pliant.registry.discovery import discover
from pliant_search.command import write_best

HEAD = "# my finger\npliant: 1  # version\nname: finger\nphysics: quasistatic\n"
TAIL = "\n# measured in May\nchain:\n  modules: 3\n  # keep three\n"
OLD = {"kind": "stiffness", "factor": 1.1}
NEW = {"kind": "viscoelastic", "share": 0.21, "time": "4.6 s"}
LISTS = {
    "none": "",
    "empty": "effects: []  # seen in March\n",
    "blank": "effects:\n",
    "block": "effects:\n  - kind: stiffness   # of the wall\n    factor: 1.1  # 1.1 ± 0.3  # seen in March\n",
    "indentless": "effects:\n- kind: stiffness\n  factor: 1.1   # seen in March\n",
    "flow items": "effects:\n  - {kind: stiffness, factor: 1.1}   # seen in March\n",
    "flow": "effects: [{kind: stiffness, factor: 1.1}]   # seen in March\n",
    "flow on lines": "effects: [\n  {kind: stiffness, factor: 1.1},  # seen in March\n]\n",
}
FORMS = pytest.mark.parametrize("full", [False, True], ids=["extends", "full"])


def plain(text):
    return YAML(typ="safe", pure=True).load(text)


@pytest.fixture
def draft(tmp_path):
    def call(text, overrides=(), name="study.yaml"):
        (tmp_path / name).write_text(text)
        return StudyDraft(tmp_path / name, overrides)

    return call


@pytest.fixture
def read_back(tmp_path):
    """Return a function that writes a draft to a file and returns its values, bases included, and its text."""

    def call(draft, full, name="further/new.yaml"):
        target = tmp_path / name
        target.parent.mkdir(exist_ok=True)
        target.write_text(draft.text(target, full))
        return StudyFile.read(target).values, target.read_text()

    return call


def with_new(draft, refit=False):
    draft.values.setdefault("effects", [])
    at = len(draft.values["effects"])
    if refit and at:
        draft.set(("effects", 0, "factor"), 1.05, "1.05 ± 0.01")
    draft.set(("effects", at, "kind"), "viscoelastic", "fitted to bench.csv\n# twice")
    draft.set(("effects", at, "share"), 0.21, "0.21 ± 0.01")
    draft.set(("effects", at, "time_s"), "4.6 s")
    return draft


@pytest.mark.parametrize(
    ("target", "overrides", "name"),
    [
        ("study-improved.yaml", (), "finger-improved"),
        ("study+friction_hysteresis.yaml", (), "finger-friction_hysteresis"),
        ("in March (2).yaml", (), "in-March-2"),
        ("elsewhere/study.yaml", (), "finger-2"),
        ("elsewhere/finger.yaml", (), "finger-2"),
        ("new.yaml", ("name=mine",), "mine"),
    ],
)
def test_a_new_study_has_its_own_name(draft, tmp_path, target, overrides, name):
    made = draft(HEAD, overrides)
    assert made.name_after(tmp_path / target) == made.values["name"] == name
    assert f"name: {name}\n" in made.text(tmp_path / target)


@FORMS
@pytest.mark.parametrize("refit", [False, True])
@pytest.mark.parametrize("listed", LISTS.values(), ids=LISTS)
def test_effects_are_added_and_refitted(draft, read_back, listed, refit, full):
    values, text = read_back(with_new(draft(HEAD + listed + TAIL), refit), full)
    old = [{**OLD, "factor": 1.05 if refit else 1.1}] * ("stiffness" in listed)
    assert values == {
        **{"pliant": 1, "name": "finger", "physics": {"kind": "quasistatic"}, "chain": {"modules": 3}},
        "effects": [*old, NEW],
    }
    assert (
        "  - kind: viscoelastic  # fitted to bench.csv no.  twice\n    share: 0.21  # 0.21 ± 0.01\n" in text
    )
    assert text.startswith(HEAD) is full
    if full:
        for comment in ("# seen in March", "# of the wall", "# measured in May\nchain:", "# keep three"):
            assert (comment in text) == (comment in HEAD + listed + TAIL)
    else:
        assert set(plain(text)) == {"extends", "effects"}
    if refit and old:
        assert (
            "1.05  # 1.05 ± 0.01" in text and "± 0.3" not in text
        )  # the old uncertainty was removed together with its value


@FORMS
def test_files_still_lead_where_they_led(draft, read_back, tmp_path, full):
    draft("measurements: {file: 'my bench.csv'}  # May\nplugins: [mine.py]\n", name="base.yaml")
    text = (
        "extends: base.yaml\n# by hand\ntask: {target: {points: a.csv}}\nsurrogate: {axes: {y: {data: /far/y.csv}}}\n"
        "chain:\n  segments:\n    - {modules: 1, surrogate: {data: s.csv}, family: {visual: v.stl}}\n"
    )
    made = with_new(draft(text))
    values, written = read_back(made, full)
    change_paths(values, os.path.realpath)
    assert values == made.values
    (segment,) = values["chain"]["segments"]
    found = [*values["plugins"], values["measurements"]["file"], values["task"]["target"]["points"]]
    found += [segment["surrogate"]["data"], segment["family"]["visual"]]
    assert [f.rpartition("/")[2] for f in found] == ["mine.py", "my bench.csv", "a.csv", "s.csv", "v.stl"]
    assert values["surrogate"]["axes"]["y"]["data"] == "/far/y.csv"
    if full:
        assert "extends" not in written and "# May" in written and "# by hand" in written
        assert str(tmp_path) not in written


@FORMS
@pytest.mark.parametrize(
    ("override", "path", "value"),
    [
        ("physics.kind=mujoco", ("physics",), {"kind": "mujoco"}),
        ("physics.tolerance=1e-9", ("physics",), {"kind": "quasistatic", "tolerance": 1e-9}),
        ("chain.gravity=[0, 0, 0]", ("chain", "gravity"), [0, 0, 0]),
        ("chain.base.roll=3 deg", ("chain", "base"), {"roll": "3 deg"}),
        ("chain={payload: 20 g}", ("chain",), {"modules": 3, "payload": "20 g"}),
    ],
)
def test_overrides_become_part_in_the_new_study(draft, read_back, override, path, value, full):
    values, text = read_back(draft(HEAD + TAIL, [override]), full)
    for key in path:
        values = values[key]
    assert values == value
    assert ("# keep three" in text) is full


@FORMS
def test_blocks_are_left_out_and_units_kept(draft, read_back, full):
    made = draft(HEAD + "search:\n  budget: 5  # few\n# the finger\ntask:\n  pressure_pa: 5  # searched\n")
    made.drop("search")
    made.set(("task", "pressure"), 7)
    values, text = read_back(made, full)
    assert values.get("search") is None and values["task"] == {"pressure_pa": 7}
    assert ("# the finger\ntask:\n  pressure_pa: 7  # searched\n" in text) is full


def test_a_key_that_is_gone_from_a_block_needs_a_file_that_stands_alone(draft, read_back):
    made = draft(HEAD + TAIL)
    made.values["chain"] = {"segments": [{"modules": 2}]}
    values, text = read_back(made, full=False)
    assert values["chain"] == {"segments": [{"modules": 2}]} and "extends" not in text


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


@pytest.fixture
def shaped(tmp_path):
    (tmp_path / "a.csv").write_text("x_m,y_m,z_m\n0,0,0\n0,0,0.03\n")
    (tmp_path / "shaped.yaml").write_text(SHAPED)
    return tmp_path / "shaped.yaml"


@FORMS
def test_a_found_design(shaped, full):
    registry, target = discover(), shaped.parent / "runs/shaped/best.yaml"
    target.parent.mkdir(parents=True)
    winner = load_study(shaped, registry, ["task.pressure=7 kPa"])
    write_best(shaped, target, winner, [("task", "pressure_pa")], "found", (), registry, full)
    text = target.read_text()
    assert text.startswith("# found\n")
    assert ("pressure: 7.0 kPa # searched" in text and "points: ../../a.csv" in text) is full
    assert load_study(target, registry).task.pressure_pa == winner.task.pressure_pa == 7e3


def test_a_changed_base_is_said_and_read(shaped):
    """Comments and layout are not a change; values are, including those of a base's base."""
    registry, middle, new = discover(), shaped.with_name("middle.yaml"), shaped.with_name("new.yaml")
    middle.write_text("extends: shaped.yaml\nname: middle\n")
    draft = StudyDraft(middle)
    draft.set(("name",), "new")
    new.write_text(draft.text(new))
    said = []
    shaped.write_text(
        "# a comment\n" + SHAPED.replace("pliant: 1\nname: shaped", "name:   shaped\npliant: 1")
    )
    load_study(new, registry, note=said.append)
    assert said == []
    shaped.write_text(SHAPED.replace("modules: 3", "modules: 4"))
    assert load_study(new, registry, note=said.append).chain.modules == 4
    assert len(said) == 1 and "middle.yaml has changed" in said[0]
    with pytest.warns(UserWarning, match="has changed"):
        load_study(new, registry)


@pytest.mark.parametrize("target", ["shaped.yaml", "middle.yaml", "../{}/shaped.yaml"])
def test_nothing_is_written_over_a_base(shaped, target):
    middle = shaped.with_name("middle.yaml")
    middle.write_text("extends: shaped.yaml\n")
    place = shaped.parent / target.format(shaped.parent.name)
    with pytest.raises(UserError, match="never overwritten"):
        StudyDraft(middle).write(place, {}, discover())
    assert shaped.read_text() == SHAPED


@pytest.mark.parametrize(
    "extends", ["[a.yaml]", "{file: a.yaml, hash: 1}", "{values_sha256: a}", "{file: 3}", "no.yaml"]
)
def test_an_extends_that_is_no_file(shaped, extends):
    shaped.write_text(f"name: a\nextends: {extends}\n")
    with pytest.raises(UserError, match="line 2: 'extends"):
        load_study(shaped, discover())


def test_what_would_not_read_back_is_not_written(shaped):
    target = shaped.with_name("new.yaml")
    with pytest.raises(UserError, match="not say the same"):
        StudyDraft(shaped).write(target, {"name": "another"}, discover())
    assert [path.name for path in shaped.parent.glob("*.yaml")] == ["shaped.yaml"]


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**9), 10**9) | st.floats(-1e30, 1e30)
    | st.text(st.characters(codec="utf-8", categories=["L", "N", "P", "S", "Zs"]), max_size=12),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abcxyz_", min_size=1), inner, max_size=3),
    max_leaves=6,
)  # fmt: skip


@given(VALUES)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_value_reads_back(draft, read_back, value):
    made = draft(HEAD)
    made.set(("key",), value)
    assert read_back(made, full=False)[0].get("key") == value
    assert read_back(made, full=True)[0]["key"] == value


@pytest.mark.parametrize(
    ("written", "same"), [("6.1662 mm", True), ("6.17 mm", False), (0.0061662, True), (None, False)]
)
def test_what_differs_for_a_segment_reads_back_as_it_was_written(written: object, same: bool) -> None:
    """A segment keeps the keys of its design as written: with or without unit, as a number or a text."""
    meant = [{"modules": 7, "family": {"average_radius_m": 0.0061662}}]
    read = [{"modules": 7, "family": {"average_radius": written}}]
    assert _agree("segments", meant, read) is same
    assert not _agree("segments", meant, [*read, *read])
