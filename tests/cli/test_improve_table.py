"""The table of `pliant improve` keeps its labels and its numbers in eighty characters, however much is read."""

from __future__ import annotations

import io
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console

from pliant.report.improvement import steps_brief
from pliant.report.render import rich_table


def lines(names: list[str]) -> list[str]:
    """The table of two steps that read these outputs, each off by 0.01 rad or m."""
    rmse = dict.fromkeys(names, 0.01)
    steps = [
        SimpleNamespace(
            named=kind, added=added, locked_se=0.34, locked=SimpleNamespace(rmse=rmse, over_floor=4.96)
        )
        for kind, added in (("", ()), ("viscoelastic", ("viscoelastic",)))
    ]
    floors = {name: SimpleNamespace(value=0.002) for name in names}
    found: Any = SimpleNamespace(steps=steps, scored_on="runs put aside", floors=floors)
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(rich_table(steps_brief(found)))
    return console.export_text().splitlines()


@pytest.mark.parametrize("joints", [1, 4, 8])
def test_nothing_is_cut(joints: int) -> None:
    names = [f"joint_{k}_angle_rad" for k in range(1, joints + 1)]
    said = lines([*names, "tip_x_m"])
    text = "\n".join(said)
    assert "…" not in text and "error on runs put aside" in said[0]
    assert all(f"joint {k} angle" in text for k in range(1, joints + 1))
    assert text.count("4.96 ± 0.34") == 2 and text.count("0.573°") == 2 * joints
    assert max(len(line.rstrip()) for line in said) <= 80
