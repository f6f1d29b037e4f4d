"""`pliant import`: the printed text describes the file's contents, and the printed block reads the file again."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from ruamel.yaml import YAML
from tests.lab_files.files import lab_files
from tests.lab_files.lab_file import CLOSE
from tests.slow import slow_among

import pliant as pliant_package
from pliant import api
from pliant.config.loading import load_study
from pliant.errors import UserError
from pliant.measurements.block import advised, block_text, files_and_notes
from pliant.pipeline.chain import base_rotation
from pliant.registry.discovery import discover
from pliant.report.document import Table
from pliant.report.importing import _values
from pliant.report.render import terminal

ROOT = Path(__file__).parents[2]
FILES = {file.name: file for file in lab_files()}
EXAMPLES = ["hidden_effect/bench", "opposed_chambers/bench", "clamped_chain/four", "clamped_chain/six_unseen"]
EXAMPLES += ["next_experiment/done_1", "next_experiment/bench"]


@pytest.fixture
def saved(tmp_path, monkeypatch):
    """Write a lab file's bytes into the working folder and return its file names."""
    monkeypatch.chdir(tmp_path)

    def save(file):
        for name, content in file.files.items():
            (tmp_path / name).write_bytes(content)
        return list(file.files)

    return save


def taken(block):
    """Return the values of the printed block with every offered choice accepted."""
    return YAML(typ="safe").load(re.sub(r"^( *)# ", r"\1", block, flags=re.M))["measurements"]


def compared(measurement, answer):
    assert [run.name for run in measurement.runs] == list(answer)
    for run, columns in zip(measurement.runs, answer.values(), strict=True):
        for name, values in columns.items():
            read = _values(run)[name]
            assert np.allclose(read, values, rtol=0, atol=CLOSE * np.nanmax(np.abs(values)), equal_nan=True)


@pytest.mark.parametrize(
    "name",
    [
        n
        for n, file in FILES.items()
        if file.answer and not file.refused and not {"rename", "rate"} & {*file.stated}
    ],
)
def test_the_columns_and_runs_that_are_shown_are_those_in_the_file(name, saved):
    file = FILES[name]
    names = saved(file)
    measurement, document = api.read(names, {} if file.doubts else file.stated)
    assert [run["name"] for run in document.data["runs"]] == list(file.answer)
    assert sum(run["samples"] for run in document.data["runs"]) == sum(map(len, measurement.runs))
    first = next(iter(file.answer.values()))
    shown = {column["name"]: column for column in document.data["columns"]}
    assert set(first) <= set(shown) | {"payload_kg"}
    assert bool(document.data["doubts"]) == bool(file.doubts)
    for word in file.doubts:
        assert word in document.warnings[0].sentence  # doubts come first
    if not file.doubts:
        for column in shown.values():
            values = np.concatenate([run[column["name"]] for run in file.answer.values()])
            assert np.allclose(column["range"], [np.nanmin(values), np.nanmax(values)], rtol=CLOSE)
            assert column["missing"] == np.isnan(values).sum()
    columns, runs = (block for block in document.brief if isinstance(block, Table))
    assert len(columns.rows) == len(shown) and len(runs.rows) == len(file.answer)


@pytest.mark.parametrize("name", [name for name, file in FILES.items() if file.answer and not file.refused])
def test_the_block_with_its_advice_beside_the_file_settles_every_doubt(name, saved):
    file = FILES[name]
    names = saved(file)
    _, document = api.read(names, {} if file.doubts else file.stated)
    notes = taken(document.data["block"])
    assert notes.pop("file") == (names[0] if len(names) == 1 else names)
    for one in names if notes else ():
        with Path(one).with_suffix(".yaml").open("w") as beside:
            YAML().dump(notes, beside)
    again, shown = api.read(names, {})
    if "# " in document.data["block"]:
        assert shown.data["doubts"] == []
    if "exclude" not in notes:  # the readings of a frozen sensor are then left out
        compared(again, file.answer)


ASKED = [
    name
    for name, file in FILES.items()
    if file.refused and len(file.stated) == 1 and "rename" not in file.stated
]


@pytest.mark.parametrize("name", ASKED)
def test_a_refusal_has_the_block_with_the_missing_line_as_a_choice(name, saved):
    file = FILES[name]
    with pytest.raises(UserError) as refused:
        api.read(saved(file), {})
    block = str(refused.value).partition("\n\n")[2]
    ((key, value),) = file.stated.items()
    assert re.search(rf"^  # {key}:", block, re.M)
    if key != "join":  # the user has to state the offset of two clocks
        assert {key: value} in advised([str(refused.value)])


