"""Whether error bars of unseen designs hold, level by level, inside the range and on its border."""

from __future__ import annotations

import numpy as np

from pliant.report.figures import style
from pliant.report.meta_reading import MetaFitted

LOOKS = {"all": (style.INK, "o"), "interior": (style.SERIES[0], "D"), "border": (style.SERIES[1], "s")}
LOW, HIGH = 0.85, 0.95  # of the 90 % band: what this project asks of itself


def design_bars(fitted: MetaFitted) -> style.Png:
    """Stated against covered, one line for each place."""
    with style.canvas(1000, 640) as figure:
        figure.set_layout_engine("constrained", w_pad=0.09, h_pad=0.09)
        axes = figure.subplots()
        axes.plot([45, 100], [45, 100], color=style.SOFT, lw=1.1, zorder=1, label="as stated")
        lowest = 45.0
        for place, found in fitted.coverage.items():
            levels = np.array([float(level) for level in found])
            covered = 100 * np.array(list(found.values()))
            colour, marker = LOOKS.get(place, (style.SERIES[2], "v"))
            axes.plot(100 * levels, covered, marker=marker, color=colour, ms=7, label=place, zorder=3)
            lowest = min(lowest, float(covered.min()) - 5)
        axes.errorbar(
            [90], [90], [[90 - 100 * LOW], [100 * HIGH - 90]], color=style.SERIES[2], capsize=5, lw=1.6, zorder=2,
            label="wanted of the 90 % band: 85 to 95 %",
        )  # fmt: skip
        axes.set_ylim(lowest, 103)
        axes.set_xlim(45, 101)
        axes.set_xlabel("stated level of the band (%)")
        axes.set_ylabel("states of designs left out inside it (%)")
        axes.set_title("What the bars of unseen designs hold")
        axes.legend(loc="lower right")
        return style.png(figure)
