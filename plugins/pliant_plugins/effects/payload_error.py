"""A payload that was written down wrongly.

    m' = m + (f − 1) m (m₀/m)^c

for every stated payload m > 0, with c = 0 the same factor f on all of them: scales that read wrong, an ounce taken
for a gram. With c = 1 it is the same mass (f − 1) m₀ wherever something hangs: a hook, a holder, a cable. With c < 0
the largest payload is off most: a label of the heaviest weight. m₀ is the chain's own payload, or 10 g for a chain
without one. Runs without a payload stay without.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Literal

import numpy as np

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.units import Ratio

USUAL_KG = 0.01


class PayloadErrorConfig(EffectConfig):
    """f, true payload / stated one, and c."""

    kind: Literal["payload_error"] = "payload_error"
    factor: Ratio = parameter(neutral=1.0, bounds=(0.05, 20.0), plausible=(0.6, 1.7), example=1.2)
    """true payload / stated one, at the reference payload"""
    constant: float = parameter(unit="1", neutral=0.0, bounds=(-3.0, 1.0), plausible=(-1.0, 1.0), role="form")
    """0: the same factor on every payload, 1: the same mass added to every payload, below 0: most on the largest"""


class PayloadError(Effect):
    """A correction of the payload of every run that states one."""

    place = "input"
    notes = EffectNotes(
        origin="bench",
        signature="runs with a payload are off by what more or less weight would do, in proportion to the "
        "payload; runs without one are right.",
        inspection="weigh what hung there, with its hook and cable, and correct 'payload_kg' in the "
        "recording, in its name or in the study.",
        confounder="stiffness",
        distinguishing_test="without a payload the error of a wrong payload is gone, that of a stiffness "
        "stays; with half of it the error is half.",
        excitation="repeat one pressure sweep with no payload, half of it and all of it.",
        where="recordings and chains that state a payload, under gravity; every engine.",
    )
    recommended_experiments = ("payload_steps", "level", "slow_cycles")
    config: PayloadErrorConfig

    def unsuited(self, chain: ChainModel, histories: Sequence[History]) -> str:
        """Return a sentence if no run has a payload or the study has no gravity; otherwise empty."""
        if not np.any(chain.gravity_m_s2):
            return "the study has no gravity, so that a payload weighs nothing"
        stated = (_stated(history, chain.payload_kg) for history in histories)
        return "" if any(map(np.any, stated)) else "no run states a payload, and the chain has none"

    def apply(self, model: Model) -> Model:
        """Return the model with one more map of its inputs."""
        return model.with_input(partial(_corrected, self.config, model.chain.payload_kg))


def _stated(history: History, own_kg: float) -> np.ndarray:
    return np.full(len(history), own_kg) if history.payload_kg is None else history.payload_kg


def _corrected(config: PayloadErrorConfig, own_kg: float, history: History) -> History:
    stated = _stated(history, own_kg)
    hangs = stated > 0.0
    if config.factor == 1.0 or not hangs.any():
        return history
    reference = own_kg if own_kg > 0.0 else USUAL_KG
    true = np.zeros(len(stated))
    m = stated[hangs]
    true[hangs] = np.maximum(m + (config.factor - 1.0) * m * (reference / m) ** config.constant, 0.0)
    return history.with_(payload_kg=true)