def test_files_from_two_loggers_are_refused_with_one_block_that_joins_them(saved, pliant, tmp_path):
    saved(FILES["two loggers with clocks of their own"])
    said = pliant("import", "pressure.csv", "camera.csv")
    assert said.code == 2 and said.err.count("measurements:") == 1
    notes = taken(said.err.partition("\n\n")[2])
    assert notes == {"file": "camera.csv", "join": {"file": "pressure.csv", "shift": "0 s"}}
    read, _ = api.read(notes.pop("file"), notes)
    assert len(read.runs) == 1 and "pressure_pa" in read.runs[0].history.actuation
    alone = taken(pliant("import", "pressure.csv").err.partition("\n\n")[2])
    assert alone["join"] == "pressure.csv" != alone["file"]


@pytest.mark.parametrize("name", [name for name, file in FILES.items() if file.refused and not file.answer])
def test_what_cannot_be_read_is_refused_in_a_sentence(name, saved, pliant):
    called = pliant("import", *saved(FILES[name]))
    assert called.code == 2 and called.out == ""
    for word in FILES[name].refused:
        assert word in called.err


@pytest.mark.parametrize("example", slow_among(EXAMPLES, *(set(EXAMPLES) - {"hidden_effect/bench"})))
def test_the_examples_leave_no_doubt(example, tmp_path, monkeypatch, pliant):
    monkeypatch.chdir(tmp_path)
    file = ROOT / "examples" / f"{example}.csv"
    called = pliant("import", file, "--json", "found.json").done()
    assert "nothing doubtful." in called.out
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["doubts"] == [] and "#" not in found["block"]
    assert (tmp_path / found["report"]).read_text().count("<img") == 2


def test_notes_may_stand_behind_the_files(saved, pliant):
    saved(FILES["degrees called radians"])
    called = pliant("import", "a.csv", "units.angle_rad=deg", "--json", "found.json").done()
    assert "nothing doubtful." in called.out and "angle_rad: deg" in called.out
    assert files_and_notes(["a=1.csv", "units.angle_rad=deg", "sigma.angle_rad=0.5 deg"]) == (
        ["a=1.csv"],
        {"units": {"angle_rad": "deg"}, "sigma": {"angle_rad": "0.5 deg"}},
    )
    pliant("import", "units.angle_rad=deg").refused("name the recording")


@pytest.mark.slow
def test_a_new_study_runs_once_three_lines_are_filled_in(saved, pliant, tmp_path):
    saved(FILES["degrees called radians"])
    (tmp_path / "studies").mkdir()
    pliant("import", "a.csv", "units.angle_rad=deg", "--out", "studies/new.yaml").done()
    study = tmp_path / "studies" / "new.yaml"
    assert "file: ../a.csv" in study.read_text()
    assert study.read_text().count("<-") == 3 and "pliant fit TABLE.csv" in study.read_text()
    pliant("compare", study).refused("k_n", "b_e", "module_mass")
    for empty, filled in (
        ("k_n: ", "k_n: 1.2e-6"),
        ("b_e: ", "b_e: 0.02"),
        ("module_length:", "module_length: 80 mm"),
    ):
        study.write_text(study.read_text().replace(empty, filled))
    study.write_text(study.read_text().replace("module_mass:", "module_mass: 40 g"))
    assert "bend angle" in pliant("compare", study).done().out
    ways = {"": (0, 0, -1, 1, 0, 0), "[1, 0, 0]": (1, 0, 0, 0, 0, 1), "[0, 1, 0]": (0, 1, 0, 1, 0, 0)}
    for (
        direction,
        way,
    ) in ways.items():  # as its comment states: the chain's axis at rest, and where its tip bends to
        loaded = load_study(study, discover(), [f"chain.base.direction={direction}"] if direction else [])
        rotation = base_rotation(loaded.chain.base)
        assert np.allclose([*rotation[:, 0], *-rotation[:, 2]], way, atol=1e-12)
    pliant("import", "a.csv", "--out", study).refused("there already")


@pytest.mark.slow
def test_a_study_may_be_extended_with_the_recording(saved, pliant, tmp_path):
    saved(FILES["mbar called Pa"])
    base = ROOT / "examples" / "hidden_effect" / "finger.yaml"
    pliant("import", "a.csv", "--study", base, "--out", "new.yaml").done()
    text = (tmp_path / "new.yaml").read_text()
    assert text.startswith("# ") and "mbar" in text.splitlines()[0] and "\n  file: a.csv\n" in text
    assert "Unit to check" in pliant("compare", "new.yaml").done().out


