"""The plainest term of a law: a factor that nothing changes."""

from __future__ import annotations

from pliant.records.design import Array


def constant_factor(
    angle: float,
    rate: float,
    dt_s: float,
    actuation: float,
    temperature_c: float,
    old: Array,
    new: Array,
    parameters: Array,
) -> float:
    """`parameters[0]`, whatever the joint does: a function of `LawTerm` without state."""
    return parameters[0]
