"""Colours of charts: the palette, colours of levels and errors, and scales that colour values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pliant.records.design import Array

INK, SOFT, FAINT, PAPER, GRID = "#1d2433", "#5c6577", "#c9ced8", "#ffffff", "#e6e9ef"
# Okabe and Ito's palette, distinguishable with every common colour blindness.
SERIES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
WARN = "#D55E00"
MARKERS = ("o", "s", "D", "^", "v", "P")
# Colours of levels and errors, dark enough everywhere to be visible on paper.
LEVEL_COLOURS = (  # dark to green: viridis without yellow, which is unreadable on white
    "#440154", "#482173", "#423f85", "#375a8c", "#2d718e", "#24878e", "#1f9e89", "#2eb37c", "#58c765",
)  # fmt: skip
ERROR_COLOURS = ("#f7ecc8", "#f2b563", "#dd6a4c", "#98305f", "#3b1150")  # pale at zero
SIGNED_COLOURS = (
    "#053061", "#2a71b2", "#6bacd1", "#c2ddec", "#f7f6f6", "#fbccb4", "#e48066", "#ba2832", "#67001f",
)  # fmt: skip


@dataclass(frozen=True)
class ColourScale:
    """Colours of values: `colours` as #rrggbb at the values `at`, between them interpolated, on logarithms if `log`."""

    label: str
    unit: str
    at: tuple[float, ...]
    colours: tuple[str, ...]
    log: bool = False

    @staticmethod
    def even(
        label: str, unit: str, ends: tuple[float, float], colours: Sequence[str], log: bool = False
    ) -> ColourScale:
        """Return the scale with its colours at even distances between two values; equal ends are moved apart."""
        low, high = ends if ends[1] > ends[0] else (ends[0], ends[0] + (abs(ends[0]) or 1.0))
        at = (np.geomspace if log else np.linspace)(low, high, len(colours))
        return ColourScale(label, unit, tuple(at.tolist()), tuple(colours), log)

    @staticmethod
    def decades(label: str, unit: str, ends: tuple[float, float], colours: Sequence[str]) -> ColourScale:
        """Return a logarithmic scale over whole decades, at least one, around positive values."""
        first, last = 10.0 ** np.floor(np.log10(ends[0])), 10.0 ** np.ceil(np.log10(ends[1]))
        return ColourScale.even(label, unit, (float(first), float(max(last, 10 * first))), colours, log=True)

    def to_hex(self, values: Array) -> list[str]:
        """Return the colour of each value as #rrggbb."""
        warp = np.log if self.log else np.asarray
        place = np.interp(np.asarray(warp(values)), np.asarray(warp(self.at)), np.arange(len(self.at)))
        parts = np.array([[int(c[k : k + 2], 16) for k in (1, 3, 5)] for c in self.colours], float)
        mixed = [np.interp(place, np.arange(len(parts)), part) for part in parts.T]
        return [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in np.rint(mixed).astype(int).T.tolist()]
