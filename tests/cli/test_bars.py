"""Progress that is only estimated: more steps than were expected."""

from __future__ import annotations

import io
import re

import pytest
from rich.console import Console

from pliant.cli import bars
from pliant.execution import progress


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
