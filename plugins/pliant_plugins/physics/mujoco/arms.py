"""Efforts of all arms of a scene: in one compiled call where all laws have scalar forms, else arm by arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from pliant.mechanics.statics import Loads
from pliant.mechanics.terms import Memory
from pliant.records.design import Array
from pliant_plugins.physics.compiled.dof_forces import drive_arms
from pliant_plugins.physics.mujoco.joints import ChainJoints


class Arms:
    """The arms of a scene as its steps drive them."""

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, joints: Sequence[ChainJoints], damping: float
    ) -> None:
        self._joints, self._physical = joints, damping
        self._model = model
        self._qpos, self._applied, self._damping = data.qpos, data.qfrc_applied, model.dof_damping
        self._laws = _joined(joints)
        table, last = [], 0
        for arm in joints:
            first, last = last, last + arm.n_joints
            table.append([first, last, arm.coordinate, arm.dof, arm.ball, arm.main])
        self._table = np.array(table, np.int64).reshape(-1, 6)
        self._axes = np.array([np.resize(arm.order, 3) for arm in joints], np.int64).reshape(-1, 3)
        self._loads: Sequence[Loads] = ()
        # What law terms know of the past, arm by arm; None where an arm has none.
        self.memories: list[Memory | None] = [arm.rested() for arm in joints]
        self._pulled = False

    def apply(self, loads: Sequence[Loads]) -> None:
        """Loads of each arm from now on."""
        self._loads = loads
        self._pulled = any(of_arm.forces or of_arm.cords for of_arm in loads)
        for arm, of_arm in zip(self._joints, loads, strict=True):
            arm.push_tip(of_arm)
        if self._laws is not None:
            pairs = zip(self._joints, loads, strict=True)
            self._values = np.array([arm.statics.efforts.values(of_arm.actuation) for arm, of_arm in pairs])
            self._moments = np.array([of_arm.moment_n_m for of_arm in loads])

    def drive(self, step_s: float) -> None:
        """Forces of laws and loads for a step of this length, which the model has too."""
        if self._laws is None or self._pulled:
            for arm, loads, memory in zip(self._joints, self._loads, self.memories, strict=True):
                arm.drive(loads if memory is None else loads.after(memory.over(step_s)), self._physical)
            return
        given = (self._values, self._moments, self._physical, step_s)
        drive_arms(self._laws, self._table, self._axes, *given, self._qpos, self._applied, self._damping)

    def remember(self, step_s: float) -> None:
        """Let law terms remember a step of this length that has ended where the arms are."""
        for k, (arm, loads, memory) in enumerate(zip(self._joints, self._loads, self.memories, strict=True)):
            if memory is not None:
                self.memories[k] = arm.remember(loads.after(memory.over(step_s))).memory

    def recall(self, states: Sequence[Array | None]) -> None:
        """Set what law terms remember, for arms that are where they were then; rested where nothing is given."""
        self.memories = [arm.rested() for arm in self._joints]
        for k, (arm, memory) in enumerate(zip(self._joints, self.memories, strict=True)):
            known = states[k] if k < len(states) else None
            if memory is not None:
                given = memory.states if known is None else known.copy()
                self.memories[k] = replace(memory, previous=arm.q, states=given)


def _joined(joints: Sequence[ChainJoints]) -> Any:
    """Laws of all arms in a row; None where one has none, or actuators differ."""
    each = [arm.laws for arm in joints]
    known = [laws for laws in each if laws is not None]
    if not known or len(known) < len(each) or any(not np.array_equal(k[3], known[0][3]) for k in known):
        return None
    before = np.cumsum([0, *(len(laws[2]) for laws in known)])
    spans = [laws[1] + start for laws, start in zip(known, before, strict=False)]
    join = np.concatenate
    return join([k[0] for k in known]), join(spans), join([k[2] for k in known]), known[0][3]
