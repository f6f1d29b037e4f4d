"""One look for all pictures: fonts, colours, sizes; figures as PNG bytes that depend on their content only."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LinearSegmentedColormap, LogNorm, Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import LogFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray
from PIL import Image

from pliant.formatting import Unit, number
from pliant.user_text import visible

Png = NDArray[np.uint8]

DPI = 150
INK, SOFT, FAINT, PAPER = "#1d2433", "#5c6577", "#c9ced8", "#ffffff"
# Okabe and Ito's palette: told apart with every common colour blindness.
SERIES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
WARN = "#D55E00"

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
    "grid.color": "#e6e9ef",
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
    "text.parse_math": False,  # names that users gave may hold dollars; see `with_math`
}


@contextmanager
def canvas(
    width_px: float, height_px: float, pad: tuple[float, float] | None = (0.09, 0.09), wspace: float = 0.02
) -> Iterator[Any]:
    """A figure of this size in the house style; the style holds inside the block only.

    Panels keep `pad` apart (inches) and `wspace` (a share of their width); places are given by hand without a pad.
    """
    with matplotlib.rc_context(RC):
        figure = Figure(figsize=(width_px / DPI, height_px / DPI), dpi=DPI)
        if pad is not None:
            figure.set_layout_engine("constrained", w_pad=pad[0], h_pad=pad[1], wspace=wspace)
        FigureCanvasAgg(figure)
        yield figure


def png(figure: Figure) -> Png:
    """The figure as PNG bytes, without date or software version."""
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        if isinstance(axis.get_major_formatter(), LogFormatter):  # matplotlib's own, which needs math
            log_labels(axis)
    for text in figure.findobj(Text):
        if (shown := visible(text.get_text())) != text.get_text():
            text.set_text(shown)
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings(
            "ignore", "Glyph .* missing from font"
        )  # names may have letters of any script
        figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    return np.frombuffer(buffer.getvalue(), dtype=np.uint8)


def pressure_map() -> Colormap:
    """Colours of actuation levels: dark to green; yellow, unreadable on white, is left out."""
    part = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.74, 128))
    return LinearSegmentedColormap.from_list("viridis-part", part)


def stretch_map() -> Colormap:
    """Colours of the surface stretch on a shaded body: pale where the rubber is at rest."""
    return LinearSegmentedColormap.from_list(
        "stretch", ["#f2ead9", "#f5cf9a", "#f09a5e", "#d65a5b", "#9b2f70", "#5a1a6b"]
    )


def stress_map() -> Colormap:
    """Colours of a stress on a shaded body: pale where there is none."""
    return LinearSegmentedColormap.from_list(
        "stress", ["#eef3f4", "#b9dcd8", "#74b9c4", "#3f8fb5", "#2f5f9e", "#2b2d6e"]
    )


def error_map() -> Colormap:
    """Colours of errors, pale where there are none; dark enough everywhere to be seen on paper."""
    return LinearSegmentedColormap.from_list("error", ["#f7ecc8", "#f2b563", "#dd6a4c", "#98305f", "#3b1150"])


def decades(low: float, high: float) -> LogNorm:
    """Whole decades, at least one, around positive values from `low` to `high`; colours end where they end."""
    first, last = 10.0 ** np.floor(np.log10(low)), 10.0 ** np.ceil(np.log10(high))
    return LogNorm(first, max(last, 10 * first), clip=True)


def entry(label: str, marker: str, **look: Any) -> Line2D:
    """A marker of a legend."""
    return Line2D([], [], ls="", marker=marker, label=label, **look)


def key_below(figure: Figure, handles: Sequence[Any], **look: Any) -> None:
    """A legend in one row below all panels."""
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), handletextpad=0.3, **look)


def colour_bar(
    figure: Figure, mapped: tuple[Normalize, Colormap] | ScalarMappable, label: str, **place: Any
) -> Axes:
    """A bar of colours with its label; `place` says where, as matplotlib's `colorbar` takes it."""
    shown = ScalarMappable(*mapped) if isinstance(mapped, tuple) else mapped
    bar = figure.colorbar(shown, **place)
    bar.set_label(label)
    bar.outline.set_visible(False)
    return bar.ax


def note(axes: Any, text: str, at: Any, shift: tuple[float, float] = (0, 0), **look: Any) -> None:
    """Words `shift` points from a place in the data."""
    axes.annotate(text, at, shift, **{"textcoords": "offset points", "fontsize": 8.5, **look})


def heading(axes: Any, title: str, below: str, size: float = 7.5) -> None:
    """A panel's title, and a line of small print between it and the panel."""
    axes.set_title(f"{title}\n", fontsize=9.5, pad=2)
    note(axes, below, (0, 1), (0, 3), xycoords="axes fraction", fontsize=size, color=SOFT)


def legend_above(figure: Figure, axes: Any, side: str = "right") -> None:
    """The legend of one or several panels in a row above all panels, each label once."""
    found = [one.get_legend_handles_labels() for one in np.atleast_1d(axes)]
    entries = {
        label: handle for handles, labels in found for handle, label in zip(handles, labels, strict=True)
    }
    figure.legend(entries.values(), entries.keys(), loc=f"outside upper {side}", ncols=len(entries))


def one_height(axes: Sequence[Any]) -> None:
    """The same limits of y for all panels."""
    limits = [one.get_ylim() for one in axes]
    for one in axes:
        one.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))


