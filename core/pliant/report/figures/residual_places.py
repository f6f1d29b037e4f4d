"""The residual against each covariate: readings, mean per bin with its 95 % interval, significant bins filled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pliant.evidence.covariates import Covariate
from pliant.evidence.places import Place
from pliant.formatting import NamedUnit, unit_of, whole_percent
from pliant.report.comparison_view import Compared, fitting, grid, hide_rest, thin
from pliant.report.figures import style

COLUMNS = 3
MOST = 12
POINTS = 1500
LOUD = 0.05  # a circumstance that tells so much of the error has its title in colour


def residual_places(compared: Compared, output: str) -> style.Png | None:
    """One panel per covariate, those that tell most of the error first; None where nothing varies."""
    items = _in_order(compared)
    if not items:
        return None
    rows, columns = grid(len(items), COLUMNS)
    words = unit_of(output)
    with style.canvas(max(600 * columns, 900), 430 * rows + 90) as figure:
        axes = figure.subplots(rows, columns, squeeze=False)
        limits = _limits(compared, output, words)
        for k, item in enumerate(items):
            panel = axes.flat[k]
            _panel(panel, compared, item, output, words)
            panel.set_ylim(*limits)
            if k % columns == 0:
                panel.set_ylabel(f"measured − model ({words.symbol})" if words.symbol else "measured − model")
            else:
                panel.tick_params(labelleft=False)
        hide_rest(list(axes.flat[len(items) :]))
        _legend(figure)
        figure.set_layout_engine("constrained", w_pad=0.06, h_pad=0.06)
        return style.png(figure)


def _in_order(compared: Compared) -> list[Covariate]:
    tells = compared.comparison.depends_on
    return sorted(compared.covariates.items, key=lambda item: -tells.get(item.name, 0.0))[:MOST]


def _panel(panel: Any, compared: Compared, item: Covariate, output: str, words: NamedUnit) -> None:
    places = [p for p in compared.comparison.places if p.covariate == item.name and output in p.outputs]
    told = compared.comparison.depends_on.get(item.name, 0.0)
    real = any(p.outputs[output].significant for p in places)
    loud = real and told >= LOUD
    title = fitting(f"{item.shown.label}: {f'tells {whole_percent(told)}' if real else 'noise'}", 46)
    panel.set_title(title, fontsize=9.5, color=style.WARN if loud else style.INK)
    if item.numeric:
        places = [p for p in places if np.isfinite(p.centre)]
        x = np.array([p.centre for p in places]) * item.shown.factor
        panel.set_xlabel(item.shown.axis)
        values = np.concatenate(item.values) * item.shown.factor
    else:
        x = np.arange(len(places), dtype=float)
        panel.set_xticks(x, [_short(p.condition, item) for p in places])
        panel.set_xlim(-0.6, len(places) - 0.4)
        at = {p.condition: k for k, p in enumerate(places)}
        values = _category_places(item, at)
    _readings(panel, compared, values, output, words, item.numeric)
    panel.axhline(0, color=style.SERIES[0], lw=1.2, zorder=2)
    _means(panel, x, places, output, words)


def _readings(
    panel: Any, compared: Compared, values: Any, output: str, words: NamedUnit, numeric: bool
) -> None:
    residual = np.concatenate([run[output] for run in compared.residuals]) * words.factor
    there = np.flatnonzero(np.isfinite(values) & np.isfinite(residual))
    pick = there[thin(len(there), POINTS)]
    spread = 0.0 if numeric else np.random.default_rng(0).uniform(-0.28, 0.28, len(pick))
    panel.plot(
        values[pick] + spread, residual[pick], ls="", marker=".", ms=2.2, color=style.FAINT, zorder=1, mew=0
    )


def _means(panel: Any, x: Any, places: Sequence[Place], output: str, words: NamedUnit) -> None:
    entries = [place.outputs[output] for place in places]
    mean = np.array([e.mean for e in entries]) * words.factor
    low, high = np.array([e.interval for e in entries]).reshape(-1, 2).T * words.factor
    for k, entry in enumerate(entries):
        colour = style.WARN if entry.significant else style.INK
        panel.errorbar(
            x[k], mean[k], [[mean[k] - low[k]], [high[k] - mean[k]]], color=colour, marker="o", ms=6.5,
            mfc=colour if entry.significant else "white", capsize=3, lw=1.4, zorder=5,
        )  # fmt: skip
    if np.isfinite(places[0].centre if places else np.nan):
        panel.plot(x, mean, color=style.INK, lw=0.8, alpha=0.5, zorder=3)


def _legend(figure: Any) -> None:
    from matplotlib.lines import Line2D

    entries = [
        Line2D([], [], ls="", marker=".", color=style.FAINT, label="readings"),
        Line2D([], [], marker="o", mfc="white", color=style.INK, label="mean in a bin, 95 % under noise"),
        Line2D([], [], marker="o", color=style.WARN, label="more than noise"),
    ]
    figure.legend(handles=entries, loc="outside upper right", ncols=3)


def _category_places(item: Covariate, at: dict[str, int]) -> Any:
    names = [*item.categories, item.rest]
    codes = np.concatenate(item.values)
    codes = np.where(np.isfinite(codes), codes, len(names) - 1).astype(int)
    return np.array([float(at.get(name, -1)) if name in at else np.nan for name in names])[codes]


def _short(condition: str, item: Covariate) -> str:
    """A category without the words that all share: "falling pressure" → "falling"."""
    for common in ("specimen ", "tip force toward ", "moment that "):
        condition = condition.removeprefix(common)
    return condition.split()[0] if item.name == "direction" else fitting(condition, 14)


def _limits(compared: Compared, output: str, words: NamedUnit) -> tuple[float, float]:
    residual = np.concatenate([run[output] for run in compared.residuals]) * words.factor
    residual = residual[np.isfinite(residual)]
    low, high = np.quantile(residual, [0.003, 0.997]) if len(residual) else (0.0, 0.0)
    low, high = min(low, 0.0), max(high, 0.0)
    margin = 0.08 * max(high - low, 1e-12)
    return float(low - margin), float(high + margin)
