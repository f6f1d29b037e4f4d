"""Wrong input gives one clear sentence on standard error, exit code 2 and no half-written file."""

import importlib.util
import os
import stat
from pathlib import Path

import pytest
from tests.cli.conftest import FINGER, STATED

TABLE_LESS = STATED[: STATED.index("surrogate:")]
LAWLESS = TABLE_LESS + STATED[STATED.index("chain:") :]
MILLIMETRES = FINGER.replace("2 mm", "2").replace("6 mm", "6").replace("1.5 mm", "1.5").replace("11 mm", "11")
DESIGNS = {
    ("average_radius: 6 mm", "average_radius: 4 mm"): (
        "average_radius − inner_radius ≥ module_length/4", "0.75 mm",
    ),
    ("wall: 1.5 mm", "wall: 3 mm"): ("module_length/4 > wall", "0.25 mm"),
    ("module_length: 11 mm", "module_length: -11 mm"): ("module_length > 0",),
    ("inner_radius: 2 mm", "inner_radius: 2000"): ("m",),
}  # fmt: skip
# Mistake: verb, study, expected message; more spelling mistakes are in tests/config/test_loading.py.
WRONG = {
    "kind": ("run", STATED.replace("physics: quasistatic", "physics: mojoco"), (
        "study.yaml, line 9", "unknown physics kind 'mojoco'; did you mean 'mujoco'?",
    )),
    "millimetres": ("fem", MILLIMETRES, ("were units forgotten",)),
    "no table": ("fit", TABLE_LESS + "surrogate: {kind: polynomial, data: study.yaml}\n", (
        "study.yaml, line 1", "column 'pressure_pa'", "is missing",
    )),
    "no chain": ("simulate", STATED.replace("chain: {modules: 8, module_length: 11 mm, gravity: [0, 0, 0]}\n", ""), (
        "has no 'chain' block",
    )),
    "no task": ("simulate", STATED.replace("task: {kind: free_bending, pressure: 15 kPa}\n", ""), (
        "has no 'task' block",
    )),
    "no length": ("simulate", STATED.replace(" module_length: 11 mm,", ""), ("needs 'chain.module_length'",)),
    "no pressure": ("simulate", STATED.replace(", pressure: 15 kPa}", "}"), ("pressure",)),
    "no family": ("fem", STATED, ("has no 'family' block; FEM needs one",)),
    "no data": ("fit", LAWLESS, ("needs data",)),
    "other actuation": ("fem", FINGER.replace("pressure_max: 15 kPa", "pressure_max: 15 kPa, tendon_force_max: 5 N"), (
        "'tendon_force_max' has no effect", "driven by pressure_pa; remove it",
    )),
    **{
        f"{new}, {verb}": (verb, FINGER.replace(old, new), words)
        for ((old, new), words), verb in zip(DESIGNS.items(), ("run", "fem", "fit", "simulate"), strict=True)
    },
}  # fmt: skip


def left(folder):
    return sorted(p.name for p in folder.iterdir() if p.name not in (".pliant", "runs"))


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_study(pliant, write, workplace, name):
    verb, text, words = WRONG[name]
    call = pliant(verb, write(text)).refused(*words)
    assert call.err.startswith("error: ") and call.out == ""
    assert left(workplace) == ["study.yaml"] and not list(workplace.glob("runs/*/*.csv"))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "studi.yaml"], ["studi.yaml: no such file", "study.yaml"]),
        (["report", "nowhere"], ["holds no finished run"]),
        (["check", "physic", "mujoco"], ["unknown interface 'physic'; did you mean 'physics'?"]),
        (["check", "physics", "mojoco"], ["did you mean 'mujoco'?"]),
        (["new-plugin", "3 bad name"], ["name"]),
        (["simulate", "study.yaml", "--store", "x" * 300], ["File name too long"]),
        *(
            ([verb, "study.yaml", option, "x" * 300], ["cannot be written (File name too long)"])
            for verb, option in (("run", "--out"), ("run", "--json"), ("simulate", "--json"))
        ),
        *(
            ([verb, "study.yaml", "--json", target], ["--json needs the name of a file"])
            for verb in ("run", "simulate")
            for target in ("folder", "folder/", "")
        ),
    ],
)
def test_wrong_words(pliant, write, workplace, stated, arguments, words):
    write(stated)
    (workplace / "folder").mkdir()
    assert len(pliant(*arguments).refused(*words).err) < 500
    assert left(workplace) == ["folder", "study.yaml"]


@pytest.fixture
def without(monkeypatch):
    """Make an optional package missing."""
    real = importlib.util.find_spec

    def missing(package):
        found = lambda name, *a: None if name == package else real(name, *a)  # noqa: E731
        monkeypatch.setattr(importlib.util, "find_spec", found)

    return missing


@pytest.mark.parametrize("verb", ["run", "simulate"])
def test_a_missing_package_is_found_before_any_work(pliant, write, workplace, finger, without, verb):
    without("mujoco")
    pliant(verb, write(finger), "physics=mujoco").refused(
        "physics 'mujoco' needs mujoco: pip install 'pliant[mujoco]'"
    )
    assert not (workplace / ".pliant").exists()


def test_a_missing_engine_in_the_cross_check_is_skipped_with_its_cause(pliant, write, read, stated, without):
    without("pybullet")
    call = pliant("run", write(stated), "cross_check=[pybullet]", "--json", "out.json").done()
    assert "needs pybullet" in read("out.json")["cross_check"][0]["skipped"]
    assert "skipped" in call.out


@pytest.mark.parametrize("option", ["--out", "--json", "--store"])
def test_unwritable_output(pliant, write, workplace, stated, option):
    (workplace / "occupied").write_text("a file, no folder")
    target = "occupied/x.json" if option == "--json" else "occupied/deeper"
    pliant("run", write(stated), option, target).refused("cannot be written")
    assert (workplace / "occupied").read_text() == "a file, no folder"


def test_json_into_a_device_or_through_a_link(pliant, write, workplace, stated):
    """Such a target is written to directly; replacing it would break /dev/null for everyone when root runs this."""
    (workplace / "null").symlink_to("/dev/null")
    (workplace / "link.json").symlink_to("real.json")
    for name in ("null", "link.json"):
        pliant("simulate", write(stated), "--quiet", "--json", name).done()
        assert (workplace / name).is_symlink()
    assert Path("/dev/null").is_char_device()
    assert "tip_m" in (workplace / "real.json").read_text()
    (workplace / "full").symlink_to("/dev/full")
    full = pliant("simulate", write(stated), "--quiet", "--json", "full")
    full.refused("full cannot be written (No space left on device)")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_read_only_folder(pliant, write, workplace, stated):
    folder = workplace / "locked"
    folder.mkdir()
    folder.chmod(stat.S_IRUSR | stat.S_IXUSR)
    pliant("run", write(stated), "--out", folder / "run").refused("cannot be written")


def test_corrupted_artifact_is_detected_recomputed_and_said(pliant, write, workplace, stated):
    study = write(stated)
    pliant("simulate", study).done()
    (artifact,) = (workplace / ".pliant/store/simulate").glob("*/value.json")
    artifact.write_text(artifact.read_text()[:-5])
    said = " ".join(pliant("simulate", study).done().err.split())
    assert "corrupted" in said and "computing it anew" in said
    assert "from the store" in pliant("simulate", study).out


def test_an_unknown_option_or_verb_exits_with_2(pliant):
    assert pliant("run", "--nonsense").code == pliant("rum").code == 2
