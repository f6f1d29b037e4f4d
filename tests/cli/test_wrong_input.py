"""Wrong input: one clear sentence on standard error, exit code 2, nothing half-written."""

import importlib.util
import os
import stat
from pathlib import Path

import pytest


def assert_refused(call, *words):
    assert call.code == 2, call.err
    assert call.out == ""
    assert call.err.startswith("error: ")
    for word in words:
        assert word in " ".join(call.err.split()), call.err
    assert call.err.count(". ") <= 3, "one or two sentences"


def assert_nothing_left(folder, *known):
    assert sorted(p.name for p in folder.iterdir()) == sorted(known)


def test_unknown_kind(pliant, write, workplace, stated):
    call = pliant("run", write(stated.replace("physics: quasistatic", "physics: mojoco")))
    assert_refused(call, "study.yaml, line 9", "unknown physics kind 'mojoco'; did you mean 'mujoco'?")
    assert_nothing_left(workplace, "study.yaml")


def test_unknown_key(pliant, write, workplace, finger):
    call = pliant("run", write(finger.replace("  wall:", "  wal:")))
    assert_refused(call, "line 7", "'wal' is not a key of family; did you mean 'wall'?")
    assert_nothing_left(workplace, "study.yaml")


def test_wrong_unit(pliant, write, workplace, finger):
    call = pliant("fem", write(finger.replace("1.5 mm", "35 kPa")))
    assert_refused(call, "line 7", "'35 kPa' is a pressure or modulus", "length such as '1.5 mm'")
    assert_nothing_left(workplace, "study.yaml")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "average_radius: 6 mm",
            "average_radius: 4 mm",
            ["average_radius − inner_radius ≥ module_length/4", "0.75 mm"],
        ),
        ("wall: 1.5 mm", "wall: 3 mm", ["module_length/4 > wall", "0.25 mm"]),
        ("module_length: 11 mm", "module_length: -11 mm", ["module_length > 0"]),
        ("inner_radius: 2 mm", "inner_radius: 2000", ["m"]),
    ],
)
@pytest.mark.parametrize("verb", ["run", "fem", "fit", "simulate"])
def test_design_outside_the_familys_validity(pliant, write, workplace, finger, old, new, words, verb):
    assert_refused(pliant(verb, write(finger.replace(old, new))), *words)
    assert_nothing_left(workplace, "study.yaml")


def test_bare_numbers_in_millimetres_are_noticed(pliant, write, finger):
    text = finger.replace("2 mm", "2").replace("6 mm", "6").replace("1.5 mm", "1.5").replace("11 mm", "11")
    assert_refused(pliant("fem", write(text)), "were units forgotten")


def test_yaml_syntax_error(pliant, write, workplace, stated):
    assert_refused(
        pliant("run", write(stated.replace("modules: 8,", "modules: 8: 9,"))), "line 8", "not YAML"
    )
    assert_nothing_left(workplace, "study.yaml")


def test_duplicate_key(pliant, write, workplace, stated):
    assert_refused(pliant("run", write(stated + "name: again\n")), "line 11", "'name' stands twice")
    assert_nothing_left(workplace, "study.yaml")


def test_missing_file(pliant, write, workplace, stated):
    write(stated)
    assert_refused(pliant("run", "studi.yaml"), "studi.yaml: no such file", "study.yaml")
    assert_nothing_left(workplace, "study.yaml")


@pytest.mark.parametrize("verb", ["run", "simulate"])
def test_missing_optional_package(pliant, write, workplace, stated, monkeypatch, verb):
    real = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *a: None if name == "mujoco" else real(name, *a)
    )
    call = pliant(verb, write(stated), "physics=mujoco")
    assert_refused(call, "physics 'mujoco' needs mujoco: pip install mujoco")


def test_a_missing_package_is_found_before_the_fem(pliant, write, workplace, finger, monkeypatch):
    real = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *a: None if name == "mujoco" else real(name, *a)
    )
    assert_refused(pliant("simulate", write(finger), "physics=mujoco"), "needs mujoco")
    assert not (workplace / ".pliant").exists()


def test_a_missing_engine_in_the_cross_check_is_skipped_with_its_cause(
    pliant, write, read, stated, monkeypatch
):
    real = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *a: None if name == "pybullet" else real(name, *a)
    )
    call = pliant("run", write(stated), "cross_check=[pybullet]", "--json", "out.json")
    assert call.code == 0
    assert "needs pybullet" in read("out.json")["cross_check"][0]["skipped"]
    assert "skipped" in call.out


@pytest.mark.parametrize("option", ["--out", "--json", "--store"])
def test_unwritable_output(pliant, write, workplace, stated, option):
    (workplace / "occupied").write_text("a file, no folder")
    target = "occupied/x.json" if option == "--json" else "occupied/deeper"
    assert_refused(pliant("run", write(stated), option, target), "cannot be written")
    assert (workplace / "occupied").read_text() == "a file, no folder"


