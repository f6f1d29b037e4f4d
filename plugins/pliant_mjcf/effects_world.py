"""Effects of the world of a MuJoCo model: gravity, the mount of its base, the floor.

    gravity_scale        g' = f g
    gravity_direction    g' = exp([θ_x, θ_y, 0]) g
    base_misalignment    p' = R p,  Q' = R Q,    R = exp([θ_x, θ_y, θ_z])
    floor_friction       μ' = f μ

The poses p, Q of the bodies that hang on the world are turned about its origin; its own sites, geoms and cameras stay,
and so do bodies with a free joint. To the robot that is the inverse turn of gravity and of the frame in which its sites
are read (Mooring, Roth & Driels, Fundamentals of Manipulator Calibration, 1991); a yaw θ_z is seen in readings of
positions only. MuJoCo takes the larger friction of two geoms in contact, unless priorities decide: below f = 1 geoms
that the floor can touch keep at most f max(μ_floor, μ_geom), so that the contacts with the floor have the factor.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pliant.errors import ImpossibleEffectError
from pliant.interfaces.effect import EffectConfig, EffectNotes, parameter
from pliant.interfaces.model import effect_kind
from pliant.mechanics.rotations import exp_map
from pliant.units import Angle, Ratio
from pliant_mjcf.effect_bases import ModelEffect
from pliant_mjcf.elements import with_id
from pliant_plugins.effects.base_misalignment import BaseMisalignment
from pliant_plugins.effects.gravity_scale import GravityScale

WHERE = "MuJoCo models with gravity."


class WorldGravityScaleConfig(EffectConfig):
    """Size of gravity."""

    kind: str = effect_kind("gravity_scale")
    factor: Ratio = parameter(neutral=1.0, bounds=(0.0, 10.0), plausible=(0.8, 1.25), example=1.1)
    """true weights / model's"""


class GravityEffect(ModelEffect):
    """A change of gravity."""

    place = "world"

    def write(self, spec: Any, model: Any) -> None:
        spec.option.gravity = model.opt.gravity.copy()


class WorldGravityScale(GravityEffect):
    """A factor of all weights, while inertia stays: counterweights, or masses of a model without fast motion."""

    config: WorldGravityScaleConfig
    notes = replace(
        GravityScale.notes,
        signature="the error changes with the orientation of the bodies, and is largest where they lie level.",
        inspection="weigh the parts with cables and markers; look for counterweights and springs.",
        distinguishing_test="turn the base by 90° and 180°: the error of a weight turns with it, that of a stiffness "
        "stays.",
        excitation="hold levels over the whole range of angles.",
        where=WHERE,
    )
    recommended_experiments = ("slow_cycles", "vented_zero")

    def change(self, model: Any) -> None:
        self.numbers(model)
        model.opt.gravity[:] *= self.config.factor


class GravityDirectionConfig(EffectConfig):
    """Tilt of gravity."""

    kind: str = effect_kind("gravity_direction")
    about_x_rad: Angle = parameter(
        neutral=0.0, bounds=(-np.pi, np.pi), plausible=(-0.1, 0.1), example="2 deg"
    )
    """turn of gravity about the world's x"""
    about_y_rad: Angle = parameter(neutral=0.0, bounds=(-np.pi, np.pi), plausible=(-0.1, 0.1))
    """turn of gravity about the world's y"""


class GravityDirection(GravityEffect):
    """A table that is not level, with the cameras on it."""

    config: GravityDirectionConfig
    notes = EffectNotes(
        signature="all bodies rest as if they leaned to one side, and readings of positions agree with their angles.",
        inspection="put a level on the table in two directions, and correct the gravity of the model.",
        confounder="base_misalignment",
        distinguishing_test="read a position with a camera that is level: a tilted base turns it, tilted gravity "
        "alone does not.",
        excitation="no motion of any input, then slow cycles.",
        where=WHERE,
    )
    recommended_experiments = ("vented_zero", "slow_cycles")

    def change(self, model: Any) -> None:
        self.numbers(model)
        turn = exp_map(np.array([self.config.about_x_rad, self.config.about_y_rad, 0.0]))
        model.opt.gravity[:] = turn @ model.opt.gravity


class WorldMisalignmentConfig(EffectConfig):
    """Turn of the base."""

    kind: str = effect_kind("base_misalignment")
    pitch_rad: Angle = parameter(neutral=0.0, bounds=(-np.pi, np.pi), plausible=(-0.1, 0.1), example="2 deg")
    """turn about the world's y"""
    roll_rad: Angle = parameter(neutral=0.0, bounds=(-np.pi, np.pi), plausible=(-0.1, 0.1))
    """turn about the world's x"""
    yaw_rad: Angle = parameter(neutral=0.0, bounds=(-np.pi, np.pi), plausible=(-0.1, 0.1))
    """turn about the world's z"""


