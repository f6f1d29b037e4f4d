"""A table read alone, without Pliant."""

import subprocess
import sys

import numpy as np
import pandas
import pytest

import pliant_tables

LOGGER = (
    "Prüfer;M. Müller;;\nZeit [s];Druck (mbar);Probe;Uhrzeit\n0,0;1,5;A;12:00:00\n0,1;OVERLOAD;A;12:00:02\n"
)


def test_columns_keep_their_names_and_values_their_kinds(tmp_path):
    path = tmp_path / "logger.csv"
    path.write_text(LOGGER, "utf-16")
    table = pliant_tables.read(path, pliant_tables.StatedNotes(missing=["OVERLOAD"]))
    assert list(table) == ["Zeit [s]", "Druck (mbar)", "Probe", "Uhrzeit"] and len(table) == 2
    assert table["Zeit [s]"].tolist() == [0.0, 0.1] and table["Probe"] == ["A", "A"]
    assert table["Druck (mbar)"][0] == 1.5 and np.isnan(table["Druck (mbar)"][1])
    assert table["Uhrzeit"].tolist() == [0.0, 2.0]
    assert table.units == {"Zeit [s]": "s", "Druck (mbar)": "mbar"}
    assert table.lines.tolist() == [3, 4] and table.preamble == ("Prüfer;M. Müller;;",)


def test_a_frame_is_a_table_too():
    table = pliant_tables.read(pandas.DataFrame({"angle_deg": [1.0, 2.0], "run": ["a", "b"]}))
    assert table["angle_deg"].tolist() == [1.0, 2.0] and table["run"] == ["a", "b"]
    assert table.units == {"angle_deg": "deg"}


def test_cells_that_are_no_numbers_are_refused_with_their_lines(tmp_path):
    path = tmp_path / "logger.csv"
    path.write_text(LOGGER)
    with pytest.raises(pliant_tables.UserError) as caught:
        pliant_tables.read(path)
    assert "line 4" in str(caught.value) and "OVERLOAD" in str(caught.value)


def test_an_unknown_package_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'open'"):
        pliant_tables.open  # noqa: B018
    assert {getattr(pliant_tables, name).__name__ for name in dir(pliant_tables)} == set(
        pliant_tables.__all__
    )


def test_it_imports_nothing_from_pliant(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s,angle [deg]\n0,1\n")
    code = (
        "import sys, pliant_tables; pliant_tables.read(sys.argv[1]); "
        "print(*sorted({m.partition('.')[0] for m in sys.modules} & {'pliant', 'pydantic', 'scipy', 'pint'}))"
    )
    command = [sys.executable, "-c", code, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
