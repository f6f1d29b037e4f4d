"""The error falling step by step on runs that were never fitted, down to the floor."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from pliant.diagnosis.improvement import Improvement
from pliant.formatting import number, unit_of
from pliant.report.figures import style

MOST_OUTPUTS = 2
HEIGHT_PX, WIDEST_PX = 600, 1770
STEP_PX, MARGIN_PX, SMALLEST_PX, NARROWEST_PX = 200, 160, 880, 1400


def error_steps(found: Improvement) -> style.Png:
    """A panel per output, the farthest above its floor first: a staircase with short labels."""
    first = found.steps[0].locked.rmse
    outputs = sorted(first, key=lambda name: -first[name] / found.floors[name].value)[:MOST_OUTPUTS]
    width = max(SMALLEST_PX, STEP_PX * len(found.steps) + MARGIN_PX) * len(outputs)
    with style.canvas(min(max(width, NARROWEST_PX), WIDEST_PX), HEIGHT_PX) as figure:
        for panel, name in zip(style.panels(figure, len(outputs), len(outputs)), outputs, strict=True):
            _panel(panel, found, name)
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
    treads = [ends[0], *(places[:-1] + 0.5), ends[1]]
    axes.stairs(locked, treads, baseline=None, color=style.SERIES[0], alpha=0.35, lw=2.2)
    axes.plot(places, training, "o:", color=style.SOFT, ms=4, lw=1, label="training runs, left out in turn")
    label = "runs put aside at the start" if found.locked.runs else found.scored_on
    look = {"fmt": "o", "color": style.SERIES[0], "ms": 8, "lw": 2.2, "capsize": 4}
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
