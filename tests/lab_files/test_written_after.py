"""Files devised after the reader was written: none may be read wrongly without a warning."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from tests.lab_files.judge import difference, judge_reading, read
from tests.lab_files.lab_file import LabFile, digits, rows, text
from tests.lab_files.written import DEG, KPA, MBAR, MS, P, T, matlab, named, spreadsheet, stamps

from pliant.measurements.files import read_measurements

ENGLISH = "time_s,pressure_kpa,angle_deg"
LATE = [(datetime(2026, 8, 2, 23, 59, 59) + timedelta(seconds=float(t))).strftime("%H:%M:%S.%f") for t in T]
THOUSANDS = [f"{int(p):,}" for p in P]


def german(*columns) -> list[str]:
    return rows(*columns, between=";", decimal=",")


READ = {
    "a separator at the end of rows alone": text(ENGLISH, *(line + "," for line in rows(T, KPA, DEG))),
    "units at the end of German names": text("Zeit_s;Druck_mbar;Winkel_Grad", *german(T, MBAR, DEG)),
    "units behind 'in'": text("Zeit in s;Druck in kPa;Biegewinkel in °", *german(T, KPA, DEG)),
    "a date and a time of day": text(
        "Date,Time,Pressure [kPa],Angle [deg]", *rows(stamps("%Y-%m-%d"), stamps("%H:%M:%S.%f"), KPA, DEG)
    ),
    "American dates": text("time,pressure_kpa,angle_deg", *rows(stamps("%m/%d/%Y %I:%M:%S.%f %p"), KPA, DEG)),
    "a time of day that passes midnight": text("time,pressure_kpa,angle_deg", *rows(LATE, KPA, DEG)),
    "numbers above the header": text(
        "Kanal;1;2", "Faktor;0,5;0,7", "", "Zeit [s];Druck [kPa];Winkel [°]", *german(T, KPA, DEG)
    ),
    "a first column of labels": text(
        "Channel\tTime\tPressure\tAngle",
        "Unit\ts\tkPa\tdeg",
        *("\t" + line for line in rows(T, KPA, DEG, between="\t")),
    ),
    "a preamble of 500 lines": text(*(f"key{k}: {k}" for k in range(500)), ENGLISH, *rows(T, KPA, DEG)),
    "decimal commas between blanks": text(
        "time_s pressure_kpa angle_deg", *rows(T, KPA, DEG, between=" ", decimal=",")
    ),
    "a comment below the header": text(ENGLISH, "", "# ready", *rows(T, KPA, DEG)),
    "UTF-16 without a mark": text(ENGLISH, *rows(T, KPA, DEG), encoding="utf-16-le"),
}
ASKED = {
    "no units at all": (
        text("Time,Pressure,Angle", *rows(T, KPA, DEG)),
        ('"Pressure": pressure_pa', '"Time": s  #'),
    ),
    "thousands between decimal commas": (
        text(
            "time_s;pressure_pa;angle_deg",
            *(
                f"{digits(t, ',')};{p.replace(',', '.')};{digits(a, ',')}"
                for t, p, a in zip(T, THOUSANDS, DEG, strict=True)
            ),
        ),
        ("two ways", "decimal"),
    ),
    "thousands and no decimals": (
        text(
            "time_ms;pressure_pa;angle_deg",
            *(f"{int(m)};{p.replace(',', '.')};{int(a)}" for m, p, a in zip(MS, THOUSANDS, DEG, strict=True)),
        ),
        ("two ways", "decimal"),
    ),
    "English thousands": (
        text(
            "time_s,pressure_pa,angle_deg",
            *(f'{digits(t)},"{p}",{digits(a)}' for t, p, a in zip(T, THOUSANDS, DEG, strict=True)),
        ),
        ("two ways", "decimal"),
    ),
    "a force that may be the tendon's": (
        text("Zeit [s];Kraft [N];Winkel [°]", *german(T, KPA, DEG)),
        ('"Kraft [N]": tendon_force_n',),
    ),
    "dates with the month or the day first": (
        text("time,pressure_kpa,angle_deg", *rows([f"{8 + k % 2:02}/02/2026" for k in range(61)], KPA, DEG)),
        ("month", "2026-08-31"),
    ),
    "two rates": (
        text(
            "# frame rate: 25 fps, playback frame rate: 30 fps",
            "frame,pressure_kpa,angle_deg",
            *rows(MS / 40, KPA, DEG),
        ),
        ("25 and 30 Hz", "rate"),
    ),
    "lower-case grad": (
        text("Zeit_s;Druck_kpa;winkel_grad", *german(T, KPA, DEG)),
        ("winkel_grad", "rename"),
    ),
    "a header that stands again": (
        text(ENGLISH, *rows(T, KPA, DEG), ENGLISH, *rows(T, KPA, DEG)),
        ("line 63", "time_s", "not a number"),
    ),
    "rows below the table": (text(ENGLISH, *rows(T, KPA, DEG), "Mean,7.5,20"), ("line 63", "Mean")),
}


@pytest.mark.parametrize("content", READ.values(), ids=READ)
def test_it_is_read(tmp_path: Path, content: bytes):
    lab = LabFile("", {"a.csv": content}, named("a"))
    found = read(lab, tmp_path)
    assert not found.message and judge_reading(lab, found) == "right", found.wrong
    assert found.measurement is not None and not found.measurement.doubts


@pytest.mark.parametrize(("content", "words"), ASKED.values(), ids=ASKED)
def test_it_is_asked_about(tmp_path: Path, content: bytes, words: tuple[str, ...]):
    message = read(LabFile("", {"a.csv": content}), tmp_path).message
    assert all(word in message for word in words), message


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.mat", matlab({"M": np.column_stack([T, KPA, DEG])}), "columns of one length"),
        ("a.mat", b"MATLAB 5.0 MAT-file" + bytes(300), "cannot be read as a MATLAB file"),
        ("a.xlsx", spreadsheet({"S": [("time_s", "pressure_kpa")]}), "empty"),
        ("a.xlsx", spreadsheet({"S": [(1, 2), (3, 4)]}), "looks like a header"),
        ("a.parquet", b"PAR1" + bytes(50), "cannot be read as a Parquet file"),
    ],
)
def test_tables_that_are_none(tmp_path: Path, name: str, content: bytes, words: str):
    message = read(LabFile("", {name: content}), tmp_path).message
    assert words in message and str(tmp_path / name) in message


def test_a_block_to_paste_is_an_answer(tmp_path: Path):
    lab = LabFile("", {"a.csv": text("Zeit_s;Druck_kpa;th [°]", *german(T, KPA, DEG))}, named("a"))
    message = read(lab, tmp_path).message
    (tmp_path / "a.yaml").write_text(message.split("meant so):\n")[1])

    assert not difference(lab.answer, read_measurements(tmp_path / "a.csv"))
