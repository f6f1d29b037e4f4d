"""What inverse statics answers, and the sentence that says it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pliant.formatting import unit_of
from pliant.records.design import Array
from pliant.records.rollout import Response

# What counts as reached, in m (of RMS for a backbone; a turn counts as `Target.turn_m`).
REACHED_M = 1e-6


@dataclass(frozen=True, eq=False)
class InverseAnswer:
    """The actuations that reach a target, or come closest.

    Attributes:
        actuation: value of each input.
        distance_m: what is left: the residual's length.
        at_limit: inputs that stand at a bound, or at a limit of their rate, with "low" or "high".
        response: the equilibrium there.
        starts: how many starts were tried; `evaluations`: how many equilibria were solved.
    """

    actuation: Mapping[str, float]
    distance_m: float
    at_limit: Mapping[str, str]
    response: Response
    starts: int
    evaluations: int

    @property
    def reached(self) -> bool:
        """Whether it is there, within a micrometre."""
        return self.distance_m <= REACHED_M

    @property
    def tip_m(self) -> Array:
        """(3,) where the tip is."""
        return np.asarray(self.response.markers_m[-1])

    def __str__(self) -> str:
        """One sentence."""
        values = ", ".join(f"{name} {unit_of(name).text(value, 5)}" for name, value in self.actuation.items())
        tip = ", ".join(f"{1e3 * x:.4g}" for x in self.tip_m)
        if self.reached:
            beyond = "" if self.response.inside else "; a joint leaves the data of its law"
            return f"Reached with {values}: the tip is at ({tip}) mm{beyond}."
        limits = " and ".join(f"{name} at its {side} limit" for name, side in self.at_limit.items())
        why = f", {limits}" if limits else f"; nothing closer from {self.starts} starts"
        away = unit_of("distance_m").text(self.distance_m, 3)
        return f"Out of reach by {away}: the closest is {values}, tip at ({tip}) mm{why}."
