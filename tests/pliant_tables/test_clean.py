"""The short path of a clean CSV gives what the whole search gives, and clean files take it."""

import random

import pytest

from pliant_tables import text_header
from pliant_tables.cells import Marks
from pliant_tables.clean import clean_header
from pliant_tables.opening import open_sheet

NAMES = (
    "run",
    "time_s",
    "pressure_pa",
    "Time (s)",
    "x",
    "tip:Z",
    "N",
    "Pa",
    "s",
    "unit",
    "Druck",
    "nan",
    "",
    "1",
    "°",
)
TEXTS = ("a", "step 1", "", "nan", "-", "2026-08-31", "1,5", "b;c", '"q"', "12:30:01", "s", "mm")
NUMBERS = ("0", "1.5", "-2e-3", ".5", "1.430", "990", "1d3")
ABOVE = ("# a comment", "% rate: 25 Hz", "", "Length Units: mm", "Sampling rate,25 Hz", "** x, y, z")
MARKS = Marks(comma=True)


def a_file(draw: random.Random) -> str:
    """Return a text that is nearly a clean CSV: each deviation occurs in some files."""
    often = draw.choice((0.0, 0.0, 0.02, 0.3))

    def odd() -> bool:
        return draw.random() < often

    width = draw.randint(1, 4)
    names = draw.sample(NAMES[:4], width) if not odd() else [draw.choice(NAMES) for _ in range(width)]
    wordy = {c for c in range(width) if draw.random() < 0.3}

    def row() -> str:
        cells = [draw.choice(TEXTS if (c in wordy) != odd() else NUMBERS) for c in range(width + odd())]
        return draw.choice((",", ",", ", ")).join(cells)

    above = [draw.choice(ABOVE[:3] if not odd() else ABOVE) for _ in range(draw.randint(0, 2))]
    units = [",".join(draw.choice(("s", "Pa", "mm", "")) for _ in range(width))] if odd() else []
    return "\n".join([*above, ",".join(names), *units, *(row() for _ in range(draw.randint(0, 12)))])


def both(content: str):
    lines = content.split("\n")
    shown = [
        k
        for k, line in enumerate(lines)
        if line.strip() and not line.lstrip().startswith(text_header.COMMENTS)
    ]
    return clean_header(lines, shown, MARKS) if shown else None, lambda: text_header._searched(
        lines, shown, MARKS
    )


def test_the_short_path_finds_the_same_header_as_the_whole_search():
    draw, taken = random.Random(5), 0
    for _ in range(4000):
        content = a_file(draw)
        clean, searched = both(content)
        if clean is not None:
            taken += 1
            assert searched() == (",", clean), content
    assert taken > 400


@pytest.mark.parametrize(
    "content",
    [
        "run,time_s,pressure_pa\na,0,1\na,1,2\n",
        "# of the bench\n\nrun,time_s,pressure_pa\na,0,1\na,1,\n",
        "Time (s),Pressure (kPa)\n0,1\n1,2\n",
    ],
)
def test_a_clean_file_enters_no_search(content, tmp_path, monkeypatch):
    path = tmp_path / "clean.csv"
    path.write_text(content)

    def entered(*_: object) -> None:
        raise AssertionError("the search for a header was entered")

    monkeypatch.setattr(text_header, "_searched", entered)
    monkeypatch.setattr(text_header, "with_length_unit", entered)
    with open_sheet(path, "time_s") as sheet:
        assert sum(len(block.lines) for block in sheet.blocks()) == 2


@pytest.mark.parametrize(
    "content",
    [
        "a;b\n1;2\n",
        "a,b\n s,Pa\n1,2\n",
        "a,a\n1,2\n",
        '"a",b\n1,2\n',
        "a,b\n1,2,3\n",
        "a,b\n,2\n1,2\n",
        "s,Pa\n1,2\n",
        "a\n1\n",
        "1,2\n3,4\n",
        "a,b\n",
    ],
)
def test_any_other_file_takes_the_search(content):
    assert both(content)[0] is None
