"""Numbers of the studies in words."""

from __future__ import annotations

import math


def millimetres(value_m: float | None, digits: int = 2) -> str:
    """1.23 mm; a dash for none."""
    return "–" if value_m is None else f"{1e3 * value_m:.{digits}f} mm"


def percent(share: float | None, digits: int = 2) -> str:
    """1.2 %; a dash for none."""
    return "–" if share is None else f"{100 * share:.{digits}g} %"


def clock(wall_s: float | None) -> str:
    """A time of a suitable unit; a dash for none."""
    if wall_s is None:
        return "–"
    if wall_s < 120:
        return f"{wall_s:.1f} s"
    return f"{wall_s / 60:.1f} min" if wall_s < 7200 else f"{wall_s / 3600:.3g} h"


def number(value: float | None, digits: int = 3) -> str:
    """A plain number; a dash for none and for what is no number."""
    return "–" if value is None or math.isnan(value) else f"{value:.{digits}g}"
