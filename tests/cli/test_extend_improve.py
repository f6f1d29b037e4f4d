"""`pliant extend` and `pliant improve` as commands."""

import pytest
from tests.diagnosis.bench_files import STUDY, bench, csv, histories
from tests.diagnosis.quick import effect
from tests.diagnosis.test_improve import LAGS, one_slow_noisy_run

MEASURED = STUDY + "measurements: {file: data/bench.csv}  # in spring\n"
FEW = ("--effect", "stiffness", "--effect", "viscoelastic", "--effect", "sensor_bias")


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """Return the bench's file with a hidden effect and the file without one."""
    folder = tmp_path_factory.mktemp("tables")
    return {
        "hidden": csv(bench(folder, effect("viscoelastic"))),
        "clean": csv(bench(folder)),
        "short": csv(bench(folder, effect("viscoelastic"), runs=histories(1)[:1])),
    }


@pytest.fixture
def joint(workplace, write, tables):
    """Return a study with the data of the hidden effect in its folder."""
    (workplace / "data").mkdir()
    (workplace / "data" / "bench.csv").write_text(tables["hidden"])
    (workplace / "data" / "clean.csv").write_text(tables["clean"])
    return write(MEASURED, "joint.yaml")


@pytest.mark.slow
def test_extend_writes_a_study_that_predicts_what_was_fitted(pliant, joint, read, workplace):
    before = joint.read_text()
    call = pliant("extend", joint, "--effect", "viscoelastic", "--json", "r.json").done()
    result, new = read("r.json"), workplace / "joint+viscoelastic.yaml"
    assert result["out"] == str(new) and result["effects"] == ["viscoelastic"]
    assert joint.read_text() == before
    assert new.read_text().startswith("extends: {file: joint.yaml, values_sha256: ")
    share = result["parameters"]["viscoelastic.share"]
    assert share["low"] < share["value"] < share["high"] and share["sd"] > 0 and share["unit"] == "1"
    assert "90 % between" in new.read_text() and "fitted to bench.csv (sha256 " in new.read_text()
    assert "times the noise on conditions left out" in call.out
    pliant("compare", joint, "--json", "base.json").done()
    pliant("compare", new, "--json", "c.json").done()
    error = read("c.json")["outputs"]["angle_rad"]["rmse"]
    assert error == pytest.approx(result["after"]["outputs"]["angle_rad"]["rmse"], rel=1e-3)
    pages = [read(one)["report"] for one in ("base.json", "c.json")]  # each has a separate page
    assert pages[0] != pages[1] and all((workplace / page).exists() for page in pages)


@pytest.mark.slow
def test_a_study_elsewhere_finds_its_files_and_has_the_overrides(pliant, joint, workplace):
    new = "other/place/new.yaml"
    call = pliant(
        "extend", joint, "chain.module_mass=30 g", "--effect", "viscoelastic", "--out", new, "--quiet"
    )
    assert call.code == 0, call.err
    assert "module_mass: 30 g" in (workplace / new).read_text()
    assert pliant("compare", new, "--quiet").code == 0


@pytest.mark.slow
def test_several_fitted_files_are_those_in_the_new_study(pliant, joint, read, tables, workplace):
    """The files share the runs; the new study names both and reads the runs that were fitted."""
    header, *rows = (line for line in tables["hidden"].splitlines() if not line.startswith("#"))
    runs = sorted({row.split(",")[0] for row in rows})
    for name, part in (("first", runs[::2]), ("second", runs[1::2])):
        lines = [header, *(row for row in rows if row.split(",")[0] in part)]
        (workplace / "data" / f"{name}.csv").write_text("\n".join(lines) + "\n")
    files = ("data/first.csv", "data/second.csv")
    options = [word for file in files for word in ("--data", file)]
    pliant(
        "extend", joint, *options, "--effect", "viscoelastic", "--json", "r.json", "--out", "new.yaml"
    ).done()
    assert all(file in (workplace / "new.yaml").read_text() for file in files)
    pliant("compare", "new.yaml", "--json", "c.json").done()
    error = read("c.json")["outputs"]["angle_rad"]["rmse"]
    assert error == pytest.approx(read("r.json")["after"]["outputs"]["angle_rad"]["rmse"], rel=1e-3)


def test_an_effect_that_is_not_there_writes_nothing(pliant, joint, read, workplace):
    call = pliant("extend", joint, "--data", "data/clean.csv", "--effect", "mullins", "--json", "r.json")
    assert call.code == 3
    assert "show no mullins" in call.out and "No study was written" in call.out
    assert read("r.json")["out"] is None and read("r.json")["absent"] == ["mullins"]
    assert not (workplace / "joint+mullins.yaml").exists()


def test_refit_fits_what_the_study_has_as_well(pliant, write, joint, read):
    write(MEASURED + "effects: [{kind: stiffness, factor: 1.2}]\n", "stiff.yaml")
    call = pliant("extend", "stiff.yaml", "--effect", "viscoelastic", "--refit", "--json", "r.json")
    found = read("r.json")
    assert found["effects"] == ["stiffness", "viscoelastic"]
    factor = found["parameters"]["stiffness.factor"]
    assert factor["includes_neutral"] and factor["value"] == pytest.approx(1.0, abs=0.05)
    assert call.code == 3 and "show no stiffness" in call.out  # no trace of it remains after the refit


