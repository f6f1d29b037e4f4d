"""`pliant import`: what is printed is what the file holds, and its block reads the file again."""

import re
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML
from tests.lab_files.files import lab_files
from tests.lab_files.lab_file import CLOSE

from pliant import api
from pliant.report.document import Table
from pliant.report.importing import _values

ROOT = Path(__file__).parents[2]
FILES = {file.name: file for file in lab_files()}
EXAMPLES = ["hidden_effect/bench", "opposed_chambers/bench", "clamped_chain/four", "clamped_chain/six_unseen"]
EXAMPLES += ["next_experiment/done_1", "next_experiment/bench"]


@pytest.fixture
def saved(tmp_path, monkeypatch):
    """Writes a lab file's bytes into the working folder; gives their names."""
    monkeypatch.chdir(tmp_path)

    def save(file):
        for name, content in file.files.items():
            (tmp_path / name).write_bytes(content)
        return list(file.files)

    return save


def taken(block):
    """The block with every choice in it taken, as values."""
    return YAML(typ="safe").load(re.sub(r"^( *)# ", r"\1", block, flags=re.M))["measurements"]


def compared(measurement, answer):
    assert [run.name for run in measurement.runs] == list(answer)
    for run, columns in zip(measurement.runs, answer.values(), strict=True):
        for name, values in columns.items():
            read = _values(run)[name]
            assert np.allclose(read, values, rtol=0, atol=CLOSE * np.nanmax(np.abs(values)), equal_nan=True)


@pytest.mark.parametrize("name", [name for name, file in FILES.items() if file.answer and not file.refused])
def test_the_columns_and_runs_that_are_shown_are_those_of_the_file(name, saved):
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


@pytest.mark.parametrize(
    "name",
    [
        name
        for name, file in FILES.items()
        if (file.doubts and file.stated) or (not file.refused and file.answer)
    ],
)
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
    if file.stated:
        assert shown.data["doubts"] == []
    compared(again, file.answer)
