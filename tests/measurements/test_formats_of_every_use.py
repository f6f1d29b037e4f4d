"""One reader of tables: every use accepts the same formats."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from tests.lab_files.written import matlab, parquet, spreadsheet

from pliant.errors import UserError
from pliant.fem_tables.reading import read_table
from pliant.measurements.reading import read_measurement
from pliant_calibrate.reading import read_bench_data

ROWS = "0.5,0.1,0.2\n1.5,0.25,0.125\n"
MARKS = {",": ("latin-1", "."), ";": ("utf-16", ","), "\t": ("utf-8-sig", ",")}


def fem(path: Path) -> np.ndarray:
    found = read_table(path)
    return np.column_stack([found.actuation, found.angle_rad, found.moment_n_m])


def measured(path: Path) -> np.ndarray:
    run = read_measurement(path).runs[0]
    return np.column_stack(
        [run.history.actuation["pressure_pa"], run.outputs["angle_rad"], run.history.moment_n_m]
    )


def free_curve(path: Path) -> np.ndarray:
    found = read_bench_data(path)
    return np.column_stack([found.x, found.y, [0.2, 0.125]])


READERS = {
    "fit": (fem, "pressure_pa,angle_rad,moment_n_m"),
    "compare": (measured, "pressure_pa,angle_rad,moment_n_m"),
    "calibrate": (free_curve, "pressure_pa,angle_rad,Kraft für nichts"),
}


@pytest.mark.parametrize("use", READERS)
@pytest.mark.parametrize("separator", MARKS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16", "utf-16-le", "utf-16-be"])
def test_every_use_takes_every_separator_and_encoding(tmp_path, use, separator, encoding):
    read, header = READERS[use]
    rows = ROWS if separator == "," else ROWS.replace(",", separator).replace(".", ",")
    path = tmp_path / "bench.csv"
    path.write_bytes(f"# Büro, 20 °C\n{header.replace(',', separator)}\n{rows}".encode(encoding))
    assert np.array_equal(read(path), [[0.5, 0.1, 0.2], [1.5, 0.25, 0.125]])


TABLE = {
    name: [[0.5, 0.1, 0.2][k], [1.5, 0.25, 0.125][k]] for k, name in enumerate(READERS["fit"][1].split(","))
}
MADE = {
    "a.xlsx": lambda: spreadsheet({"S": [("Finger 3",), list(TABLE), *zip(*TABLE.values(), strict=True)]}),
    "a.mat": lambda: matlab({"data": {name: np.array(values) for name, values in TABLE.items()}}),
    "a.parquet": lambda: parquet({name: np.array(values) for name, values in TABLE.items()}),
    "a.txt": lambda: b"# pressure_pa angle_rad moment_n_m\n0.5 0.1 0.2\n1.5D0 0.25 0.125\n",
}


@pytest.mark.parametrize("use", ["fit", "compare"])
@pytest.mark.parametrize("name", MADE)
def test_every_use_takes_every_file_kind(tmp_path, use, name):
    (tmp_path / name).write_bytes(MADE[name]())
    assert np.array_equal(READERS[use][0](tmp_path / name), [[0.5, 0.1, 0.2], [1.5, 0.25, 0.125]])


def test_a_small_mat_that_unpacks_to_gigabytes_is_refused_before_it_is_read(tmp_path, monkeypatch):
    path = tmp_path / "a.mat"
    savemat(path, {name: np.zeros(300_000) for name in TABLE}, do_compression=True)
    assert path.stat().st_size < 30_000 and len(fem(path)) == 300_000
    monkeypatch.setattr("pliant_tables.matlab.UNPACKED", 5_000_000)
    for compressed in (True, False):
        savemat(path, {name: np.zeros(300_000) for name in TABLE}, do_compression=compressed)
        with pytest.raises(UserError, match="unpacks to more than 5 MB; save the table as CSV"):
            fem(path)


@pytest.mark.parametrize("use", READERS)
def test_every_use_asks_the_notes_for_marks_and_missing_values(tmp_path, use):
    read, header = READERS[use]
    (tmp_path / "a.csv").write_text(f"{header.replace(',', ';')};x\n1.500,0;0,25;0,2;OVER\n1;0;0;1\n")
    with pytest.raises(UserError, match="two ways"):
        read(tmp_path / "a.csv")
    (tmp_path / "a.yaml").write_text("decimal: ','\nmissing: OVER\n")
    assert read(tmp_path / "a.csv")[0, 0] == 1500.0


@pytest.mark.parametrize("use", READERS)
def test_units_stand_in_brackets_or_at_the_name_end(tmp_path, use):
    read, header = READERS[use]
    path = tmp_path / "bench.csv"
    for pressure, angle in (("pressure_kpa", "angle_deg"), ("pressure_pa (kPa)", "angle_rad [deg]")):
        if use == "fit" and pressure == "pressure_kpa":
            continue  # a law's table has its units in brackets or in the notes, and the message says so
        path.write_text(header.replace("pressure_pa", pressure).replace("angle_rad", angle) + "\n" + ROWS)
        found = read(path)
        assert np.allclose(found[:, 0], [500, 1500]) and np.allclose(found[:, 1], np.radians([0.1, 0.25]))


def test_a_german_table_with_notes_is_compared(tmp_path):
    (tmp_path / "bench.yaml").write_text(
        "rename: {Messung: run, 'Zeit [ms]': time_s, 'Druck [mbar]': pressure_pa, 'Winkel [deg]': angle_rad}\n"
    )
    path = tmp_path / "bench.csv"
    path.write_bytes("Messung;Zeit [ms];Druck [mbar];Winkel [deg]\nA;0;0;0\nA;2,5;10;18\n".encode("latin-1"))
    run = read_measurement(path).runs[0]
    assert run.name == "A" and np.allclose(run.history.time_s, [0, 2.5e-3])
    assert np.allclose(run.history.actuation["pressure_pa"], [0, 1000])
    assert np.allclose(run.outputs["angle_rad"], [0, np.pi / 10])


@pytest.mark.parametrize("use", READERS)
@pytest.mark.parametrize(
    ("content", "place"),
    [
        (b"%PDF-1.7", ""),
        (b"PK\x03\x04sheet", ""),
        (b"\x00\x01\x02\x03\x04", ""),
        (b"", ""),
        (b"{head}\n", ""),
        (b"1,2,3\n4,5,6\n", "line 1"),
        (b"{head}\n1,2,3\n1,2\n", "line 3"),
        (b"{head}\n1,0.1,3\n1,abc,3\n", "line 3"),
        (b'{head},"open\n1,2,3,4\n', "line 1"),
    ],
)
def test_a_mistake_is_told_with_file_and_row_in_every_use(tmp_path, use, content, place):
    read, header = READERS[use]
    path = tmp_path / "bench.csv"
    path.write_bytes(content.replace(b"{head}", header.encode()))
    with pytest.raises(UserError) as caught:
        read(path)
    assert str(path) in str(caught.value) and place in str(caught.value)


def test_a_decimal_that_may_be_read_in_two_ways_is_a_mistake(tmp_path):
    path = tmp_path / "bench.csv"
    path.write_text("pressure_pa;angle_rad;moment_n_m\n1.234,5;0,1;0\n")
    for read in (fem, measured):
        with pytest.raises(UserError, match="line 2.*two ways"):
            read(path)