class WorldMisalignment(ModelEffect):
    """A turned mount of all bodies that hang on the world."""

    place = "world"
    config: WorldMisalignmentConfig
    notes = replace(
        BaseMisalignment.notes,
        signature="all positions are turned about the origin by one angle, at rest too; angles are off as far as "
        "gravity moves the bodies.",
        inspection="put a level on the base and hang a plumb line from it; shim it, or turn the first body.",
        confounder="gravity_direction",
        distinguishing_test="positions and angles together: tilted gravity alone leaves them in agreement.",
        excitation="no motion of any input, then slow cycles, with positions read.",
        where="MuJoCo models whose first bodies are fixed to the world or hang on it by joints other than free ones.",
    )
    recommended_experiments = ("vented_zero", "slow_cycles")

    def numbers(self, model: Any) -> list[int]:
        """Return the bodies that hang on the world; raise `UserError` without any."""
        import mujoco

        super().numbers(model)
        free = {int(b) for b in model.jnt_bodyid[model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE)]}
        found = [
            k
            for k in range(1, model.nbody)
            if model.body_parentid[k] == 0 and model.body_mocapid[k] < 0 and k not in free
        ]
        if not found:
            raise ImpossibleEffectError(f"effect '{self.config.kind}': no body hangs on the world")
        return found

    def change(self, model: Any) -> None:
        import mujoco

        config = self.config
        turn = exp_map(np.array([config.roll_rad, config.pitch_rad, config.yaw_rad]))
        quat, turned = np.empty(4), np.empty(4)
        mujoco.mju_mat2Quat(quat, turn.ravel())
        for k in self.numbers(model):
            model.body_pos[k] = turn @ model.body_pos[k]
            mujoco.mju_mulQuat(turned, quat, model.body_quat[k])
            model.body_quat[k] = turned

    def write(self, spec: Any, model: Any) -> None:
        """Write the poses; a body inside a frame leaves it, for its compiled pose includes that of the frame."""
        import mujoco

        bodies = {
            k: with_id(spec.bodies, k) for k in self.numbers(model)
        }  # a new frame takes the numbers away
        for k, body in bodies.items():
            if body.frame is not None:
                body.set_frame(spec.worldbody.add_frame())
            body.pos, body.quat = model.body_pos[k].copy(), model.body_quat[k].copy()
            body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT


class FloorFrictionConfig(EffectConfig):
    """Sliding friction of the floor."""

    kind: str = effect_kind("floor_friction")
    factor: Ratio = parameter(neutral=1.0, bounds=(0.0, 20.0), plausible=(0.5, 1.6), example=0.8)
    """true coefficient of sliding friction / model's"""


class FloorFriction(ModelEffect):
    """A factor of the sliding friction of the geoms of the world."""

    place = "world"
    config: FloorFrictionConfig
    notes = EffectNotes(
        signature="bodies that touch the floor slide farther or less far; free motion is right.",
        inspection="tilt a plate of the floor's surface until the body slides: the tangent is the friction.",
        confounder="coulomb_friction",
        distinguishing_test="lift the robot: friction of the floor is gone, that of the joints stays.",
        excitation="push and drag over the floor, slowly and fast.",
        where="MuJoCo models with geoms of the world that other geoms touch.",
    )
    recommended_experiments = ("slow_cycles", "fast_cycles")

    def numbers(self, model: Any) -> list[int]:
        """Return the geoms of the world that can touch others; raise `UserError` without any."""
        super().numbers(model)
        floor = [k for k in range(model.ngeom) if model.geom_bodyid[k] == 0 and self._touched(model, k)]
        if not floor:
            raise ImpossibleEffectError(
                f"effect '{self.config.kind}': no geom of the world can touch another"
            )
        return floor

    def _touched(self, model: Any, geom: int) -> list[int]:
        """Return the geoms of moving bodies that can touch this one."""
        a, b = model.geom_contype, model.geom_conaffinity
        meets = ((a & b[geom]) | (b & a[geom])) != 0
        return [int(k) for k in np.flatnonzero(meets & (model.body_weldid[model.geom_bodyid] != 0))]

    def change(self, model: Any) -> None:
        factor, floor, friction = self.config.factor, self.numbers(model), model.geom_friction[:, 0]
        before = friction.copy()
        friction[floor] *= factor
        for k in floor:
            for other in self._touched(model, k):
                if model.geom_priority[k] == model.geom_priority[other]:
                    most = factor * max(before[k], before[other])
                    friction[other] = (
                        min(friction[other], max(most, 0.0)) if factor < 1.0 else friction[other]
                    )

    def write(self, spec: Any, model: Any) -> None:
        for geom in spec.geoms:
            if geom.id >= 0:
                friction = np.array(geom.friction, float)
                friction[0] = model.geom_friction[geom.id, 0]
                geom.friction = friction
