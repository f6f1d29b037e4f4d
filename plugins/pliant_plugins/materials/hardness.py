"""Young's modulus from a Shore hardness: an indenter of known shape under a spring of known force.

    A:   E = 0.0981 (56 + 7.62336 S) / (0.137505 (254 − 2.54 S)) MPa
    00:  E = 9 F / (16 √R d^1.5),  F = (0.203 + 0.00908 S) N,  d = 2.5 (1 − S/100) mm,  R = 1.19 mm

A is a truncated cone taken for a flat punch, 00 a sphere (Hertz, ν = ½) with the sizes of ASTM D2240. Shear moduli of
the rubbers in `named.yaml` lie between the factors `SCATTER` of it; pull tests of soft silicones are the low ones.
Sources: Gent, Rubber Chem. Technol. 31 (1958) 896; ASTM D2240; Johnson, Contact Mechanics (1985), §4.2.
"""

from __future__ import annotations

import re

SCATTER = (0.24, 2.1)
LIMITS = {"A": (10.0, 90.0), "00": (5.0, 80.0)}
FORMS = (
    (re.compile(r"(\d+(?:\.\d+)?)\s*A", re.I), "A"),
    (re.compile(r"(?:00|OO)[-\s](\d+(?:\.\d+)?)", re.I), "00"),
)


def parse_hardness(text: str) -> tuple[str, float]:
    """Return the scale, "A" or "00", and the value of `30A` or `00-30`; raises `ValueError` for another text."""
    for form, scale in FORMS:
        if match := form.fullmatch(text.strip()):
            value, (low, high) = float(match[1]), LIMITS[scale]
            if not low <= value <= high:
                raise ValueError(
                    f"a Shore {scale} hardness of {value:g} lies outside {low:g} to {high:g}, where its relation to "
                    "the modulus holds"
                )
            return scale, value
    raise ValueError(f"'{text}' is no Shore hardness; write 30A or 00-30")


def hardness_to_shear_modulus(text: str) -> float:
    """Return μ = E/3 in Pa of an incompressible rubber with this hardness."""
    scale, value = parse_hardness(text)
    if scale == "A":
        return 0.0981e6 * (56 + 7.62336 * value) / (0.137505 * (254 - 2.54 * value)) / 3
    force, depth, radius = 0.203 + 0.00908 * value, 2.5e-3 * (1 - value / 100), 1.19e-3
    return float(9 * force / (16 * radius**0.5 * depth**1.5)) / 3
