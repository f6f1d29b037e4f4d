"""A stiffness that changes with the temperature.

    E'(u) = (1 − c (T − T_ref)) E(u),      T_ref = 22 °C

to first order about the temperature of the model, never below a twentieth. Silicones and thermoplastic
elastomers soften by some tenths of a percent per kelvin; in an ideal rubber elasticity is entropic and stiffens
as the absolute temperature, c = −1/T (Treloar, The Physics of Rubber Elasticity, 1975).
"""

from __future__ import annotations

from typing import Literal

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.design import Array
from pliant.records.history import REFERENCE_TEMPERATURE_C
from pliant.records.term import LawTerm

LEAST_FACTOR = 0.05


class ThermalSofteningConfig(EffectConfig):
    """c, loss of stiffness per kelvin."""

    kind: Literal["thermal_softening"] = "thermal_softening"
    loss_per_k: float = parameter(
        unit="K^-1", neutral=0.0, bounds=(-0.03, 0.03), plausible=(-0.003, 0.01), example=0.005
    )
    """share of the stiffness lost per kelvin, 1/K"""
    curvature_per_k: float = parameter(
        unit="K^-1", neutral=0.0, bounds=(-0.03, 0.03), plausible=(-0.01, 0.01), role="form"
    )
    """share of the loss that is gone per kelvin away from T_ref, 1/K"""


class ThermalSoftening(Effect):
    """A factor on the elastic part that depends on the temperature of the run."""

    place = "law"
    notes = EffectNotes(
        signature="runs at another temperature are off as by another stiffness, in proportion to the difference; all "
        "else is alike.",
        inspection="tape a thermometer to the module, write down temperature_c, and let everything stand in the "
        "room for an hour before the first run.",
        confounder="stiffness",
        distinguishing_test="a stiffness is off by the same factor at every temperature.",
        excitation="repeat one loaded run at three temperatures at least ten kelvin apart, and write temperature_c.",
        where="every family, recordings with temperature_c, in engines that follow histories.",
    )
    recommended_experiments = ("warm", "passive_load_steps")
    config: ThermalSofteningConfig

    def apply(self, model: Model) -> Model:
        """Return the model with one more factor on the elastic part."""
        return model.with_term(
            LawTerm("elastic", _factor, (self.config.loss_per_k, self.config.curvature_per_k))
        )


def _factor(
    angle: float, rate: float, dt_s: float, actuation: float, temp_c: float, old: Array, new: Array, c: Array
) -> float:
    warmer = temp_c - REFERENCE_TEMPERATURE_C
    return max(1.0 - c[0] * warmer * (1.0 - c[1] * warmer), LEAST_FACTOR)