def test_a_table_that_is_no_table_is_judged_by_its_header(pliant, write, stated):
    text = stated[: stated.index("surrogate:")] + "surrogate: {kind: polynomial, data: study.yaml}\n"
    assert_refused(pliant("fit", write(text)), "study.yaml, line 1", "column 'pressure_pa'", "is missing")


@pytest.mark.parametrize("target", ["folder", "folder/", ""])
@pytest.mark.parametrize("verb", ["run", "simulate"])
def test_json_into_a_folder(pliant, write, workplace, stated, verb, target):
    (workplace / "folder").mkdir()
    assert_refused(pliant(verb, write(stated), "--json", target), "--json needs the name of a file")
    assert_nothing_left(workplace, "folder", "study.yaml")


def test_json_into_a_device_or_through_a_link(pliant, write, workplace, stated):
    """Such a target is written into; replacing it would break /dev/null for everyone when root runs this."""
    (workplace / "null").symlink_to("/dev/null")
    (workplace / "link.json").symlink_to("real.json")
    for name in ("null", "link.json"):
        assert pliant("simulate", write(stated), "--quiet", "--json", name).code == 0
        assert (workplace / name).is_symlink()
    assert Path("/dev/null").is_char_device()
    assert "tip_m" in (workplace / "real.json").read_text()


def test_json_on_a_full_disk(pliant, write, workplace, stated):
    (workplace / "full").symlink_to("/dev/full")
    call = pliant("simulate", write(stated), "--quiet", "--json", "full")
    assert_refused(call, "full cannot be written (No space left on device)")


@pytest.mark.parametrize(("option", "verb"), [("--out", "run"), ("--json", "run"), ("--json", "simulate")])
def test_a_name_longer_than_a_file_system_takes(pliant, write, workplace, stated, option, verb):
    call = pliant(verb, write(stated), option, "x" * 300)
    assert_refused(call, "cannot be written (File name too long)")
    assert len(call.err) < 200
    assert_nothing_left(workplace, "study.yaml")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_read_only_folder(pliant, write, workplace, stated):
    folder = workplace / "locked"
    folder.mkdir()
    folder.chmod(stat.S_IRUSR | stat.S_IXUSR)
    assert_refused(pliant("run", write(stated), "--out", folder / "run"), "cannot be written")


def test_corrupted_artifact_is_detected_recomputed_and_said(pliant, write, workplace, stated):
    study = write(stated)
    assert pliant("simulate", study).code == 0
    (artifact,) = (workplace / ".pliant/store/simulate").glob("*/value.json")
    artifact.write_text(artifact.read_text()[:-5])
    call = pliant("simulate", study)
    assert call.code == 0
    assert "corrupted" in call.err
    assert "computing it anew" in " ".join(call.err.split())
    assert "from the store" in pliant("simulate", study).out


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("chain: {modules: 8, module_length: 11 mm, gravity: [0, 0, 0]}\n", ""), ["has no 'chain' block"]),
        (("task: {kind: free_bending, pressure: 15 kPa}\n", ""), ["has no 'task' block"]),
        ((" module_length: 11 mm,", ""), ["needs 'chain.module_length'"]),
        ((", pressure: 15 kPa}", "}"), ["pressure"]),
    ],
)
def test_a_study_that_says_too_little(pliant, write, stated, change, words):
    assert_refused(pliant("simulate", write(stated.replace(*change))), *words)


def test_fem_of_a_study_without_a_family(pliant, write, stated):
    assert_refused(pliant("fem", write(stated)), "has no 'family' block; FEM needs one")


def test_a_law_without_data(pliant, write, stated):
    text = stated[: stated.index("surrogate:")] + stated[stated.index("chain:") :]
    assert_refused(pliant("fit", write(text)), "needs data")


def test_report_of_a_folder_that_holds_no_run(pliant, workplace):
    assert_refused(pliant("report", "nowhere"), "holds no finished run")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["check", "physic", "mujoco"], ["unknown interface 'physic'; did you mean 'physics'?"]),
        (["check", "physics", "mojoco"], ["did you mean 'mujoco'?"]),
        (["new-plugin", "3 bad name"], ["name"]),
    ],
)
def test_plugin_verbs(pliant, arguments, words):
    assert_refused(pliant(*arguments), *words)


def test_an_unknown_option_or_verb_exits_with_2(pliant):
    assert pliant("run", "--nonsense").code == 2
    assert pliant("rum").code == 2


def test_a_store_with_an_impossible_name(pliant, write, stated):
    assert_refused(pliant("simulate", write(stated), "--store", "x" * 300), "File name too long")


def test_the_largest_of_an_actuation_that_the_family_does_not_have(pliant, write, workplace, finger):
    text = finger.replace("pressure_max: 15 kPa", "pressure_max: 15 kPa, tendon_force_max: 5 N")
    assert text != finger
    assert_refused(
        pliant("fem", write(text)), "'tendon_force_max' has no effect", "driven by pressure_pa; remove it"
    )
    assert not list(workplace.glob("runs/*/*.csv"))
