"""The nominal and the robust design over the same scenarios."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.report.figures import style
from pliant.report.search_sentences import measure_words
from pliant.report.search_view import SearchView

LOOKS = {"nominal": style.SERIES[1], "robust": style.SERIES[0]}


def search_robust(read: SearchView) -> style.Png | None:
    """Left: share of scenarios up to an objective. Right: every scenario of both designs as a dot."""
    found = read.result.robustness
    if found is None or not found.spread:
        return None
    factor = read.objective.unit.factor
    with style.canvas(1500, 580, pad=(0.09, 0.06)) as figure:
        left, right = figure.subplots(1, 2)
        for row, (name, values) in enumerate(found.spread.items()):
            shown = factor * np.sort(np.asarray(values, float)[np.isfinite(values)])
            if not len(shown):
                continue
            colour = LOOKS.get(name, style.SERIES[2])
            share = 100 * np.arange(1, len(shown) + 1) / len(shown)
            left.step(
                [shown[0], *shown],
                [0, *share],
                where="post",
                color=colour,
                lw=4 - 2 * row,
                label=f"{name} design",
            )
            _strip(right, shown, row, colour)
            nominal, measured = {
                "nominal": (found.nominal_of_nominal, found.robust_of_nominal),
                "robust": (found.nominal_of_robust, found.robust_of_robust),
            }.get(name, (np.nan, np.nan))
            look: dict[str, Any] = {"zorder": 6, "ls": "", "clip_on": False}
            right.plot(factor * nominal, row - 0.3, marker="v", ms=10, color=colour, **look,
                       label="without any deviation" if row == 0 else None)  # fmt: skip
            right.plot(factor * measured, row + 0.3, marker="^", ms=10, color=style.INK, **look,
                       label=measure_words(found) if row == 0 else None)  # fmt: skip
        left.set(ylim=(0, 103), ylabel="scenarios up to here (%)")
        left.legend(loc="best")
        left.set_title("Share of the scenarios")
        right.set_yticks(range(len(found.spread)), [f"{name}\ndesign" for name in found.spread])
        right.set(ylim=(len(found.spread) - 0.45, -0.55), title=f"Each of {found.samples} scenarios")
        for axes in (left, right):
            axes.set_xlabel(f"{read.objective.title}, {read.objective.best_word}")
        figure.legend(*right.get_legend_handles_labels(), loc="outside lower right", ncols=2)
        return style.png(figure)


def _strip(axes: Any, shown: Any, row: int, colour: str) -> None:
    spread = np.random.default_rng(row).uniform(-0.16, 0.16, len(shown))
    axes.scatter(shown, row + spread, 22, color=colour, lw=0, alpha=0.6)
    axes.plot([np.median(shown)] * 2, [row - 0.22, row + 0.22], color=colour, lw=2.5)