def test_nothing_is_overwritten_silently(pliant, joint, workplace):
    (workplace / "there.yaml").write_text("mine")
    call = pliant("extend", joint, "--effect", "viscoelastic", "--out", "there.yaml").refused(
        "there already", "--force"
    )
    assert (workplace / "there.yaml").read_text() == "mine"
    call = pliant("extend", joint, "--effect", "viscoelastic", "--out", joint, "--force").refused(
        "never overwritten"
    )
    call = pliant("extend", joint, "--effect", "viscoelastic", "--out", "there.yaml", "--force", "--quiet")
    assert call.code == 0 and "viscoelastic" in (workplace / "there.yaml").read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--effect", "viscoelastik"), "did you mean 'viscoelastic'"),
        ((), "--effect KIND"),
        (("--effect", "viscoelastic", "--out", "data"), "is a folder"),
        (("--effect", "viscoelastic", "--out", "data/bench.csv/new.yaml"), "cannot be written"),
        (("--effect", "viscoelastic", "--data", "no.csv"), "no.csv"),
    ],
)
def test_wrong_input_to_extend(pliant, joint, arguments, words):
    pliant("extend", joint, *arguments).refused(words)


@pytest.mark.parametrize("verb", [("extend", "--effect", "viscoelastic"), ("improve",)])
def test_a_study_without_measurements(pliant, write, verb):
    pliant(verb[0], write(STUDY, "bare.yaml"), *verb[1:]).refused("names no measurements")


def test_an_engine_that_cannot_follow_histories(pliant, joint):
    pliant("extend", joint, "physics=pybullet", "--effect", "viscoelastic").refused("quasistatic")


def test_improve_walks_to_the_floor(pliant, joint, read, workplace):
    call = pliant("improve", joint, *FEW, "--json", "r.json").done()
    result = read("r.json")
    steps = result["steps"]
    assert [step["added"] for step in steps] == [[], ["viscoelastic"]]
    assert steps[0]["rmse_over_floor"] > 1.4 and steps[1]["rmse_over_floor"] < 1.2
    assert steps[1]["heldout"]["angle_rad"]["unit"] == "rad"
    assert result["stop"] == "nothing_missing" and result["locked_runs"]
    assert result["final_study"] == str(workplace / "joint-improved.yaml")
    new = (workplace / "joint-improved.yaml").read_text()
    assert "runs held out" in new and "\nname: joint-improved\n" in new
    page = (workplace / "runs" / "joint-improve" / "report.html").read_text()
    assert "creeps" in page and 'src="http' not in page and 'href="http' not in page
    assert "falls from" in call.out


def test_improve_leaves_a_good_model_alone(pliant, joint, read, workplace):
    call = pliant(
        "improve", joint, "--data", "data/clean.csv", *FEW, "--json", "r.json", "--out", "new.yaml"
    ).done()
    result = read("r.json")
    assert [step["added"] for step in result["steps"]] == [[]]
    assert result["final_study"] == str(joint)
    assert not (workplace / "new.yaml").exists() and "No study was written" in call.out


@pytest.mark.slow
def test_improve_with_one_run_says_what_it_cannot(pliant, joint, workplace, tables, read):
    (workplace / "short.csv").write_text(tables["short"])
    call = pliant("improve", joint, "--data", "short.csv", *FEW, "--json", "r.json").done()
    assert read("r.json")["stop"] in ("insufficient_data", "ambiguous")
    assert "too few runs" in call.out


@pytest.mark.slow
def test_a_stand_in_is_said_everywhere(pliant, joint, workplace, read):
    """A substitute effect is reported on the console, in the JSON, on the page and in the new study."""
    (workplace / "open.csv").write_text(csv(one_slow_noisy_run(workplace, effect("supply_lag"))))
    lags = [word for kind in LAGS for word in ("--effect", kind)]
    call = pliant(
        "improve", joint, "--data", "open.csv", *lags, "--json", "r.json", "--out", "new.yaml"
    ).done()
    step = read("r.json")["steps"][1]
    assert len(step["stands_for"]) > 1 and step["added"][0] in step["stands_for"]
    words = f"stands for one of {', '.join(step['stands_for'])}"
    page = (workplace / "runs" / "joint-improve" / "report.html").read_text()
    assert words in page and words in (workplace / "new.yaml").read_text()
    written = (workplace / "new.yaml").read_text()  # it is compared with the file to which it was fitted
    assert "measurements:\n  file: open.csv\n" in written
    assert " (or " in call.out and read("r.json")["steps"][0]["stands_for"] == []


def test_wrong_input_to_improve(pliant, joint):
    assert "did you mean" in pliant("improve", joint, "--effect", "viscoelastik").err
    assert "never overwritten" in pliant("improve", joint, "--out", joint).err
