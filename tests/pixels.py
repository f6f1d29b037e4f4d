"""Pictures without pixels: in the fast suite those of other rooms than the pictures' own are laid out, not drawn."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from PIL import Image

# Rooms that look at pictures, and the marks of the fast suite.
ROOMS, FAST = ("report", "counts", "viewing"), "not slow"


@contextmanager
def as_needed(item: pytest.Item) -> Iterator[None]:
    """Empty pictures while a test runs that is not about them; all pictures are drawn where slow tests run too."""
    room = item.path.relative_to(item.config.rootpath).parts[1]
    if room in ROOMS or item.get_closest_marker("pixels") or item.config.option.markexpr != FAST:
        yield
        return
    from pliant.report.figures import rendering, style  # matplotlib takes a second to import

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "png", lambda figure: _empty())
        patch.setattr(
            rendering, "draw", lambda surface, camera, window, look: np.zeros((*window.shape, 4), "f4")
        )
        yield


def _empty() -> Any:
    """One white pixel as PNG bytes."""
    buffer = io.BytesIO()
    Image.new("RGB", (1, 1), "white").save(buffer, format="PNG")
    return np.frombuffer(buffer.getvalue(), dtype=np.uint8)