OUTER, FAR_OUT = 0.05, 4.0


def robust_ends(values: NDArray[np.float64]) -> tuple[float, float] | None:
    """Ends of an axis where a few values are so far out that they would squeeze all others; None where none are.

    Far out: the whole range is more than `FAR_OUT` times that without `OUTER` of the values at each end.
    """
    if not len(values):
        return None
    low, high = (float(end) for end in np.quantile(values, [OUTER, 1 - OUTER]))
    first, last, span = float(values.min()), float(values.max()), high - low
    if not 0 < FAR_OUT * span < last - first:
        return None
    return max(first, low - 0.25 * span), min(last, high + 0.25 * span)


def cut_at(axes: Any, ends: tuple[float, float], values: NDArray[np.float64]) -> None:
    """Cut an axis of x at these ends, and write at an end how many values lie beyond and how far they go."""
    margin = 0.04 * (ends[1] - ends[0])
    axes.set_xlim(ends[0] - margin, ends[1] + margin)
    below, above = values[values < ends[0]], values[values > ends[1]]
    if len(below):
        text = f"◂ {len(below)} beyond, to {number(float(below.min()), 3)}"
        note(axes, text, (0, 1), (2, -9), xycoords="axes fraction", fontsize=7.5, color=SOFT)
    if len(above):
        text = f"{len(above)} beyond, to {number(float(above.max()), 3)} ▸"
        look = {"xycoords": "axes fraction", "fontsize": 7.5, "color": SOFT, "ha": "right"}
        note(axes, text, (1, 1), (-2, -9), **look)


def panels(figure: Figure, count: int, columns: int, **shared: Any) -> list[Any]:
    """So many panels in rows of at most `columns`; places that are left stay empty."""
    columns = min(columns, count)
    grid = figure.subplots(-(-count // columns), columns, squeeze=False, **shared).ravel()
    for rest in grid[count:]:
        rest.set_axis_off()
    return list(grid[:count])


def with_math(axes: Any) -> None:
    """Let the labels of the axes have symbols between dollars; they are ours, no names of users."""
    for label in (axes.xaxis.label, axes.yaxis.label):
        label.set_parse_math(True)


def with_unit(label: str, unit: Unit) -> str:
    """An axis label: ``error (mm)``."""
    return f"{label} ({unit.symbol})" if unit.symbol else label


def flat(points: Any, plane: tuple[int, int]) -> Any:
    """(2, n) coordinates in a world plane, mm, of points (n, 3) in m."""
    return 1e3 * points[:, plane[0]], 1e3 * points[:, plane[1]]


def world_labels(axes: Any, plane: tuple[int, int]) -> None:
    """The labels of a view onto a world plane."""
    axes.set(xlabel=f"world {'xyz'[plane[0]]} (mm)", ylabel=f"world {'xyz'[plane[1]]} (mm)")


def bare(axes: Any) -> None:
    """An axis without frame, ticks and grid, with equal scales."""
    axes.set_axis_off()
    axes.set_aspect("equal")


def log_labels(axis: Any) -> None:
    """Numbers of one digit on a log axis: at decades, and at 2 and 5 between them where there are few decades."""
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 500 * low else (1.0,), numticks=12))
    axis.set_minor_formatter(NullFormatter())
    axis.set_major_formatter(lambda value, _: number(float(value), 1))


def scale_bar(axes: Any, x: float, y: float, length: float, label: str) -> None:
    """A bar of this length in data units, with its label above the middle."""
    axes.plot([x, x + length], [y, y], color=INK, lw=2.2, solid_capstyle="butt", zorder=10)
    axes.annotate(
        label, (x + length / 2, y), (0, 3), textcoords="offset points", ha="center", va="bottom", fontsize=8.5
    )


def round_length(target: float) -> float:
    """The largest of 1, 2, 5 × 10ⁿ that is not above `target`."""
    power = 10.0 ** np.floor(np.log10(target))
    return float(max(f * power for f in (1.0, 2.0, 5.0) if f * power <= target * (1 + 1e-9)))


COLOURS = 96
NEAR_PAPER = 240
HOUSE = (*SERIES, INK, SOFT, FAINT, PAPER)  # kept, however few pixels have them
PALE = (1.0, 0.66, 0.33)  # the same mixed with paper: the edges of lines and letters


def small_png(figure: Any) -> Png:
    """The figure of many thin lines or dots as PNG bytes with a palette, a fraction of the bytes."""
    whole = Image.open(io.BytesIO(png(figure).tobytes())).convert("RGB")
    common = (whole.quantize(COLOURS, dither=Image.Dither.NONE).getpalette() or [])[: 3 * COLOURS]
    # PIL looks colours up roughly: without others beside it, paper stays white.
    bright = [min(common[k : k + 3]) > NEAR_PAPER for k in range(0, len(common), 3)]
    palette = Image.new("P", (1, 1))
    mixed = [[1 - share * (1 - c) for c in to_rgb(name)] for name in HOUSE for share in PALE]
    own = [round(255 * c) for colour in mixed for c in colour]
    palette.putpalette([*(255 if bright[k // 3] else c for k, c in enumerate(common)), *own])
    buffer = io.BytesIO()
    whole.quantize(palette=palette, dither=Image.Dither.NONE).save(buffer, format="PNG", optimize=True)
    return np.frombuffer(buffer.getvalue(), dtype=np.uint8)
