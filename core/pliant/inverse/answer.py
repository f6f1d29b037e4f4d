"""The answer of inverse statics, and the sentence that states it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pliant.formatting import output_unit
from pliant.records.design import Array
from pliant.records.rollout import Response

# Residual below which a target counts as reached, in m (RMS for a backbone; a turn counts as `Target.turn_m`).
REACHED_M = 1e-6


@dataclass(frozen=True, eq=False)
class InverseAnswer:
    """The actuations that reach a target, or come closest to it.

    Attributes:
        actuation: value of each input.
        distance_m: length of the remaining residual.
        at_limit: inputs at a bound, or at a limit of their rate, with "low" or "high".
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
        """Return whether the target is reached, within a micrometre."""
        return self.distance_m <= REACHED_M

    @property
    def tip_m(self) -> Array:
        """(3,) position of the tip."""
        return np.asarray(self.response.markers_m[-1])

    def __str__(self) -> str:
        """Return one sentence."""
        values = ", ".join(
            f"{name} {output_unit(name).text(value, 5)}" for name, value in self.actuation.items()
        )
        tip = ", ".join(f"{1e3 * x:.4g}" for x in self.tip_m)
        if self.reached:
            beyond = "" if self.response.inside else "; a joint leaves the data of its law"
            return f"Reached with {values}: the tip is at ({tip}) mm{beyond}."
        limits = " and ".join(f"{name} at its {side} limit" for name, side in self.at_limit.items())
        why = f", {limits}" if limits else f"; nothing closer from {self.starts} starts"
        away = output_unit("distance_m").text(self.distance_m, 3)
        return f"Out of reach by {away}: the closest is {values}, tip at ({tip}) mm{why}."
