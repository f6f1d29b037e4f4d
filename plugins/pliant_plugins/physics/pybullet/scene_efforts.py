"""Efforts of all arms of a scene at once: arms under the same actuation are one list of joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pliant.mechanics.efforts import JointEfforts
from pliant.mechanics.statics import Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant_plugins.physics.compiled.efforts import efforts
from pliant_plugins.physics.compiled.laws import CompiledLaws


class SceneEfforts:
    """Evaluates the laws of arms; coordinates of an arm have shape (n, a)."""

    def __init__(self, chains: Sequence[ChainModel]) -> None:
        self._chains = chains
        self._joined: dict[tuple[int, ...], _Joined] = {}
        self._groups: list[tuple[tuple[int, ...], Loads]] = []

    def under(self, loads: Sequence[Loads]) -> None:
        """Actuation and end moments of every arm from now on."""
        groups: list[tuple[list[int], Loads]] = []
        for number, load in enumerate(loads):
            for members, theirs in groups:
                if self._alike(members[0], number) and theirs.actuation == load.actuation:
                    members.append(number)
                    break
            else:
                groups.append(([number], load))
        self._groups = [(tuple(members), load) for members, load in groups]
        for key, _ in self._groups:
            if key not in self._joined:
                self._joined[key] = _Joined.of([self._chains[k] for k in key])

    def evaluate(self, coordinates: Sequence[Array]) -> list[Array]:
        """(n, a) efforts of the laws of each arm, without end moments."""
        found: list[Array] = [np.empty(0)] * len(coordinates)
        for members, load in self._groups:
            joined = self._joined[members]
            tau = joined.evaluate(np.concatenate([coordinates[k] for k in members]), load)
            for k, joints in zip(members, joined.joints, strict=True):
                found[k] = tau[joints]
        return found

    def _alike(self, one: int, other: int) -> bool:
        a, b = self._chains[one], self._chains[other]
        same_joints = a.laws[0].joint == b.laws[0].joint and a.axes == b.axes
        return same_joints and a.actuators == b.actuators and a.terms == b.terms


@dataclass(frozen=True, eq=False)
class _Joined:
    """Joints of several arms as one list; `joints` are those of each arm in it."""

    laws: CompiledLaws | None
    efforts: JointEfforts
    joints: tuple[slice, ...]

    @staticmethod
    def of(chains: Sequence[ChainModel]) -> _Joined:
        laws = list(dict.fromkeys(law for chain in chains for law in chain.laws))
        joints = tuple(
            replace(joint, law=laws.index(chain.laws[joint.law]))
            for chain in chains
            for joint in chain.joints
        )
        joined = chains[0].with_(joints=joints, laws=tuple(laws))
        compiled = None if joined.terms else CompiledLaws.of(joined)
        ends = np.cumsum([0, *(chain.n_joints for chain in chains)]).tolist()
        spans = tuple(slice(first, last) for first, last in pairwise(ends))
        return _Joined(compiled, JointEfforts(joined), spans)

    def evaluate(self, q: Array, load: Loads) -> Array:
        if self.laws is None:
            return self.efforts.evaluate(q, load.actuation).tau
        n, a = q.shape
        values = self.efforts.values(load.actuation)
        tau = np.empty((n, a))
        efforts(self.laws.arrays, q, values, tau, np.empty((len(values), n, a)), np.empty((n, a, a)))
        return tau
