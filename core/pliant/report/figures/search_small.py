"""Pictures of many thin lines or dots with few colours, at a fraction of the bytes."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from PIL import Image

from pliant.report.figures import style

COLOURS = 96
NEAR_PAPER = 240
HOUSE = (*style.SERIES, style.INK, style.SOFT, style.FAINT, style.PAPER)  # kept, however few pixels have them
PALE = (1.0, 0.66, 0.33)  # the same mixed with paper: the edges of lines and letters


def small_png(figure: Any) -> style.Png:
    """The figure as PNG bytes with a palette; the same figure gives the same bytes."""
    whole = Image.open(io.BytesIO(style.png(figure).tobytes())).convert("RGB")
    common = (whole.quantize(COLOURS, dither=Image.Dither.NONE).getpalette() or [])[: 3 * COLOURS]
    # PIL looks colours up roughly: without others beside it, paper stays white.
    bright = [min(common[k : k + 3]) > NEAR_PAPER for k in range(0, len(common), 3)]
    palette = Image.new("P", (1, 1))
    palette.putpalette([*(255 if bright[k // 3] else c for k, c in enumerate(common)), *_house()])
    buffer = io.BytesIO()
    whole.quantize(palette=palette, dither=Image.Dither.NONE).save(buffer, format="PNG", optimize=True)
    return np.frombuffer(buffer.getvalue(), dtype=np.uint8)


def _house() -> list[int]:
    """The house's colours and paler ones, as a palette's numbers."""
    mixed = [[1 - share * (1 - c) for c in to_rgb(name)] for name in HOUSE for share in PALE]
    return [round(255 * c) for colour in mixed for c in colour]
