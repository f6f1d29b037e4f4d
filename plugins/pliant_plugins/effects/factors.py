"""The simplest term of a law, a constant factor, and the reference sizes of power laws."""

from __future__ import annotations

from pliant.records.design import Array

# Where power laws have the size that their strength states, whatever the power: an angle, a rate, a depth of contact.
TYPICAL_RAD, TYPICAL_RAD_S, DEPTH_RAD = 0.2, 0.1, 0.1
# Below these a power law is smooth: it has no infinite slope at zero angle or rate.
SMALL_RAD, STILL_RAD_S = 1e-4, 1e-3


def constant_factor(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    """Return `c[0]`, whatever the joint does: a function of `LawTerm` without state."""
    return c[0]
