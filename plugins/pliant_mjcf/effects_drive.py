"""Play and slack between a position drive and what it moves.

A position drive of MuJoCo gives the force f = k (L* − L) − d dL/dt, with its length L (gear ratio times angle, or the
tendon's length) and the length L* that its control asks for. Behind a play of half-width w, or a slack s of a tendon
that is pulled shorter, the same drive gives

    joint_play      f = k dz(L* − L) − d dL/dt,      dz(e) = e − clip(e, −w, w)
    tendon_slack    f = k dz(L* − L) − d dL/dt,      dz(e) = e − clip(e, −s, 0)

the dead zone of an elastic shaft with backlash (Nordin & Gutman, Automatica 38, 2002, physical model): within it the
drive's spring transmits nothing. It is a change of the control, u' = u + k/g (dz(e) − e) with the gain g, so that it
holds for every integrator. The rotor is where the control asks it to be, so it needs no state; a torque drive has no
such position, and is refused.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pliant.errors import ImpossibleEffectError
from pliant.interfaces.effect import EffectConfig, EffectNotes, parameter
from pliant.interfaces.model import SystemParts, effect_kind
from pliant.records.design import Array
from pliant.units import Angle
from pliant_mjcf.changes import DriveChange
from pliant_mjcf.effect_bases import EffectCheck, MjcfEffect
from pliant_plugins.effects.backlash import Backlash


class DriveEffect(MjcfEffect):
    """A dead zone between position drives and the elements that they move."""

    transmissions: ClassVar[tuple[str, ...]]

    @abstractmethod
    def lost(self, error: Array) -> Array:
        """Return the part of (r, n) differences, asked − actual position of the element, that is not transmitted."""

    def act(self, parts: SystemParts) -> SystemParts:
        """Return the parts with the dead zone."""
        return parts.with_change(EffectCheck(self) if self.is_neutral else DeadZoneDrive(self))

    def drives(self, model: Any) -> list[int]:
        """Return the position drives at the chosen elements; raise `UserError` without any."""
        import mujoco

        chosen = set(self.numbers(model))
        kinds = [int(getattr(mujoco.mjtTrn, name)) for name in self.transmissions]
        found = [
            k
            for k in range(len(model.actuator_trntype))
            if model.actuator_trntype[k] in kinds
            and model.actuator_trnid[k, 0] in chosen
            and is_position_drive(model, k)
        ]
        if not found:
            raise ImpossibleEffectError(
                f"effect '{self.config.kind}' needs a position drive without a filter, and no actuator of its "
                f"{self.place} is one"
            )
        return found


def is_position_drive(model: Any, actuator: int) -> bool:
    """Return whether an actuator's force is a gain times control minus position, without a filter."""
    import mujoco

    return bool(
        model.actuator_gaintype[actuator] == int(mujoco.mjtGain.mjGAIN_FIXED)
        and model.actuator_biastype[actuator] == int(mujoco.mjtBias.mjBIAS_AFFINE)
        and model.actuator_dyntype[actuator] == int(mujoco.mjtDyn.mjDYN_NONE)
        and model.actuator_gainprm[actuator, 0] != 0.0
        and model.actuator_biasprm[actuator, 1] < 0.0
        and model.actuator_gear[actuator, 0] != 0.0
    )


@dataclass(frozen=True)
class DeadZoneDrive(DriveChange):
    """The dead zone of an effect, in the controls."""

    effect: DriveEffect

    def start(self, model: Any) -> Any:
        """Return the numbers of the drives, and data in which positions are computed."""
        import mujoco

        drives = self.effect.drives(model)
        return Drives.from_model(model, drives), mujoco.MjData(model)

    def advance(
        self, model: Any, state: Any, q: Array, v: Array, controls: Array, step_s: float
    ) -> tuple[Array, Any]:
        """Return (r, nu) the controls with which the drives transmit the remainder, and the same state."""
        drives, data = state
        asked = np.clip(controls[:, drives.places], drives.low, drives.high)
        wanted = asked * drives.per_control + drives.at_zero
        error = wanted - element_positions(model, data, drives, q)
        changed = controls.copy()
        changed[:, drives.places] = asked - self.effect.lost(error) / drives.per_control
        return changed, state


@dataclass(frozen=True, eq=False)
class Drives:
    """Position drives: (n,) numbers that no step changes.

    Attributes:
        elements: the joint or tendon that each moves; `qpos`: addresses of the joints' positions, None with a tendon.
        places: their controls; `low`, `high`: limits of these.
        per_control, at_zero: the position that is commanded is at_zero + per_control u.
    """

    elements: Array
    qpos: Array | None
    places: Array
    low: Array
    high: Array
    per_control: Array
    at_zero: Array

    @staticmethod
    def from_model(model: Any, drives: list[int]) -> Drives:
        """Return the numbers of these actuators."""
        import mujoco

        gear, stiffness = model.actuator_gear[drives, 0], -model.actuator_biasprm[drives, 1]
        limited = model.actuator_ctrllimited[drives].astype(bool)
        low, high = model.actuator_ctrlrange[drives].T
        elements = model.actuator_trnid[drives, 0]
        joints = np.all(model.actuator_trntype[drives] != int(mujoco.mjtTrn.mjTRN_TENDON))
        return Drives(
            elements=elements,
            qpos=model.jnt_qposadr[elements] if joints else None,
            places=getattr(model, "actuator_ctrladr", np.arange(model.nu))[drives],
            low=np.where(limited, low, -np.inf),
            high=np.where(limited, high, np.inf),
            per_control=model.actuator_gainprm[drives, 0] / (stiffness * gear),
            at_zero=model.actuator_biasprm[drives, 0] / (stiffness * gear),
        )


def element_positions(model: Any, data: Any, drives: Drives, q: Array) -> Array:
    """Return (r, n) the angle of the joint, or the length of the tendon, that each of these actuators moves."""
    if drives.qpos is not None:
        return np.asarray(q[:, drives.qpos])
    import mujoco

    found = np.empty((len(q), len(drives.elements)))
    for k, position in enumerate(q):
        data.qpos[:] = position
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        found[k] = data.ten_length[drives.elements]
    return found


class JointPlayConfig(EffectConfig):
    """Play between a joint and its drive."""

    kind: str = effect_kind("joint_play")
    play_rad: Angle = parameter(neutral=0.0, bounds=(0.0, 1.0), plausible=(0.0, 0.1), example="2 deg")
    """clearance between drive and joint, whole width; of a slide in m"""


class JointPlay(DriveEffect):
    """A play between position drives and their joints."""

    place = "joint"
    transmissions = ("mjTRN_JOINT", "mjTRN_JOINTINPARENT")
    config: JointPlayConfig
    notes = EffectNotes(
        signature="after every reversal the joint stops while the command runs through the clearance; at a held "
        "command the joint can be moved freely within it, and gravity decides at which side it lies.",
        inspection=Backlash.notes.inspection,
        confounder="backlash",
        distinguishing_test="push the joint by hand at a held command, or load it: behind a play it gives way within "
        "the clearance, whereas a play of the command only delays it.",
        excitation="small cycles about several positions, with the load to either side.",
        where="joints that position actuators of MuJoCo models move, all or those that a pattern names.",
    )
    recommended_experiments = ("small_loops", "slow_cycles")

    def lost(self, error: Array) -> Array:
        """Return the part of the differences within the play."""
        return np.clip(error, -0.5 * self.config.play_rad, 0.5 * self.config.play_rad)