def test_a_recording_in_a_notebook(saved):
    saved(FILES["degrees called radians"])
    bench = pliant_package.read("a.csv", units={"angle_rad": "deg"})
    assert "61 readings of bend angle over pressure, 25 Hz; nothing doubtful" in repr(bench)
    assert "<table" in bench._repr_html_() and bench.doubts == ()
    frame = bench.to_frame()
    again = pliant_package.read(frame[["time_s", "pressure_pa", "angle_rad"]])
    assert (again.to_frame()["angle_rad"] == frame["angle_rad"]).all() and again.json["block"] == ""
    assert bench.plot(Figure().subplots()).lines


def test_a_pattern_makes_a_folder_that_no_shell_expands(pliant, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for number in (1, 2):
        Path(f"messung_0{number}.csv").write_text(f"time_s,pressure_pa,angle_rad\n0,0,0\n1,5e3,0.{number}\n")
    pliant("import", "messung_*.csv").done()
    assert [path.name for path in Path("runs").iterdir()] == ["messung-import"]


def test_a_choice_within_a_key_that_is_stated_stands_below_it():
    block = {"file": "a.csv", "units": {"pressure_pa": "mbar"}}
    text = block_text(block, advised(["write 'units: {angle_rad: deg}' in a.yaml", "'no line of: notes'"]))
    assert taken(text) == {"file": "a.csv", "units": {"pressure_pa": "mbar", "angle_rad": "deg"}}
    assert YAML(typ="safe").load(text)["measurements"] == block


def test_a_block_that_was_pasted_beside_the_file_is_read_and_sorted_rows_are_nothing_to_settle(tmp_path):
    table = tmp_path / "winkel.csv"
    rows = [f"{k / 10:.1f};{1000 * k};{2 * k}" for k in np.random.default_rng(3).permutation(40)]
    table.write_text("\n".join(["Zeit [s];Druck [Pa];Biegung_xy [deg]", *rows]) + "\n")
    (tmp_path / "winkel.yaml").write_text(
        "measurements:\n  file: winkel.csv\n  rename: {'Biegung_xy [deg]': angle_deg}\n"
    )
    measurement, document = api.read(table, {})
    assert measurement.runs[0].outputs["angle_rad"] == pytest.approx(np.radians(2.0 * np.arange(40)))
    assert "sorted" in document.warnings[0].sentence
    assert not any("correct it before" in str(line) for line in terminal(document))


@pytest.mark.parametrize("driven", ["tendon_travel_m", "tendon_force_n"])
def test_the_study_that_import_writes_takes_what_drives_the_recording(pliant, tmp_path, monkeypatch, driven):
    monkeypatch.chdir(tmp_path)
    rows = [f"{k},{k % 9 * 1e-3},{k % 9 * 0.05}" for k in range(30)]
    Path("a.csv").write_text("\n".join([f"time_s,{driven},angle_rad", *rows]) + "\n")
    pliant("import", "a.csv", "--out", "new.yaml").done()
    study = Path("new.yaml").read_text()
    assert f"actuation_name: {driven}" in study
    for empty, filled in (
        ("{k_n: , m_a: 0, m_e: 0, b_e: }", "{k_n: 1, m_a: 0, m_e: 0, b_e: 0.02}"),  # 50 rad per m or N
        ("module_length: ", "module_length: 80 mm"),
        ("module_mass: ", "module_mass: 0 g"),
    ):
        study = study.replace(empty, filled, 1)
    Path("new.yaml").write_text(study)
    assert "rms error" in pliant("compare", "new.yaml").done().out


def test_an_error_after_loading_names_the_line_in_the_extended_study(pliant, write):
    law = "{kind: polynomial, form: study, odd: true, coefficients: {k_n: 1, m_a: 0, m_e: 0, b_e: 0.02}}"
    chain = "{modules: 1, module_length: 80 mm, gravity: [0, 0, 0], actuators: [{input: tendon_travel_m}]}"
    base = f"pliant: 1\nname: base\nsurrogate: {law}\nchain: {chain}\nmeasurements: {{file: a.csv}}\n"
    write("time_s,tendon_travel_mm,angle_deg\n0,0,0\n1,1,5\n2,2,10\n", "a.csv")
    write(base, "base.yaml")
    own = write("pliant: 1\nname: own\nextends: base.yaml\n", "own.yaml")
    pliant("compare", own).refused("base.yaml, line 4: chain.actuators names 'tendon_travel_m'")
