"""Chambers or tendons that do not act alike.

    a'_k = g_k a_k,      g_1 = 1

for the inputs of the chain in the order of its actuators: a chamber with a thicker wall or a smaller area, a drum with
another radius, a valve with another gain. The first input is the reference; a gain that all of them share is
`actuation_gain`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Literal

from pliant.errors import ImpossibleEffectError
from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.units import Ratio

BOUNDS, PLAUSIBLE = (0.05, 20.0), (0.8, 1.2)


class UnequalActuatorsConfig(EffectConfig):
    """g₂ and g₃, relative to the first input."""

    kind: Literal["unequal_actuators"] = "unequal_actuators"
    second: Ratio = parameter(neutral=1.0, bounds=BOUNDS, plausible=PLAUSIBLE, example=0.9)
    """gain of the chain's second input, as a multiple of the model's"""
    third: Ratio = parameter(neutral=1.0, bounds=BOUNDS, plausible=PLAUSIBLE)
    """gain of the chain's third input, as a multiple of the model's; without effect on a chain of two inputs"""


class UnequalActuators(Effect):
    """A factor on the second and on the third input before they reach the chain."""

    place = "input"
    notes = EffectNotes(
        signature="the error is zero while the first chamber acts alone, and grows in proportion to the "
        "actuation of another one.",
        inspection="apply the same pressure to each chamber alone and compare the bends; measure walls and "
        "drums.",
        confounder="base_misalignment",
        distinguishing_test="a tilted base turns every bend alike; a chamber that differs changes only the "
        "bends toward it.",
        excitation="actuate each chamber alone over its range, and then all of them together.",
        where="chains with two or more inputs, every engine.",
    )
    recommended_experiments = ("each_input", "slow_cycles")
    config: UnequalActuatorsConfig

    def unsuited(self, chain: ChainModel, histories: Sequence[History]) -> str:
        """Return a sentence if fewer than two inputs vary in these runs; otherwise empty."""
        if len(_inputs(chain)) < 2:
            return "the chain has one input"
        varied = [
            name
            for name in _inputs(chain)[1:3]
            if any(name in history.actuation and history.actuation[name].any() for history in histories)
        ]
        return "" if varied else "only the first input acts in these runs"

    def apply(self, model: Model) -> Model:
        """Return the model with one more map of its inputs. Raises `ImpossibleEffectError` for a single input."""
        inputs = _inputs(model.chain)
        if len(inputs) < 2:
            raise ImpossibleEffectError(
                f"effect 'unequal_actuators' needs two or more inputs, and the chain has {', '.join(inputs)}"
            )
        gains = dict(zip(inputs[1:3], (self.config.second, self.config.third), strict=False))
        return model.with_input(partial(_scaled, gains))


def _inputs(chain: ChainModel) -> list[str]:
    """Return the names of the chain's inputs, each once, in the order of its actuators."""
    return list(dict.fromkeys(actuator.input for actuator in chain.actuators))


def _scaled(gains: Mapping[str, float], history: History) -> History:
    """Return the history with these inputs multiplied by their gains."""
    changed = {
        name: gain * history.actuation[name] for name, gain in gains.items() if name in history.actuation
    }
    return history.with_actuation(**changed)
