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
    first = found.steps[0].locked.rmse
    outputs = sorted(first, key=lambda name: -first[name] / found.floors[name].value)[:MOST_OUTPUTS]
    texts = []
    for place, (step, reason) in enumerate(zip(found.steps, reasons, strict=True), start=1):
        head = f"{place}  {f'+ {step.named}' if step.named else 'as it was'}"
        texts.append([head, *textwrap.wrap(reason, CHARACTERS)])
    texts.append(["Why it stops here", *textwrap.wrap(found.reason, CHARACTERS)])
    height = max(SMALLEST_PX, LINE_PX * sum(len(text) + 1 for text in texts) + 60)
    with style.canvas(WIDTH_PX, height, pad=None) as figure:
        share = TEXT_PX / WIDTH_PX
        sides = {"left": 0.055, "right": 1 - share - 0.02, "bottom": 100 / height, "top": 1 - 70 / height}
        grid = figure.add_gridspec(1, len(outputs), wspace=0.3, **sides)
        for k, name in enumerate(outputs):
            _panel(figure.add_subplot(grid[0, k]), found, name)
        y = 1 - 64 / height
        for text in texts:
            for k, line in enumerate(text):
                weight = "normal" if k else "bold"
                figure.text(1 - share + 0.005, y, line, fontsize=9.2, va="top", weight=weight)
                y -= LINE_PX / height
            y -= LINE_PX / height
        return style.png(figure)


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
    look: dict[str, Any] = {"ha": "right", "va": "top", "color": style.SOFT}
    style.note(axes, f"noise floor {words.text(floor.value, 2)}", (ends[1], level), (-4, -5), **look)
    axes.plot(places, training, "o:", color=style.SOFT, ms=4, lw=1, label="training runs, left out in turn")
    label = "runs put aside at the start" if found.locked.runs else found.scored_on
    look = {"fmt": "o-", "color": style.SERIES[0], "ms": 8, "lw": 2.2, "capsize": 4}
    axes.errorbar(places, locked, yerr=locked * share, label=label, **look)
    for x, value in zip(places, locked, strict=True):
        look = {"fontsize": 9.5, "weight": "bold", "color": style.SERIES[0]}
        style.note(axes, number(value, 3), (x, value), (9, 9), **look)
    axes.set_xticks(places, [_label(k, step.added) for k, step in enumerate(found.steps, start=1)])
    axes.grid(visible=False, axis="x")
    axes.set_xlim(*ends)
    axes.set_ylim(0, 1.38 * float(np.nanmax([*(locked * (1 + share)), *training, level])))
    axes.set_ylabel(f"rms error ({words.symbol})")
    axes.set_title(words.label)
    axes.legend(loc="upper right")


def _label(place: int, added: Sequence[str]) -> str:
    name = " + ".join(kind.replace("_", " ") for kind in added)
    return f"{place}\n+ {textwrap.fill(name, 14)}" if added else f"{place}\nas it was"
