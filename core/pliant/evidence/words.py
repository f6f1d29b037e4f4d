"""Names and units of what a bench measures, as people read them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

# Suffix of a name in SI → the unit that people read, and the factor from SI to it. Longest suffix first.
SHOWN = (
    ("_n_m", "mN·m", 1e3),
    ("_pa_s", "kPa/s", 1e-3),
    ("_rad", "°", 180 / math.pi),
    ("_strain", "%", 100.0),
    ("_travel_m", "mm", 1e3),
    ("_pa", "kPa", 1e-3),
    ("_kg", "g", 1e3),
    ("_n_s", "N/s", 1.0),
    ("_m_s", "mm/s", 1e3),
    ("_n", "N", 1.0),
    ("_m", "mm", 1e3),
    ("_c", "°C", 1.0),
    ("_s", "s", 1.0),
)
UNITS_SI = (("_rad", "rad"), ("_m", "m"), ("_strain", ""), ("_n", "N"), ("_pa", "Pa"))


@dataclass(frozen=True)
class Shown:
    """A name in words, and its display unit: value shown = SI value × factor."""

    label: str
    unit: str = ""
    factor: float = 1.0

    def text(self, value: float, digits: int = 3) -> str:
        """A value with its unit, e.g. ``15 kPa``."""
        return f"{number(value * self.factor, digits)}{'' if self.unit == '°' else ' '}{self.unit}".strip()

    @property
    def axis(self) -> str:
        """The label of an axis: ``tip x (mm)``."""
        return f"{self.label} ({self.unit})" if self.unit else self.label


def shown(name: str) -> Shown:
    """How a column or an output is shown: ``tip_x_m`` → "tip x" in mm."""
    for suffix, unit, factor in SHOWN:
        if name.endswith(suffix):
            stem = name.removesuffix(suffix)
            kept = "_travel" if suffix == "_travel_m" else ""
            return Shown(_words(stem + kept), unit, factor)
    return Shown(_words(name))


def si_unit(output: str) -> str:
    """The SI unit that an output's name ends with; empty for a pure number."""
    return next((unit for suffix, unit in UNITS_SI if output.endswith(suffix)), "")


def number(value: float, digits: int = 3) -> str:
    """A number with so many significant digits and no exponent where it can be helped; ``–`` for none."""
    if not math.isfinite(value):
        return "–"
    if value == 0 or 1e-4 <= abs(value) < 1e6:
        decimals = max(digits - 1 - math.floor(math.log10(abs(value))), 0) if value else 0
        text = f"{value:.{decimals}f}"
        text = text.rstrip("0").rstrip(".") if "." in text else text
    else:
        text = f"{value:.{digits - 1}e}"
    return text.replace("-", "−")


def percent(share: float) -> str:
    """A share in whole percent; "less than 1 %" where it would read as nothing."""
    if 0 < share < 0.01:
        return "less than 1 %"
    return f"{100 * share:.0f} %"


def listed(texts: list[str]) -> str:
    """The texts as an English list: ``a, b and c``."""
    return " and ".join(filter(None, (", ".join(texts[:-1]), *texts[-1:])))


def _words(stem: str) -> str:
    text = re.sub(r"_+", " ", stem).strip()
    return {"angle": "bend angle", "elongation": "elongation"}.get(text, text)
