"""Studies from YAML: merging, overrides, and one sentence with the line for each mistake."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pliant.config.loading import load_study, merge
from pliant.config.overrides import as_overrides
from pliant.config.schema import study_schema
from pliant.errors import UserError
from pliant.registry.discovery import discover

REGISTRY = discover()
STUDY = """\
pliant: 1
name: finger
family:
  kind: bellow_bending
  inner_radius: 2 mm
  average_radius: 6 mm
  wall: 1.5 mm
  module_length: 11 mm
material: {kind: neo_hookean, shear_modulus: 240 kPa}
fem: {kind: skfem, pressure_max: 15 kPa}
chain: {modules: 8}
physics: quasistatic
task: {kind: free_bending, pressure: 15 kPa}
"""


@pytest.fixture
def write(tmp_path):
    def writer(text, name="study.yaml"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return writer


def problem(path, overrides=()):
    with pytest.raises(UserError) as caught:
        load_study(Path(path), REGISTRY, overrides)
    text = str(caught.value)
    assert "Traceback" not in text
    return text


def test_a_study_is_typed_by_its_kinds(write):
    study = load_study(write(STUDY), REGISTRY)
    assert study.family.wall_m == pytest.approx(0.0015)
    assert study.physics.kind == "quasistatic"
    assert study.chain.gravity_m_s2 == (0.0, 0.0, -9.81)


WALL, MODULES, NAME = "wall: 1.5 mm", "modules: 8", "name: finger"
CHAIN = "chain: {modules: 8}"
# Text in the study, its replacement, the reported line, the expected message.
MISWRITTEN = [
    ("physics: quasistatic", "physics: mojoco", 12, "'mojoco'; did you mean 'mujoco'?"),
    (WALL, "wal: 1.5 mm", 7, "'wal' is not a key of family; did you mean 'wall'?"),
    (WALL, "wall: 35 kPa", 7, "'35 kPa' is a pressure or modulus; it needs a length such as '1.5 mm'"),
    (WALL, "wall: [1]", 7, "family.wall"),
    (WALL, "wall:\t1.5 mm", 7, "there is a tab"),
    (WALL, "wall: !mm 1.5", 7, "no tags such as '!mm'"),
    (WALL, "wall: !!python/object:os.system 1.5", 7, "no tags"),
    (WALL, "wall: true", 7, "true or false, not a number"),
    (WALL, "wall: '1,5 mm'", 7, "'1,5 mm' has a comma"),
    (WALL, "wall: 3*5 mm", 7, "'3*5 mm' is not a quantity"),
    (WALL, "wall: 1:30", 7, "'1:30' is not a quantity"),
    ("  wall: 1.5 mm\n", "", 3, "'family.wall' is missing"),
    (MODULES, "modules: 0", 11, "greater than or equal to 1"),
    (MODULES, "modules: 8, modules: 9", 11, "'modules' stands twice"),
    (MODULES, "modules: true", 11, "true or false, not a number"),
    (MODULES, "modules: 8.5", 11, "should be a whole number."),
    (MODULES, f"modules: {'9' * 5000}", None, "a value cannot be read"),
    (MODULES, "modules: 8, gravity: 9.81", 11, "needs a list such as [a, b]"),
    (MODULES, "modules: 8, gravity: [0, 0, 0, 1]", 11, "at most 3 items"),
    (MODULES, "modules: 8, actuators: [{input: p}]", 11, "should be pressure_pa"),
    ("chain: {", "chain: !x {", 11, "no tags such as '!x'"),
    (CHAIN, "chain: {modules: 8", 12, "not YAML"),
    (CHAIN, "chain: 8", 11, "needs a block"),
    (CHAIN, "surrogate: {kind: polynomial, data: 3}", 11, "'surrogate.data' is 3; it should be a text"),
    (CHAIN, "surrogate: {kind: polynomial, odd: maybe}", 11, "it should be true or false"),
    (CHAIN, "surrogate: {kind: polynomial, odd: true}", 11, "'surrogate': odd replaces"),
    (CHAIN, f"noise: {'{a: ' * 2000}1{'}' * 2000}", None, "nested too deeply"),
    (NAME, "name: a/b", 2, "A-Z a-z 0-9"),
    (NAME, "name: finger\nname: twice", 3, "'name' stands twice"),
    ("name: finger\n", "", None, "'name' is missing"),
    (NAME, f"name: {'x' * 300}", 2, "it should have at most 100 characters"),
    (NAME, "name: 3", 2, "'name' is 3; it should be a text"),
    (NAME, "name:", 2, "'name' is empty"),
    (NAME, "name: finger\n3: 4", 3, "'3' is not a key"),
    (NAME, "name: finger\n---\npliant: 1", 3, "a second document"),
    ("pliant: 1", "pliant: 2", 1, "pliant"),
]


@pytest.mark.parametrize(("old", "new", "line", "words"), MISWRITTEN, ids=[m[1][:40] for m in MISWRITTEN])
def test_what_people_miswrite_is_said_in_their_words_with_its_line(write, old, new, line, words):
    assert old in STUDY
    text = problem(write(STUDY.replace(old, new, 1)))
    assert words in text and (line is None or f"line {line}" in text)
    for jargon in ("tuple", "TaggedScalar", "datetime", "None", "class '", "Input", "regex", "pydantic"):
        assert jargon not in text
    assert len(text) < 500


def test_several_mistakes_are_told_together(write):
    effect = problem(write(STUDY + "effects: [{kind: stifness}]"))
    assert "line 14" in effect and "did you mean 'stiffness'?" in effect
    assert "did you mean 'kind'?" in problem(write(STUDY.replace("kind: bellow", "knd: bellow")))
    text = problem(write(STUDY.replace("wall: 1.5 mm", "wal: 1 mm").replace("modules: 8", "modules: no")))
    assert "'wal'" in text
    assert "chain.modules" in text


def test_a_missing_file_names_its_neighbours(write):
    path = write(STUDY)
    assert "study.yaml" in problem(path.parent / "stdy.yaml")


@pytest.mark.parametrize("content", ["", "just text", "- 1\n- 2\n"])
def test_a_file_that_is_no_study(write, content):
    assert "holds none" in problem(write(content))


def test_yaml_1_2_rules(write):
    study = load_study(
        write(STUDY.replace("name: finger", "name: no") + "surrogate: {kind: polynomial}\n"), REGISTRY
    )
    assert study.name == "no"
    study = load_study(write(STUDY.replace("15 kPa}\nchain", "1.5e4}\nchain")), REGISTRY)
    assert study.fem.pressure_max_pa == 15000.0


def test_extends_merges_and_a_new_kind_clears_the_block(write):
    write(STUDY, "base.yaml")
    child = write(
        "extends: base.yaml\nname: child\nchain: {modules: 5}\nphysics: {kind: mujoco}\n", "child.yaml"
    )
    study = load_study(child, REGISTRY)
    assert (study.name, study.chain.modules, study.physics.kind) == ("child", 5, "mujoco")
    assert study.family.wall_m == pytest.approx(0.0015)


def test_a_mistake_in_the_base_names_the_base(write):
    write(STUDY.replace("wall:", "wal:"), "base.yaml")
    assert "base.yaml, line 7" in problem(write("extends: base.yaml\nname: child\n", "child.yaml"))


def test_extends_in_a_circle_or_into_nothing(write):
    write("extends: b.yaml\nname: a\n", "a.yaml")
    b = write("extends: a.yaml\nname: b\n", "b.yaml")
    assert "circle" in problem(b)
    assert "no file beside it" in problem(write("extends: nowhere.yaml\nname: a\n", "c.yaml"))


def test_overrides(write):
    path = write(STUDY)
    study = load_study(path, REGISTRY, ["physics.kind=mujoco", "family.wall=2 mm", "chain.gravity=[0, 0, 0]"])
    assert study.physics.kind == "mujoco"
    assert study.family.wall_m == pytest.approx(0.002)
    assert study.chain.gravity_m_s2 == (0.0, 0.0, 0.0)
    assert load_study(path, REGISTRY, ["physics=pybullet"]).physics.kind == "pybullet"


@pytest.mark.parametrize(
    ("override", "data"),
    [
        ("surrogate.kind=table", True),
        ("surrogate=table", True),
        ("surrogate={kind: table, data: null}", False),
    ],
)
def test_another_kind_is_fitted_to_the_same_data(write, tmp_path, override, data):
    (tmp_path / "fem.csv").write_text("pressure_pa,angle_rad,moment_n_m\n0,0,0\n")
    path = write(STUDY + "surrogate: {kind: polynomial, form: study, data: fem.csv}\n")
    surrogate = load_study(path, REGISTRY, [override]).surrogate
    assert surrogate.kind == "table"
    assert (surrogate.data == tmp_path / "fem.csv") if data else surrogate.data is None


def test_a_block_from_python_has_no_data_but_its_own(write, tmp_path):
    (tmp_path / "fem.csv").write_text("pressure_pa,angle_rad,moment_n_m\n0,0,0\n")
    study = load_study(write(STUDY + "surrogate: {kind: table, data: fem.csv}\n"), REGISTRY)
    stated = {"kind": "polynomial", "form": "study", "coefficients": {"k_n": 1e-6}}
    assert "surrogate.data=null" in as_overrides(study, {"surrogate": stated})
    assert as_overrides(study, {"surrogate": {"kind": "neural"}}) == ['surrogate.kind="neural"']


def test_override_for_a_list_item(write):
    path = write(STUDY + "effects: [{kind: stiffness, factor: 1.2}]\n")
    assert load_study(path, REGISTRY, ["effects.0.factor=1.3"]).effects[0].factor == 1.3
    assert "there is no item 4" in problem(path, ["effects.4.factor=1"])


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("family.wall", "is not an override"),
        ("=3", "is not an override"),
        ("chain.modules=x", "override chain.modules=x"),
        (f"chain.modules={'9' * 5000}", "chain.modules"),
        ("effects.²=1", "'effects'"),
    ],
)
def test_wrong_overrides(write, override, words):
    assert words in problem(write(STUDY), [override])


keys = st.sampled_from(["a", "b", "c"])
trees = st.recursive(
    st.integers() | st.text(max_size=3), lambda inner: st.dictionaries(keys, inner, max_size=3), max_leaves=8
)
blocks = st.dictionaries(keys, trees, max_size=3)


@given(blocks, blocks)
def test_merging_keeps_what_is_not_named_and_takes_what_is(base, changes):
    result = merge(base, changes)
    assert set(result) == set(base) | set(changes)
    for key, value in changes.items():
        if not isinstance(value, dict):
            assert result[key] == value
    for key in set(base) - set(changes):
        assert result[key] == base[key]


@given(blocks)
def test_merging_with_itself_or_nothing_changes_nothing(block):
    assert merge(block, block) == block
    assert merge(block, {}) == block
    assert merge({}, block) == block


def test_schema_lists_every_installed_kind():
    schema = study_schema(REGISTRY)
    text = json.dumps(schema)
    for component in REGISTRY.components:
        if component.interface not in ("optimizer", "viewer"):
            assert f'"{component.kind}"' in text
    references = {part.split('"')[0] for part in text.split('"#/$defs/')[1:]}
    assert references <= set(schema["$defs"])


def test_coefficient_names_are_shown_as_they_are_written(write):
    stated = "surrogate: {kind: polynomial, form: study, coefficients: {k_x: 1, m_a: 1, m_e: 1, b_e: 1}}\n"
    text = problem(write(STUDY + stated))
    assert "did you mean 'k_n'? Allowed: k_n, m_a" in text


def test_merge_keys_anchors_and_aliases(write):
    merged = (
        "chain:\n  <<: &most {modules: 8}\n  payload: 1 g\ncross_check: [&engine {kind: mujoco}, *engine]"
    )
    study = load_study(write(STUDY.replace("chain: {modules: 8}", merged)), REGISTRY)
    assert (study.chain.modules, study.chain.payload_kg) == (8, 0.001)
    assert [engine.kind for engine in study.cross_check] == ["mujoco", "mujoco"]
    text = problem(write(STUDY.replace("chain: {modules: 8}", merged.replace("8}", "0}"))))
    assert "line 11" in text
    assert "chain.modules" in text


@pytest.mark.parametrize("change", [lambda t: "\ufeff" + t, lambda t: t.replace("\n", "\r\n")])
def test_bom_and_windows_line_endings(tmp_path, change):
    path = tmp_path / "größe.yaml"
    path.write_bytes(change(STUDY).encode())
    assert load_study(path, REGISTRY).chain.modules == 8


def test_a_file_in_another_encoding(tmp_path):
    path = tmp_path / "study.yaml"
    path.write_bytes(STUDY.encode("utf-16"))
    assert "save it as UTF-8" in problem(path)


@pytest.mark.parametrize("name", ["x" * 5000 + ".yaml", "a\0b.yaml"])
def test_names_that_no_file_can_have(tmp_path, name):
    text = problem(tmp_path / name)
    assert "cannot be read" in text
    assert len(text) < 200
    child = tmp_path / "child.yaml"
    child.write_text(f"extends: {json.dumps(name)}\nname: child\n", encoding="utf-8")
    assert "no file beside it" in problem(child)


def test_an_empty_effect_list_is_none(write):
    assert load_study(write(STUDY + "effects:\ncross_check:\n"), REGISTRY).effects == ()


def test_a_base_in_another_folder_keeps_its_own_relative_paths(tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "own").mkdir()
    (tmp_path / "data" / "base.yaml").write_text(
        "name: base\nsurrogate: {kind: polynomial, data: bench.csv}\n", encoding="utf-8"
    )
    child = tmp_path / "own" / "child.yaml"
    child.write_text("extends: ../data/base.yaml\nname: child\n", encoding="utf-8")
    assert load_study(child, REGISTRY).surrogate.data.resolve() == (tmp_path / "data/bench.csv").resolve()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("{wal: 2 mm}", "'wal' is not a key of chain.segments.1.family; did you mean 'wall'?"),
        ("{wall: 9 kPa}", "'chain.segments.1.family.wall'"),
        ("{wall: }", "'chain.segments.1.family.wall' is empty"),
        ("{kind: other}", "'chain.segments.1.family.kind' is 'other'"),
        ("{}, module: 3", "'module' is not a key of chain.segments.1; did you mean 'modules'?"),
    ],
)
def test_mistakes_in_segments_have_their_lines(write, change, words):
    segments = f"chain:\n  segments:\n    - {{modules: 2}}\n    - {{modules: 2, family: {change}}}"
    text = problem(write(STUDY.replace("chain: {modules: 8}", segments)))
    assert words in text and "line 14" in text and "pydantic" not in text


def test_a_payload_outlasts_a_changed_task_kind(tmp_path):
    """A payload is a load of the robot: `task.kind=reach` keeps it, and a kind without payload reports that."""
    path = tmp_path / "s.yaml"
    path.write_text(
        "pliant: 1\nname: s\nsurrogate: {kind: polynomial, form: study, "
        "coefficients: {k_n: 1e-6, m_a: 0, m_e: 0, b_e: 0.02}}\n"
        "chain: {modules: 4, module_length: 10 mm, module_mass: 2 g, module_radius: 6 mm}\n"
        "task: {kind: tip_load, pressure: 5 kPa, payload: 13 g}\n",
        encoding="utf-8",
    )
    heard: list[str] = []
    reach = load_study(path, REGISTRY, ["task.kind=reach", "task.tip=[30 mm, 0 mm, -10 mm]"], heard.append)
    assert reach.task.payload_kg == pytest.approx(0.013) and heard == []
    load_study(path, REGISTRY, ["task.kind=free_bending", "task.pressure=5 kPa"], heard.append)
    assert any("has no payload" in text and "chain.payload" in text for text in heard)
