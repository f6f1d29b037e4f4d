"""The plainest term of a law, a factor that nothing changes, and the sizes that power laws are stated at."""

from __future__ import annotations

from pliant.records.design import Array

# Where power laws have the size that their strength states, whatever the power: an angle, a rate, a depth of contact.
TYPICAL_RAD, TYPICAL_RAD_S, DEPTH_RAD = 0.2, 0.1, 0.1
# Below these a power law is smooth: it has no infinite slope where nothing is bent or moves.
SMALL_RAD, STILL_RAD_S = 1e-4, 1e-3


def constant_factor(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    """`c[0]`, whatever the joint does: a function of `LawTerm` without state."""
    return c[0]
