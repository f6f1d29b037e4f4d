"""What effects on angle sensors share: which readings are angles, and which of them are recorded over time."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np

from pliant.interfaces.effect import Readings

READING = re.compile(r"((bend|tip|joint_\d+)_)?angle(_[yz])?_rad|joint_angles_rad")


def with_angles(readings: Readings, change: Callable[[Any], Any]) -> Readings:
    """Return the readings with every angle changed; a number stays a number, a list a list, an array an array."""

    def changed(value: Any) -> Any:
        return [changed(item) for item in value] if isinstance(value, list | tuple) else change(value)

    return {name: changed(value) if READING.fullmatch(name) else value for name, value in readings.items()}


def with_recorded_angles(readings: Readings, change: Callable[[Any], Any]) -> Readings:
    """Return the readings with every angle changed that is an array over the samples of a run, (t,)."""
    return {
        name: change(value)
        if READING.fullmatch(name) and isinstance(value, np.ndarray) and value.ndim == 1
        else value
        for name, value in readings.items()
    }
