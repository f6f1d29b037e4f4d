"""Elongation by pressure: the pressure on the end cap stretches the whole chain.

    x' = x₀ + (1 + ε) (x − x₀),      ε = c Σ p

for every position that is read, with x₀ the base and Σ p the pressures of all chambers. A tube under inner pressure
carries p A at its cap as an axial force in its wall (Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells,
1959, ch. 15), and the part that the joint's law does not convert into bending stretches it. All pieces stretch equally
and joints keep their angles, so that scaling positions about the base is exact. Moments keep the arms of the chain at
rest, which is wrong by the share ε of them, and the shape that an engine draws keeps its length. c is stated per MPa;
the plate of a bending module of 249 kPa has 0.83, and c also contains the shortfall of straight pieces between hinges.
"""

from __future__ import annotations

import re
from functools import partial
from typing import Any, Literal

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, Readings, parameter
from pliant.records.design import Array
from pliant_plugins.effects.pressures import needs_pressure

PER_MPA = 1e-6
READING = re.compile(r"(?:tip|marker_\d+)_([xyz])_m")


class LinkStretchConfig(EffectConfig):
    """c, strain per pressure."""

    kind: Literal["link_stretch"] = "link_stretch"
    strain_per_mpa: float = parameter(
        unit="MPa^-1", neutral=0.0, bounds=(-10.0, 20.0), plausible=(0.0, 3.0), example=0.83
    )
    """axial strain of the pieces per MPa of pressure"""


class LinkStretch(Effect):
    """A stretch of positions from the base in proportion to the pressure."""

    place = "output"
    notes = EffectNotes(
        signature="angles are right and positions too near the base, by a share of their distance that grows with "
        "the pressure; without pressure they are right, under any load.",
        inspection="hold a ruler beside the chain and measure its length vented and at full pressure.",
        confounder="actuation_gain",
        distinguishing_test="a gain turns every joint; a stretch moves markers and turns nothing.",
        excitation="film the tip and every joint's angle through a slow pressure sweep to the top of the range.",
        where="chains under pressure whose tip or markers are read; every engine, since only readings change.",
    )
    recommended_experiments = ("second_sensor",)
    config: LinkStretchConfig

    def apply(self, model: Model) -> Model:
        """Return model with one more map of its readings, angles unchanged. Raises `UserError` without a pressure."""
        needs_pressure(self.config.kind, model.chain)
        if model.chain.mount is not None:
            raise UserError(
                "effect 'link_stretch' needs a base that stays where it is: leave 'chain.base.mount' out."
            )
        base = np.asarray(model.chain.base_position_m, float)
        return model.with_output(partial(_stretched, PER_MPA * self.config.strain_per_mpa, base))


def _stretched(strain_per_pa: float, base: Array, readings: Readings) -> Readings:
    """Return positions farther from the base; unchanged if readings do not state their pressure."""
    if "actuation" not in readings:
        return readings
    factor = 1.0 + strain_per_pa * readings["actuation"]
    changed: dict[str, Any] = dict(readings)
    for name, value in readings.items():
        if axis := READING.fullmatch(name):
            origin = float(base["xyz".index(axis[1])])
            changed[name] = origin + factor * (value - origin)
    return changed
