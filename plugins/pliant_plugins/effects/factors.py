"""The plainest term of a law: a factor that nothing changes."""

from __future__ import annotations

from pliant.records.design import Array


def constant_factor(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    """`c[0]`, whatever the joint does: a function of `LawTerm` without state."""
    return c[0]
