"""Laws and law terms of a chain's joints in compiled calls, step by step."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pliant.mechanics.statics import Loads
from pliant.mechanics.terms import Memory
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant_plugins.physics.compiled.laws import CompiledLaws
from pliant_plugins.physics.compiled.motion import drive_step, remember_step
from pliant_plugins.physics.compiled.terms import compiled_terms

if TYPE_CHECKING:
    from pliant_plugins.physics.mujoco.joints import ChainJoints


class LawsWithTerms:
    """See `of`; loads carry a memory with the finite duration of the step."""

    def __init__(self, laws: CompiledLaws, terms: Any, joints: ChainJoints) -> None:
        self._laws, self._terms = laws.arrays, terms
        self._efforts = joints.statics.efforts
        self._views = joints.views()[:4]
        self._joints = (joints.ball, np.resize(joints.order, 3).astype(np.int64), joints.main)

    @staticmethod
    def of(chain: ChainModel, laws: CompiledLaws | None, joints: ChainJoints) -> LawsWithTerms | None:
        """None where the chain has no terms, or one of them or a law is not compiled."""
        terms = compiled_terms(chain.terms, chain.n_joints) if chain.terms else None
        return None if laws is None or terms is None else LawsWithTerms(laws, terms, joints)

    def drive(self, loads: Loads, damping: float) -> None:
        """Force and damping of the dofs for the step to come."""
        memory = _of(loads)
        past = memory.previous, memory.states
        options = memory.dt_s, damping
        drive_step(self._laws, self._terms, self._joints, self._views, self._now(loads), options, past)

    def advance(self, loads: Loads) -> Memory:
        """The memory after a step that ended where the chain is."""
        memory = _of(loads)
        past = memory.previous.copy(), memory.states.copy()
        now = self._now(loads)
        remember_step(self._laws, self._terms, self._joints, self._views[0], now, memory.dt_s, past)
        return replace(memory, previous=past[0], states=past[1])

    def _now(self, loads: Loads) -> tuple[Array, float, float]:
        values = self._efforts.values(loads.actuation)
        return values, float(loads.moment_n_m), float(_of(loads).temperature_c)


def _of(loads: Loads) -> Memory:
    assert loads.memory is not None
    return loads.memory
