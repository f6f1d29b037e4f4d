"""Mark slow parameters of a test."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def slow_among(values: Iterable[Any], *slow: Any) -> list[Any]:
    """Return all values; the named ones run in the slow suite only, where the others represent them in the fast one.

    Raises:
        ValueError: a slow one is not among the values.
    """
    every = list(values)
    if unknown := [value for value in slow if value not in every]:
        raise ValueError(f"not among the parameters: {unknown}")
    return [pytest.param(value, marks=pytest.mark.slow) if value in slow else value for value in every]
