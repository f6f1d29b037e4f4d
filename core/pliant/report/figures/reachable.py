"""The reachable set: places of the tip over the whole range of the inputs, its limits, the chain at some of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.inverse.reachable import Reachable
from pliant.records.design import Array
from pliant.report.figures import style
from pliant.report.figures.stills import upright_planes
from pliant.store.store import whole_file

TOP = (0, 1)
AT_LIMIT, WITHIN, NO_DATA = style.SERIES[1], style.SERIES[0], style.SOFT
POSES = 7  # chains that are drawn among the equilibria
NEAR_LIMIT = 1e-9  # of the range of an input


def reachable_picture(reachable: Reachable, bounds: Array, path: Path) -> None:
    """Draw the set into a .svg, .png or .pdf: views of the planes in which the tip moves, equal scales.

    Args:
        reachable: the set.
        bounds: (k, 2) low and high of each input.
        path: the file; it is there whole or not at all.
    """
    tips, limits = reachable.tips_m, reachable.limits_m
    shown = np.concatenate([reachable.markers_m.reshape(-1, 3), tips])
    planes = upright_planes(np.ptp(shown, axis=0))
    planes += [TOP] if len(planes) > 1 else []
    at_limit, has_data = is_at_limit(reachable, bounds), np.asarray(reachable.inside, bool)
    with style.canvas(640 * len(planes), 700, pad=(0.08, 0.1)) as figure:
        row = figure.subplots(1, len(planes), squeeze=False)[0]
        for axes, plane in zip(row, planes, strict=True):
            _draw_chains(axes, reachable, plane)
            for chosen, colour, look in (
                (~at_limit & has_data, WITHIN, {"alpha": 0.6}),
                (at_limit & has_data, AT_LIMIT, {}),
                (~has_data, NO_DATA, {"mfc": "none"}),
            ):
                axes.plot(
                    *style.flat(tips[chosen], plane), ".", ms=4.5, color=colour, mew=0.6, zorder=3, **look
                )
            low, high = 1e3 * limits[plane, 0], 1e3 * limits[plane, 1]
            box = np.array(
                [[low[0], high[0], high[0], low[0], low[0]], [low[1], low[1], high[1], high[1], low[1]]]
            )
            axes.plot(*box, color=style.SOFT, lw=0.8, ls=":", zorder=2)
            axes.set_aspect("equal", adjustable="datalim")
            axes.margins(0.06)
            style.world_labels(axes, plane)
            spans = ", ".join(
                f"{'xyz'[k]} {a:.1f} to {b:.1f}" for k, a, b in zip(plane, low, high, strict=True)
            )
            style.heading(axes, f"Tip in {' and '.join('xyz'[k] for k in plane)}", f"limits {spans} mm")
        entries = [style.entry("inputs within their range", ".", color=WITHIN)]
        entries.append(style.entry("an input at its limit", ".", color=AT_LIMIT))
        if not has_data.all():
            entries.append(style.entry("beyond the data of a law", ".", color=NO_DATA, mfc="none"))
        style.key_below(figure, entries)
        with whole_file(path) as partial:
            figure.savefig(partial, format=path.suffix[1:].lower(), dpi=style.DPI)


def is_at_limit(reachable: Reachable, bounds: Array) -> NDArray[np.bool_]:
    """(s,) whether any input stands at the low or high end of its range."""
    shares = (reachable.actuation - bounds[:, 0]) / np.ptp(bounds, axis=1)
    return np.asarray(np.any((shares < NEAR_LIMIT) | (shares > 1.0 - NEAR_LIMIT), axis=1))


def _draw_chains(axes: Any, reachable: Reachable, plane: tuple[int, int]) -> None:
    """Some chains of the set, evenly through it, and the base."""
    chosen = np.linspace(0, len(reachable.actuation) - 1, POSES).round().astype(int)
    for markers in reachable.markers_m[chosen]:
        axes.plot(*style.flat(markers, plane), color=style.FAINT, lw=1.4, zorder=1)
    axes.plot(*style.flat(reachable.markers_m[0, :1], plane), "s", ms=6, color=style.INK, zorder=4)
