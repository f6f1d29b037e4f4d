"""Two recorders whose clocks disagree by a constant.

    u'(t) = u(t − T)

for every input and load u, by the clock of the readings: with T > 0 they happened later than recorded, with
T < 0 earlier, so that readings seem to move before their cause does. Ends of the record hold on.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Literal

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.units import Time
from pliant_plugins.effects.clock import at_times, still_or_untimed


class ClockOffsetConfig(EffectConfig):
    """T, by which the inputs happened later than their clock says."""

    kind: Literal["clock_offset"] = "clock_offset"
    late_s: Time = parameter(neutral=0.0, bounds=(-10.0, 10.0), plausible=(-0.5, 0.5), example="0.2 s")
    """time by which inputs and loads happened later than they are recorded"""


class ClockOffset(Effect):
    """A shift of inputs and loads in time."""

    place = "input"
    notes = EffectNotes(
        origin="bench",
        signature="readings follow every input and every load late by the same time, or come before them, "
        "and nothing is rounded: a step stays a step.",
        inspection="give both recorders one trigger, or tap the joint so that both see it; then shift one "
        "clock in the file.",
        confounder="supply_lag",
        distinguishing_test="a supply rounds a step and leaves loads in time; clocks shift both and round "
        "nothing. Readings that come before their cause can only be a clock.",
        excitation="step the pressure, then a load at constant pressure, sampled ten times a second or more.",
        where="recordings with a clock whose inputs move; every engine that follows histories.",
    )
    recommended_experiments = ("step_response", "load_steps", "fast_cycles")
    config: ClockOffsetConfig

    def unsuited(self, chain: ChainModel, histories: Sequence[History]) -> str:
        """Return a sentence if no input changes in a run with a clock; otherwise empty."""
        return still_or_untimed(histories)

    def apply(self, model: Model) -> Model:
        """Return the model with one more map of its inputs."""
        return model.with_input(partial(_shifted, self.config.late_s))


def _shifted(late_s: float, history: History) -> History:
    if history.time_s is None or late_s == 0.0:
        return history
    return at_times(history, history.time_s - late_s)
