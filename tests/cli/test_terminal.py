"""Terminal output: progress with an estimated total, bars of a diagnosis, tables in eighty characters."""

from __future__ import annotations

import io
import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from pliant.cli import bars
from pliant.execution import progress
from pliant.execution.progress import LogBar
from pliant.records.remark import Rank, Remark
from pliant.report.document import Document, Picture, Warned, drawn
from pliant.report.fitted import caveat
from pliant.report.improvement import steps_brief
from pliant.report.render import SETTLE_FIRST, page, rich_table, terminal


def _console(terminal: bool) -> tuple[Console, io.StringIO]:
    text = io.StringIO()
    return Console(file=text, force_terminal=terminal, width=120, color_system=None), text


def test_lines_never_state_a_negative_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "LINE_EVERY_S", -1.0)
    console, text = _console(terminal=False)
    task = bars.TerminalProgress(console, quiet=False).begin("FEM states", 2)
    for _ in range(4):
        task.advance()
    task.expect(6)
    task.advance()
    lines = text.getvalue().splitlines()
    assert "left" in lines[0]
    assert [line.split(",")[0] for line in lines[1:4]] == [f"FEM states: {n}/{n}" for n in (2, 3, 4)]
    assert not any("left" in line for line in lines[1:4])
    assert lines[4].startswith("FEM states: 5/6") and "left" in lines[4]


def test_the_bar_grows_with_the_steps_and_says_no_time_beyond_its_estimate() -> None:
    console, text = _console(terminal=True)
    task = bars.TerminalProgress(console, quiet=False).begin("FEM states", 2)
    for _ in range(4):
        task.advance()
    task.finish()
    drawn = text.getvalue()
    assert "4/4" in drawn and "4/2" not in drawn
    assert not re.search(r"-\d", drawn) and "left" not in drawn.splitlines()[-1]


def test_steps_that_nobody_can_count_have_no_time_left() -> None:
    said: list[str] = []
    bar = LogBar(said.append, "fitting sets of effects", 0, 0)
    bar.said -= 60.0
    bar.started -= 60.0
    bar.advance()
    bar.expect(1)
    bar.finish()
    assert said[0].startswith("fitting sets of effects: 1 so far, 60") and "left" not in said[0]
    assert said[1].startswith("fitting sets of effects: 1/1 in 60")


@pytest.mark.parametrize("kinds", [3, 9])
def test_the_bar_ends_with_what_was_fitted(kinds) -> None:
    said: list[tuple[str, int]] = []

    class SilentBar:
        def __getattr__(self, name):
            return lambda value=1: said.append((name, value))

    class Progress:
        begin = staticmethod(lambda title, total: said.append((title, total)) or SilentBar())

    with bars.fitting_bar(Progress(), kinds) as bar:
        for name in ("nothing", "a", "b", "a + b", "nothing", "a"):
            bar.tick(name)
    titles = [entry for entry in said if entry[0].startswith("fitting")]
    # The number of sets is unknown: their bar shows no end.
    assert titles == [
        ("fitting effects", 1 + kinds),
        ("fitting sets of effects", 0),
        ("fitting effects again", 1 + kinds),
    ]
    assert [value for name, value in said if name == "expect"] == [3, 1, 2]
    assert sum(name == "advance" for name, _ in said) == 6


def lines(names: list[str]) -> list[str]:
    """Return the table of two steps that read these outputs, each off by 0.01 rad or m."""
    rmse = dict.fromkeys(names, 0.01)
    steps = [
        SimpleNamespace(
            named=kind, added=added, locked_se=0.34, locked=SimpleNamespace(rmse=rmse, over_floor=4.96)
        )
        for kind, added in (("", ()), ("viscoelastic", ("viscoelastic",)))
    ]
    floors = {name: SimpleNamespace(value=0.002) for name in names}
    found: Any = SimpleNamespace(steps=steps, scored_on="runs held out", floors=floors)
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(rich_table(steps_brief(found)))
    return console.export_text().splitlines()


@pytest.mark.parametrize("joints", [1, 4, 8])
def test_nothing_is_cut(joints: int) -> None:
    names = [f"joint_{k}_angle_rad" for k in range(1, joints + 1)]
    said = lines([*names, "tip_x_m"])
    text = "\n".join(said)
    assert "…" not in text and "error on runs held out" in said[0]
    assert all(f"joint {k} angle" in text for k in range(1, joints + 1))
    assert text.count("4.96 ± 0.34") == 2 and text.count("0.573°") == 2 * joints
    assert max(len(line.rstrip()) for line in said) <= 80


REMARKS = (
    Remark("Column 'foto' is ignored.", Rank.DETAIL),
    "There is one run only: nothing repeats, and no run can be held out.",
    Remark("'leak' was left out: effect 'leak' needs a pressure.", Rank.DETAIL, "leak"),
    Remark("angle_rad: no repeats and no sigma.", Rank.FLOOR),
    Remark("Unit to check: pressure_pa reaches 150.", Rank.UNIT),
    "Readings of run 'a' are missing.",
    "Readings of run 'b' are missing.",
)


def _lines(has_page: bool) -> list[str]:
    notes = (Warned("effects that it cannot have: leak.", ("why",), folded=True), *map(caveat, REMARKS))
    document = Document("kind", "title", "The model is right.", brief=("a table",), warnings=notes)
    return [str(line) for line in terminal(document, has_page)]


def test_the_gravest_notes_come_first_and_the_least_are_counted_where_a_page_has_them() -> None:
    """A doubt about a unit is printed before every number, and the last sentence asks to settle it."""
    lines = _lines(has_page=True)
    assert lines[0] == f"note: {REMARKS[4]}" and lines[1] == "a table"
    assert lines[2] == f"note: {REMARKS[3]}"  # the floor, then the missing data
    assert [line.removeprefix("note: ") for line in lines[3:6]] == [REMARKS[1], *REMARKS[5:]]
    assert lines[6] == "note: 2 more in the report."
    assert lines[7] == "note: effects that it cannot have: leak." and "  why" not in lines
    assert lines[8:] == ["The model is right.", SETTLE_FIRST]


def test_without_a_page_every_note_is_printed() -> None:
    lines = _lines(has_page=False)
    assert {f"note: {text}" for text in REMARKS} < set(lines)
    assert not any("more in the report" in line for line in lines)


def test_a_page_says_the_doubt_first() -> None:
    hero = Picture("hero", "the picture", np.zeros(8, np.uint8))
    notes = tuple(map(caveat, REMARKS))
    document = Document("kind", "title", "Wrong.", warnings=notes, points=("why",), draw=lambda: drawn(hero))
    assert next(one.sentence for one in document.ranked) == REMARKS[4]
    html = page(document).html
    assert html.index(SETTLE_FIRST) < html.index(">why<") < html.index(REMARKS[4]) < html.index(REMARKS[1])
