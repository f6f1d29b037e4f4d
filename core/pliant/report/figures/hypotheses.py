"""Hypotheses of a diagnosis: how probable each is, and how far above the noise it leaves the error."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.diagnosis.verdict import NOTHING, UNKNOWN, Kinds, named
from pliant.report.diagnosis_view import Diagnosed
from pliant.report.figures import style
from pliant.report.fitted import probability_text

FIRST, OTHER = style.SERIES[0], "#9fb3c8"
WIDE = 36  # characters of a name on one line


def hypotheses(diagnosed: Diagnosed) -> style.Png:
    """Bars of probability; beside them the left-out error as dots, and the noise floor as a line, if it is known."""
    shown = diagnosed.hypotheses()
    credible = set(diagnosed.found.judgement.credible)
    colours = [FIRST if kinds in credible else OTHER for kinds in shown]
    with style.canvas(1500, 66 * len(shown) + 190) as figure:
        known = any(np.isfinite(diagnosed.left_out_error(kinds)) for kinds in shown)
        panels = figure.subplots(1, 2 if known else 1, sharey=True, squeeze=False)[0]
        left = panels[0]
        _probabilities(left, diagnosed, shown, colours)
        if known:
            _errors(panels[1], diagnosed, shown, colours)
        left.set_yticks(range(len(shown)), [_name(kinds) for kinds in shown])
        left.set_ylim(len(shown) - 0.4, -0.95)
        for panel in panels:
            panel.grid(axis="y", visible=False)
            panel.tick_params(axis="y", length=0)
        figure.set_layout_engine("constrained", w_pad=0.08, h_pad=0.05)
        return style.png(figure)


def _name(kinds: Kinds) -> str:
    if kinds == NOTHING:
        return "nothing missing (model as it is)"
    text = named(kinds)
    if len(text) <= WIDE:
        return text
    middle = (len(kinds) + 1) // 2
    return f"{named(kinds[:middle])} +\n{named(kinds[middle:])}"


def _probabilities(panel: Any, diagnosed: Diagnosed, shown: list[Kinds], colours: list[str]) -> None:
    values = [100 * diagnosed.found.judgement.probability.get(kinds, 0.0) for kinds in shown]
    panel.barh(range(len(shown)), values, color=colours, height=0.62)
    for row, value in enumerate(values):
        text = probability_text(value / 100) if value >= 0.05 else "0 %"
        panel.annotate(text, (value, row), (4, 0), textcoords="offset points", va="center", fontsize=8.5)
    panel.set_xlim(0, 118)
    panel.set_xticks([0, 25, 50, 75, 100])
    panel.set_xlabel("probability (%)")
    panel.set_title("How probable, given these data")


def _errors(panel: Any, diagnosed: Diagnosed, shown: list[Kinds], colours: list[str]) -> None:
    values = np.array([diagnosed.left_out_error(kinds) for kinds in shown])
    panel.axvline(1.0, color=style.WARN, lw=1.6)
    panel.annotate(
        "noise floor", (1.0, 1.0), (3, -3), xycoords=("data", "axes fraction"), textcoords="offset points",
        color=style.WARN, fontsize=8.5, va="top",
    )  # fmt: skip
    top = float(np.nanmax([*values[np.isfinite(values)], 1.0]))
    for row, (kinds, value) in enumerate(zip(shown, values, strict=True)):
        if np.isfinite(value):
            panel.plot([0, value], [row, row], color=style.FAINT, lw=1.2, zorder=1)
            panel.plot([value], [row], ls="", marker="o", ms=8, color=colours[row])
            panel.annotate(
                f"{value:.2f}", (value, row), (8, 0), textcoords="offset points", va="center", fontsize=8.5
            )
        else:
            text = "any form: reaches the floor" if kinds == UNKNOWN else "not known"
            panel.annotate(
                text,
                (1.0, row),
                (8, 0),
                textcoords="offset points",
                va="center",
                fontsize=8.5,
                color=style.SOFT,
            )
    panel.set_xlim(0, 1.2 * max(top, 1.6))
    panel.set_xlabel("rms error on runs left out of the fit, in noise floors")
    panel.set_title("How much error it leaves")
