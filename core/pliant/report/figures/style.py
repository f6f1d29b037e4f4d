"""The common style of all pictures: fonts, colours, sizes; figures as PNG bytes that depend only on their content."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import LogFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray
from PIL import Image

from pliant.formatting import number
from pliant.report.chart_colours import FAINT, GRID, INK, PAPER, SERIES, SOFT
from pliant.user_text import escape_controls

Png = NDArray[np.uint8]

DPI = 150

RC: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 8,
    "axes.labelsize": 9.5,
    "axes.labelcolor": INK,
    "axes.edgecolor": SOFT,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "text.color": INK,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.6,
    "figure.facecolor": PAPER,
    "axes.unicode_minus": True,
    "svg.hashsalt": "pliant",
    "text.parse_math": False,  # names from users may contain dollars
}


@contextmanager
def canvas(
    width_px: float, height_px: float, pad: tuple[float, float] | None = (0.09, 0.09), wspace: float = 0.02
) -> Iterator[Any]:
    """Yield a figure of this size in the common style; the style applies only inside the block.

    Panels keep distances `pad` (inches) and `wspace` (a share of their width); without a pad positions are set by hand.
    """
    with matplotlib.rc_context(RC):
        figure = Figure(figsize=(width_px / DPI, height_px / DPI), dpi=DPI)
        if pad is not None:
            figure.set_layout_engine("constrained", w_pad=pad[0], h_pad=pad[1], wspace=wspace)
        FigureCanvasAgg(figure)
        yield figure


def png(figure: Figure) -> Png:
    """Return the figure as PNG bytes, without date or software version."""
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        if isinstance(axis.get_major_formatter(), LogFormatter):  # matplotlib's own labels, which need math
            log_labels(axis)
    for text in figure.findobj(Text):
        if (shown := escape_controls(text.get_text())) != text.get_text():
            text.set_text(shown)
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings(
            "ignore", "Glyph .* missing from font"
        )  # names may have letters of any script
        figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    return np.frombuffer(buffer.getvalue(), dtype=np.uint8)


def stretch_map() -> Colormap:
    """Return the colours of the surface stretch on a shaded body: pale where the rubber is at rest."""
    return LinearSegmentedColormap.from_list(
        "stretch", ["#f2ead9", "#f5cf9a", "#f09a5e", "#d65a5b", "#9b2f70", "#5a1a6b"]
    )


def stress_map() -> Colormap:
    """Return the colours of a stress on a shaded body: pale where it is zero."""
    return LinearSegmentedColormap.from_list(
        "stress", ["#eef3f4", "#b9dcd8", "#74b9c4", "#3f8fb5", "#2f5f9e", "#2b2d6e"]
    )


def colour_bar(
    figure: Figure, mapped: tuple[Normalize, Colormap] | ScalarMappable, label: str, **place: Any
) -> Axes:
    """Draw a bar of colours with its label; `place` has the position arguments of matplotlib's `colorbar`."""
    shown = ScalarMappable(*mapped) if isinstance(mapped, tuple) else mapped
    bar = figure.colorbar(shown, **place)
    bar.set_label(label)
    bar.outline.set_visible(False)
    return bar.ax


def note(axes: Any, text: str, at: Any, shift: tuple[float, float] = (0, 0), **look: Any) -> None:
    """Write text `shift` points from a point in data coordinates."""
    axes.annotate(text, at, shift, **{"textcoords": "offset points", "fontsize": 8.5, **look})


def heading(axes: Any, title: str, below: str, size: float = 7.5) -> None:
    """Write a panel's title, and a line of small print between it and the panel."""
    axes.set_title(f"{title}\n", fontsize=9.5, pad=2)
    note(axes, below, (0, 1), (0, 3), xycoords="axes fraction", fontsize=size, color=SOFT)


def bare(axes: Any) -> None:
    """Remove frame, ticks and grid of an axis, and set equal scales."""
    axes.set_axis_off()
    axes.set_aspect("equal")


def log_labels(axis: Any) -> None:
    """Set numbers of one digit on a log axis: at decades, and at 2 and 5 between them if there are few decades."""
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 500 * low else (1.0,), numticks=12))
    axis.set_minor_formatter(NullFormatter())
    axis.set_major_formatter(lambda value, _: number(float(value), 1))


def scale_bar(axes: Any, x: float, y: float, length: float, label: str) -> None:
    """Draw a bar of this length in data units, with its label above the middle."""
    axes.plot([x, x + length], [y, y], color=INK, lw=2.2, solid_capstyle="butt", zorder=10)
    axes.annotate(
        label, (x + length / 2, y), (0, 3), textcoords="offset points", ha="center", va="bottom", fontsize=8.5
    )


def round_length(target: float) -> float:
    """Return the largest of 1, 2, 5 × 10ⁿ that is not above `target`."""
    power = 10.0 ** np.floor(np.log10(target))
    return float(max(f * power for f in (1.0, 2.0, 5.0) if f * power <= target * (1 + 1e-9)))


COLOURS = 96
NEAR_PAPER = 240
HOUSE = (*SERIES, INK, SOFT, FAINT, PAPER)  # kept, however few pixels have them
PALE = (1.0, 0.66, 0.33)  # the same mixed with white: the edges of lines and letters


def small_png(figure: Any) -> Png:
    """Return a figure of many thin lines or dots as PNG bytes with a palette, a fraction of the size."""
    whole = Image.open(io.BytesIO(png(figure).tobytes())).convert("RGB")
    common = (whole.quantize(COLOURS, dither=Image.Dither.NONE).getpalette() or [])[: 3 * COLOURS]
    # PIL matches colours coarsely: without neighbouring colours in the palette, white stays white.
    bright = [min(common[k : k + 3]) > NEAR_PAPER for k in range(0, len(common), 3)]
    palette = Image.new("P", (1, 1))
    mixed = [[1 - share * (1 - c) for c in to_rgb(name)] for name in HOUSE for share in PALE]
    own = [round(255 * c) for colour in mixed for c in colour]
    palette.putpalette([*(255 if bright[k // 3] else c for k, c in enumerate(common)), *own])
    buffer = io.BytesIO()
    whole.quantize(palette=palette, dither=Image.Dither.NONE).save(buffer, format="PNG", optimize=True)
    return np.frombuffer(buffer.getvalue(), dtype=np.uint8)
