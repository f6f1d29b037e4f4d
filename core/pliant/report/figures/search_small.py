"""Pictures of many thin lines or dots with few colours, at a fraction of the bytes."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from PIL import Image

from pliant.report.figures import style

COLOURS = 64


def small_png(figure: Any) -> style.Png:
    """The figure as PNG bytes with a palette; the same figure gives the same bytes."""
    whole = Image.open(io.BytesIO(style.png(figure).tobytes())).convert("RGB")
    buffer = io.BytesIO()
    whole.quantize(COLOURS, dither=Image.Dither.NONE).save(buffer, format="PNG", optimize=True)
    return np.frombuffer(buffer.getvalue(), dtype=np.uint8)
