"""The first row of a table: below any preamble, in any of the layouts of instruments, and nowhere else."""

import random
from pathlib import Path

import pytest

from pliant_tables.errors import UserError
from pliant_tables.notes import StatedNotes
from pliant_tables.opening import open_sheet
from pliant_tables.preamble import rates, with_length_unit

HEADER = ["Versuch", "Zeit [s]", "Druck [kPa]", "Winkel [°]"]
WORDS = [
    "Prüfer",
    "M. Müller",
    "Ort",
    "Halle 2",
    "Datum",
    "02.08.2026",
    "Kanal",
    "1",
    "0,5",
    "Name",
    "",
    "",
    "A",
    "°",
]


def read_header(tmp_path: Path, text: str) -> list[str]:
    path = tmp_path / "a.csv"
    path.write_text(text)
    with open_sheet(path, "a,b") as sheet:
        return sheet.header


@pytest.mark.parametrize("seed", range(60))
def test_a_header_with_known_words_is_recognised_below_any_preamble(tmp_path: Path, seed: int):
    rng = random.Random(seed)
    width = len(HEADER)
    preamble = [
        ";".join(
            [*(rng.choice(WORDS) for _ in range(rng.randint(1, width + 2))), *[""] * width][
                : rng.choice((width, 9))
            ]
        )
        for _ in range(rng.randint(0, 8))
    ]
    rows = [
        ";".join(
            [
                f"lauf_{k // 8}",
                f"{k / 10:.1f}".replace(".", ","),
                f"{k % 8}",
                "" if k < 3 else f"{2 * (k % 8)}",
            ]
        )
        for k in range(rng.choice((12, 200)))
    ]
    units = [";s;kPa;°"] if seed % 3 == 0 else []
    header = ["Versuch", "Zeit", "Druck", "Winkel"] if units else HEADER
    text = "\n".join([*preamble, ";".join(header), *units, *rows]) + "\n"
    assert read_header(tmp_path, text) == HEADER, text


def test_cells_that_are_missing_are_no_names(tmp_path: Path):
    rows = "".join(f"{k},{2 * k}\n" for k in range(9))
    assert read_header(tmp_path, "ch0,ch1\nnan,n/a\n" + rows) == ["ch0", "ch1"]


def test_rows_before_a_line_with_words_are_never_dropped(tmp_path: Path):
    rows = "".join(f"{k},{2 * k}\n" for k in range(9))
    with pytest.raises(UserError, match="the first row holds numbers; write a header"):
        read_header(tmp_path, rows + "pause,pause\n" + rows)
    assert read_header(tmp_path, "a,b\n" + rows + "a,b\n" + rows + rows) == ["a", "b"]


def test_the_notes_may_say_where_the_header_stands(tmp_path: Path):
    rows = "".join(f"{k};{2 * k}\n" for k in range(9))
    text = "time [s];angle [deg]\n" + rows + "ch0;ch1\n" + rows
    assert read_header(tmp_path, text) == ["time [s]", "angle [deg]"]
    with open_sheet(tmp_path / "a.csv", "a,b", StatedNotes(header=11)) as sheet:
        assert sheet.header == ["ch0", "ch1"] and sheet.header_line == 11
        assert sheet.table()[0] == list(range(12, 21))
    with pytest.raises(UserError, match=r"'header: 40' in a.yaml is below the table"):
        open_sheet(tmp_path / "a.csv", "a,b", StatedNotes(header=40))


@pytest.mark.parametrize(
    ("lines", "separator", "hz"),
    [
        (["Export Frame Rate,30"], ",", {30.0}),
        (["Capture Frame Rate,100.000000,Export Frame Rate,25.000000"], ",", {25.0}),
        (["FREQUENCY\t100", "ANALOG_FREQUENCY\t1000"], "\t", {100.0}),
        (["Trajectories", "200"], ",", {200.0}),
        (["DataRate\tCameraRate\tUnits\tOrigDataRate", "60.00\t60.00\tmm\t120.00"], "\t", {60.0}),
        (["Bildrate [Hz];29,97"], ";", {29.97}),
        (["# frame rate: 25 fps"], ",", {25.0}),
        (["Sampling rate [Hz]: 50"], ",", {50.0}),
        (["Sample Rate,25,Hz"], ",", {25.0}),
        (["Frame count,900", "Rate of loading,2", "Total Frames in Take,900"], ",", set()),
    ],
)
def test_rates_that_lines_above_a_header_state(lines: list[str], separator: str, hz: set[float]):
    assert rates(lines, separator) == hz


def test_the_length_unit_is_for_positions_alone():
    names = ["Frame", "X", "tip:Y", "tip Z [m]", "hand:Rotation:X", "Force x", "Index"]
    lines = ["Rotation Type,Quaternion,Length Units,Millimeters"]
    assert with_length_unit(names, lines, ",") == [
        *["Frame", "X [mm]", "tip:Y [mm]", "tip Z [m]", "hand:Rotation:X", "Force x", "Index"]
    ]
    assert with_length_unit(names, ["Units,Quaternion"], ",") == names


def test_blank_cells_at_row_ends_are_missing_values(tmp_path):
    path = tmp_path / "bench.csv"
    path.write_text("time_s,pressure_pa,angle_rad\n0,1000,0.1\n1,2000,\n2,3000,\n", encoding="utf-8")
    with open_sheet(path, "a,b") as sheet:
        assert list(sheet.header) == ["time_s", "pressure_pa", "angle_rad"]
