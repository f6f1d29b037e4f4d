"""A load that was written down wrongly: a lever arm, a calibration of the load cell, a wrong unit.

    M' = f M,      F' = f F

for the end moment M and the tip force F of every run. Payloads are another matter (`payload_error.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Literal

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.units import Ratio


class LoadErrorConfig(EffectConfig):
    """f, true load / stated one."""

    kind: Literal["load_error"] = "load_error"
    factor: Ratio = parameter(neutral=1.0, bounds=(0.05, 20.0), plausible=(0.6, 1.7), example=1.2)
    """true load / stated one"""


class LoadError(Effect):
    """A factor on the moment and the force at the tip of every run."""

    place = "input"
    notes = EffectNotes(
        origin="bench",
        signature="the error goes with the moment or the force at the tip and is gone where none acts, at "
        "every pressure.",
        inspection="measure the lever arm and hang a known weight on the load cell; correct the column of "
        "the load.",
        confounder="stiffness",
        distinguishing_test="a pressure sweep without a load is right with a wrong load, and wrong with a "
        "wrong stiffness.",
        excitation="push both ways without pressure, then sweep the pressure without a load.",
        where="recordings with a moment or a force at the tip; every engine that follows histories.",
    )
    recommended_experiments = ("passive_load_steps", "load_steps", "slow_cycles")
    config: LoadErrorConfig

    def unsuited(self, chain: ChainModel, histories: Sequence[History]) -> str:
        """Return a sentence if no run has a load at the tip; otherwise empty."""
        loaded = any(history.moment_n_m.any() or history.tip_force_n.any() for history in histories)
        return "" if loaded else "no run has a moment or a force at the tip"

    def apply(self, model: Model) -> Model:
        """Return the model with one more map of its inputs."""
        return model.with_input(partial(_scaled, self.config.factor))


def _scaled(factor: float, history: History) -> History:
    if factor == 1.0:
        return history
    return history.with_(moment_n_m=factor * history.moment_n_m, tip_force_n=factor * history.tip_force_n)
