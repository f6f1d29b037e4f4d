"""The error against the circumstances that it depends on: before and after the best explanation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pliant.evidence.covariates import Covariate
from pliant.evidence.places import Place
from pliant.formatting import NamedUnit, unit_of, whole_percent
from pliant.report.comparison_view import Compared, fitting
from pliant.report.diagnosis_view import Diagnosed
from pliant.report.figures import style
from pliant.report.figures.explained_runs import AS_IT_IS, WITH

MOST = 3


def error_depends(diagnosed: Diagnosed, output: str) -> style.Png | None:
    """A panel for each of the circumstances that tell most of the error; None where none varies."""
    items = leading(diagnosed)
    if not items:
        return None
    words = unit_of(output)
    with style.canvas(max(520 * len(items), 900), 520) as figure:
        axes = figure.subplots(1, len(items), squeeze=False, sharey=True)[0]
        for panel, item in zip(axes, items, strict=True):
            _panel(panel, diagnosed, item, output, words)
        axes[0].set_ylabel(f"mean error ({words.symbol})" if words.symbol else "mean error")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=len(labels))
        figure.set_layout_engine("constrained", w_pad=0.05, h_pad=0.05)
        return style.png(figure)


def leading(diagnosed: Diagnosed) -> list[Covariate]:
    """The circumstances that tell most of the error of the model as it is."""
    tells = diagnosed.before.comparison.depends_on
    items = [item for item in diagnosed.before.covariates.items if item.name in tells]
    return sorted(items, key=lambda item: -tells[item.name])[:MOST]


def _panel(panel: Any, diagnosed: Diagnosed, item: Covariate, output: str, words: NamedUnit) -> None:
    panel.axhline(0, color=style.SOFT, lw=0.8)
    told = [whole_percent(diagnosed.before.comparison.depends_on[item.name])]
    _means(panel, diagnosed.before, item, output, words, AS_IT_IS, "model as it is")
    if diagnosed.after is not None:
        told.append(whole_percent(diagnosed.after.comparison.depends_on.get(item.name, 0.0)))
        label = f"with {' + '.join(diagnosed.explanations[0])}"
        _means(panel, diagnosed.after, item, output, words, WITH[0], label)
    panel.set_title(f"{fitting(item.shown.label, 34)}\n", fontsize=9.5, pad=2)
    panel.annotate(
        f"tells {' → '.join(told)} of the error's variance", (0, 1), (0, 3), xycoords="axes fraction",
        textcoords="offset points", fontsize=8, color=style.SOFT,
    )  # fmt: skip


def _means(
    panel: Any, compared: Compared, item: Covariate, output: str, words: NamedUnit, colour: str, label: str
) -> None:
    places = [p for p in compared.comparison.places if p.covariate == item.name and output in p.outputs]
    x = _positions(panel, places, item)
    places = [p for p, at in zip(places, x, strict=True) if np.isfinite(at)]
    x = x[np.isfinite(x)]
    mean = np.array([p.outputs[output].mean for p in places]) * words.factor
    half = np.array([np.ptp(p.outputs[output].interval) / 2 for p in places]) * words.factor
    filled = [p.outputs[output].significant for p in places]
    line = "-" if item.numeric else ""
    panel.errorbar(
        x, mean, half, color=colour, ls=line, lw=1.2, marker="o", ms=6, mfc="white", capsize=3, label=label
    )
    panel.plot(x[filled], mean[filled], ls="", marker="o", ms=6, color=colour, zorder=6)


def _positions(panel: Any, places: Sequence[Place], item: Covariate) -> Any:
    if item.numeric:
        panel.set_xlabel(item.shown.axis)
        return np.array([p.centre for p in places], float) * item.shown.factor
    panel.set_xticks(range(len(places)), [fitting(p.condition, 16) for p in places], fontsize=8)
    panel.set_xlim(-0.5, len(places) - 0.5)
    return np.arange(len(places), dtype=float)
