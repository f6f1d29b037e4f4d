"""A tilted mount of the base.

    R' = T exp([θ_x, θ_y, 0]) R

R is the base's nominal pose, T the turn of the bench in a run (`base_pitch_rad`… of a recording): the rotation vector
[θ_x, θ_y, 0] is applied between the two, in world axes, and turns with the bench. θ_y tilts the base in the plane in
which a chain with the default base bends, θ_x out of it; a turn about the vertical has no effect on gravity. The
position of the base does not change. (Misalignment as a small rotation of the base frame: Mooring, Roth & Driels,
Fundamentals of Manipulator Calibration, 1991.)
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.mechanics.rotations import exp_map
from pliant.units import Angle


class BaseMisalignmentConfig(EffectConfig):
    """Turns θ_y (pitch) and θ_x (roll) of the mount."""

    kind: Literal["base_misalignment"] = "base_misalignment"
    pitch_rad: Angle = parameter(neutral=0.0, bounds=(-0.5, 0.5), plausible=(-0.05, 0.05), example="2 deg")
    """tilt about world y, in the bending plane"""
    roll_rad: Angle = parameter(neutral=0.0, bounds=(-0.5, 0.5), plausible=(-0.05, 0.05), example="1 deg")
    """tilt about world x, out of the bending plane"""


class BaseMisalignment(Effect):
    """A tilt of the chain's base."""

    place = "chain"
    notes = EffectNotes(
        signature="all positions are turned about the base by one angle, at rest too, the tip by the length "
        "times the angle. Angles are off only as far as gravity bends the chain, as they are with the base "
        "turned by the tilt.",
        inspection="put a level on the clamp and hang a plumb line beside the vented chain; shim the clamp, "
        "or state 'chain.base'.",
        confounder="gravity_scale",
        distinguishing_test="with the base hanging a wrong weight bends nothing, and the error of a tilt is "
        "largest there; with the base level it is the other way round. A tilt moves the tip of an unloaded "
        "chain, a weight does not.",
        excitation="film the tip at rest and in a cycle of pressure with the base hanging, then level and "
        "turned over.",
        where="every family and every engine; read by angles alone it needs a chain that its weight bends, "
        "and a tilt out of the bending plane hardly shows there.",
    )
    recommended_experiments = ("second_sensor", "level", "upside_down")
    config: BaseMisalignmentConfig

    def apply(self, model: Model) -> Model:
        """Return the model with its chain's base turned."""
        tilt = exp_map(np.array([self.config.roll_rad, self.config.pitch_rad, 0.0]))
        return model.with_(chain=model.chain.with_(base_rotation=tilt @ model.chain.base_rotation))
