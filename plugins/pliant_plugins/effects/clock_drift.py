"""Two recorders one of whose clocks runs faster.

    u'(t) = u(t₀ + (1 − r) (t − t₀))

for every input and load u, by the clock of the readings, t₀ the first sample of the run: with r > 0 the inputs happen
increasingly later than recorded, by r seconds per second.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Literal

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.units import Ratio
from pliant_plugins.effects.clock import at_times, still_or_untimed


class ClockDriftConfig(EffectConfig):
    """r, by which the inputs fall behind the readings."""

    kind: Literal["clock_drift"] = "clock_drift"
    rate: Ratio = parameter(neutral=0.0, bounds=(-0.2, 0.2), plausible=(-0.005, 0.005), example=0.002)
    """seconds a second by which inputs and loads fall behind their record"""


class ClockDrift(Effect):
    """A stretched clock of inputs and loads."""

    place = "input"
    notes = EffectNotes(
        origin="bench",
        signature="readings are in time at the beginning of a run and later and later, or earlier and "
        "earlier, toward its end; a new run begins in time again.",
        inspection="record one signal with both recorders for as long as the longest run and compare its "
        "end; then stretch one clock in the file.",
        confounder="clock_offset",
        distinguishing_test="a clock that runs wrong is right at the beginning of a run and worst at its "
        "end; one that is off is off as much everywhere.",
        excitation="cycle quickly for several minutes in one run.",
        where="recordings with a clock whose inputs move, the longer the better; every engine that follows "
        "histories.",
    )
    recommended_experiments = ("fast_cycles", "slow_cycles", "small_loops")
    config: ClockDriftConfig

    def unsuited(self, chain: ChainModel, histories: Sequence[History]) -> str:
        """Return a sentence if no input changes in a run with a clock; otherwise empty."""
        return still_or_untimed(histories)

    def apply(self, model: Model) -> Model:
        """Return the model with one more map of its inputs."""
        return model.with_input(partial(_stretched, self.config.rate))


def _stretched(rate: float, history: History) -> History:
    if history.time_s is None or rate == 0.0:
        return history
    start = history.time_s[0]
    return at_times(history, start + (1.0 - rate) * (history.time_s - start))
