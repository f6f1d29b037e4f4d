"""Places of classes and functions in manifests, "package.module:name", which are imported on demand."""

from __future__ import annotations

import importlib
import re
from typing import Any

PLACE = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*")


def is_place(text: Any) -> bool:
    """Return whether a value is written as a place."""
    return isinstance(text, str) and PLACE.fullmatch(text) is not None


def imported(place: str) -> Any:
    """Return the object at a place."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)
