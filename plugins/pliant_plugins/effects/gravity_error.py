"""An error of the study's gravity vector.

    g' = g + [x, y, z]

in world axes: gravity that was left out of the study or turned, a bench that is inclined, buoyancy in a liquid. The
effect does not apply to a study with the gravity of a level bench, (0, 0, −9.81) m/s²: a tilt of its base is
`base_misalignment`, a wrong weight `gravity_scale`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.chain import GRAVITY_M_S2, ChainModel
from pliant.records.history import History
from pliant.units import Acceleration

BOUNDS, PLAUSIBLE = (-20.0, 20.0), (-9.81, 9.81)


class GravityErrorConfig(EffectConfig):
    """True gravity less the stated one, along the world's axes."""

    kind: Literal["gravity_error"] = "gravity_error"
    x_m_s2: Acceleration = parameter(neutral=0.0, bounds=BOUNDS, plausible=PLAUSIBLE, example="5 m/s^2")
    """true gravity less the stated one, along x"""
    y_m_s2: Acceleration = parameter(neutral=0.0, bounds=BOUNDS, plausible=PLAUSIBLE)
    """true gravity less the stated one, along y"""
    z_m_s2: Acceleration = parameter(neutral=0.0, bounds=BOUNDS, plausible=PLAUSIBLE, example="-9.81 m/s^2")
    """true gravity less the stated one, along z"""


class GravityError(Effect):
    """A correction of the study's gravity."""

    place = "chain"
    notes = EffectNotes(
        origin="bench",
        signature="the error follows the weight of the chain and its payload, in one direction of the world, "
        "at rest too, and does not depend on the pressure otherwise.",
        inspection="hang a plumb line beside the base, and write the gravity along it, or none on a table, "
        "as 'chain.gravity' in the study.",
        confounder="base_misalignment",
        distinguishing_test="turn the base by 90° and 180°: the error of a wrong gravity stays in the world, "
        "that of a tilted mount turns with the base.",
        excitation="repeat one pressure sweep with the base hanging, level and turned over, and with a "
        "payload.",
        where="studies whose 'chain.gravity' is not that of a level bench, every engine.",
    )
    recommended_experiments = ("level", "upside_down", "payload_steps")
    config: GravityErrorConfig

    def unsuited(self, chain: ChainModel, histories: Sequence[History]) -> str:
        """Return a sentence if the study has the gravity of a level bench; otherwise empty."""
        usual = np.allclose(chain.gravity_m_s2, GRAVITY_M_S2, atol=0.05)
        return "the study has the gravity of a level bench" if usual else ""

    def apply(self, model: Model) -> Model:
        """Return the model with the gravity corrected."""
        change = np.array([self.config.x_m_s2, self.config.y_m_s2, self.config.z_m_s2])
        return model.with_(chain=model.chain.with_(gravity_m_s2=model.chain.gravity_m_s2 + change))
