"""Pictures without pixels: in the fast suite only the tests of the pictures draw them, others lay them out."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from PIL import Image

# Folders of tests that inspect pictures, and the marks of the fast suite.
ROOMS, FAST = ("report", "pliant_counts", "pliant_view"), "not slow"


@contextmanager
def as_needed(item: pytest.Item) -> Iterator[None]:
    """Replace pictures by empty ones in tests that do not inspect them; where slow tests run too, draw all."""
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
    """Return one white pixel as PNG bytes."""
    buffer = io.BytesIO()
    Image.new("RGB", (1, 1), "white").save(buffer, format="PNG")
    return np.frombuffer(buffer.getvalue(), dtype=np.uint8)
