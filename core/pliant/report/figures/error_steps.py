"""The error falling step by step on runs that were never fitted, down to the floor, with the reason for each step."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from pliant.diagnosis.improvement import Improvement
from pliant.formatting import number, unit_of
from pliant.report.figures import style

MOST_OUTPUTS = 2
WIDTH_PX, TEXT_PX = 1770, 760
LINE_PX, CHARACTERS = 27, 66
SMALLEST_PX = 620


def error_steps(found: Improvement, reasons: Sequence[str]) -> style.Png:
    """A panel per output, the farthest above its floor first; beside them `reasons`, one per step."""
    outputs = outputs_by_error(found)[:MOST_OUTPUTS]
    heads = [_head(place, step.named) for place, step in enumerate(found.steps, start=1)]
    texts = [[head, *textwrap.wrap(text, CHARACTERS)] for head, text in zip(heads, reasons, strict=True)]
    texts.append(["Why it stops here", *textwrap.wrap(found.reason, CHARACTERS)])
    lines = sum(len(text) + 1 for text in texts)
    height = max(SMALLEST_PX, LINE_PX * lines + 60)
    with style.canvas(WIDTH_PX, height, pad=None) as figure:
        share = TEXT_PX / WIDTH_PX
        grid = figure.add_gridspec(
            1,
            len(outputs),
            left=0.055,
            right=1 - share - 0.02,
            bottom=100 / height,
            top=1 - 70 / height,
            wspace=0.3,
        )
        for k, name in enumerate(outputs):
            _panel(figure.add_subplot(grid[0, k]), found, name)
        _reasons(figure, texts, height)
        return style.png(figure)


def outputs_by_error(found: Improvement) -> list[str]:
    """Outputs that were put aside, the one farthest above its floor at the start first."""
    first = found.steps[0].locked.rmse
    return sorted(first, key=lambda name: -first[name] / found.floors[name].value)


def _panel(axes: Any, found: Improvement, name: str) -> None:
    words, floor = unit_of(name), found.floors[name]
    places = np.arange(1, len(found.steps) + 1)
    locked = np.array([step.locked.rmse[name] for step in found.steps]) * words.factor
    training = np.array([step.training.rmse.get(name, np.nan) for step in found.steps]) * words.factor
    share = np.array([step.locked_se / step.locked.over_floor for step in found.steps])
    level, error = floor.value * words.factor, floor.se * words.factor
    ends = (0.5, len(places) + 0.5)
    axes.fill_between(ends, level - 2 * error, level + 2 * error, color=style.FAINT, alpha=0.6, lw=0)
    axes.plot(ends, [level, level], color=style.SOFT, ls="--", lw=1.2)
    axes.annotate(
        f"noise floor {words.text(floor.value, 2)}", (ends[1], level), (-4, -5), textcoords="offset points",
        ha="right", va="top", fontsize=8.5, color=style.SOFT,
    )  # fmt: skip
    axes.plot(places, training, "o:", color=style.SOFT, ms=4, lw=1, label="training runs, left out in turn")
    axes.errorbar(
        places, locked, yerr=locked * share, fmt="o-", color=style.SERIES[0], ms=8, lw=2.2, capsize=4,
        label="runs put aside at the start" if found.locked.runs else found.scored_on,
    )  # fmt: skip
    for x, value in zip(places, locked, strict=True):
        axes.annotate(
            number(value, 3), (x, value), (9, 9), textcoords="offset points", fontsize=9.5, weight="bold",
            color=style.SERIES[0],
        )  # fmt: skip
    labels = [_label(k, step.added) for k, step in enumerate(found.steps, start=1)]
    axes.set_xticks(places, labels)
    axes.grid(visible=False, axis="x")
    axes.set_xlim(*ends)
    axes.set_ylim(0, 1.38 * float(np.nanmax([*(locked * (1 + share)), *training, level])))
    axes.set_ylabel(f"rms error ({words.symbol})")
    axes.set_title(words.label)
    axes.legend(loc="upper right")


def _label(place: int, added: Sequence[str]) -> str:
    name = " + ".join(kind.replace("_", " ") for kind in added)
    return f"{place}\n+ {textwrap.fill(name, 14)}" if added else f"{place}\nas it was"


def _head(place: int, added: str) -> str:
    return f"{place}  + {added}" if added else f"{place}  as it was"


def _reasons(figure: Any, texts: Sequence[Sequence[str]], height: int) -> None:
    left, y = 1 - TEXT_PX / WIDTH_PX + 0.005, 1 - 64 / height
    for text in texts:
        for k, line in enumerate(text):
            figure.text(left, y, line, fontsize=9.2, va="top", weight="normal" if k else "bold")
            y -= LINE_PX / height
        y -= LINE_PX / height
