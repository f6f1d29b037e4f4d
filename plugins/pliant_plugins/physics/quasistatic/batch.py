"""Many chains at once: packed together, then settled in one compiled call that releases Python's lock.

Python only lists the parts of a chain, under half of the work: two threads that each pack and settle their own chains
use two cores.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import accumulate, chain, pairwise
from typing import Any

import numpy as np
from numba import njit

from pliant.interfaces.physics import Case
from pliant.mechanics.efforts import JointEfforts
from pliant.mechanics.kinematics import AXES, main_axis
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, OutsideDomain
from pliant_plugins.physics.compiled.equilibrium import settle
from pliant_plugins.physics.compiled.laws import PackedLaws
from pliant_plugins.physics.quasistatic.compiled_solver import KINDS, NO_BODIES, NO_ROWS
from pliant_plugins.physics.quasistatic.newton import NewtonOptions

# A joint kind whose coordinates are all turns, and its axes.
Form = tuple[str, tuple[str, ...]]


def packing_form(case: Case) -> Form | None:
    """Return the properties that chains packed together must share; None for a chain that must be settled singly.

    Packed chains have no law terms, loads at points, cords or turned actuators, only rotations, and laws of one
    actuation each. Invalid cases are settled singly too, which raises the error messages.
    """
    of, given = case.chain, case.inputs
    law = of.laws[0] if of.laws else None
    if law is None or law.joint not in ("revolute", "spherical") or len(of.bodies) != len(of.joints) + 1:
        return None
    if of.terms or given.forces or given.cords:
        return None
    if any(actuator.rotation_rad or actuator.input not in given.actuation for actuator in of.actuators):
        return None
    same = all(one.joint == law.joint and one.axes == law.axes for one in of.laws)
    one_each = all(len(one.actuations) == 1 for one in of.laws)
    return (law.joint, law.axes) if same and one_each else None


class Batch:
    """Chains of one form, packed: joints, bodies, laws and loads of all in rows, one chain after another."""

    def __init__(self, cases: Sequence[Case], form: Form, laws: Sequence[PackedLaws]) -> None:
        self.cases, (kind, axes) = cases, form
        chains = [case.chain for case in cases]
        joints = [joint for one in chains for joint in one.joints]
        self._ends = _ends(len(one.joints) for one in chains)
        every = [(0, len(one.actuators)) for one in chains]
        drives = [
            (*(joint.drives or whole), 1)
            for one, whole in zip(chains, every, strict=True)
            for joint in one.joints
        ]
        of_chain = np.repeat(np.arange(len(chains)), np.diff(self._ends))
        first, count = _ends(len(one.counts) for one in laws)[of_chain], [len(one.counts) for one in laws]
        own = np.array([joint.law for joint in joints])
        self._known = bool(np.all((own >= 0) & (own < np.array(count)[of_chain])))
        law = first + own if self._known else first
        signs = [actuator.sign for one in chains for actuator in one.actuators]
        pressures = [case.inputs.actuation[a.input] for case in cases for a in case.chain.actuators]
        turned = np.array([AXES[axis] for axis in axes])
        self._of_all = (KINDS.index(kind), turned, main_axis(axes), np.ones(len(axes)))
        self._of_chain = (
            *(
                self._ends,
                _ends(len(one.actuators) for one in chains),
                _ends(len(one.parameters) for one in laws),
            ),
            np.array([one.base_position_m for one in chains], float),
            np.array([one.base_rotation for one in chains], float),
            np.array([one.gravity_m_s2 for one in chains], float),
            np.array([case.inputs.tip_force_n for case in cases], float),
            np.array([(case.inputs.moment_n_m, case.chain.payload_kg) for case in cases], float),
        )
        self._of_joint = (
            _rows([joint.offset_m for joint in joints]),
            _rows([joint.rest_rotation for joint in joints]).reshape(-1, 3, 3),
            np.concatenate([one.addresses for one in laws])[law],
            np.concatenate([one.spans for one in laws])[law],
            np.concatenate([one.less for one in laws])[law],
            np.concatenate([one.boxes for one in laws])[law],
            np.array(drives, np.int64),
        )
        # With the tip behind the bodies of each chain, a point without a mass.
        arms = ((*(body.com_m for body in one.bodies[1:]), one.tip_offset_m) for one in chains)
        masses = ((*(body.mass_kg for body in one.bodies[1:]), 0.0) for one in chains)
        self._of_body = (
            _rows(list(chain.from_iterable(arms))),
            np.array(list(chain.from_iterable(masses)), float),
        )
        self._of_law = (np.concatenate([one.parameters for one in laws]),)
        self._of_actuator = (np.array(signs, float), np.array(pressures, float))

    @property
    def sound(self) -> bool:
        """Return whether every law exists and every input is finite; the single settle raises the message otherwise."""
        return self._known and all(
            np.isfinite(one).all() for one in (*self._of_chain[5:], *self._of_actuator)
        )

    def settled(
        self, options: NewtonOptions, starts: Sequence[Array] | None = None
    ) -> list[Equilibrium | None]:
        """Settle each chain from its straight or a given state; None if the direct method found no equilibrium."""
        start, count = time.perf_counter(), len(self.cases)
        shape = self._ends[-1], len(self._of_all[1])
        q = np.zeros(shape) if starts is None else np.concatenate(starts).reshape(shape)
        markers, found = np.empty((self._ends[-1] + 2 * count, 3)), np.empty((count, 5))
        packed = (
            self._of_all,
            self._of_chain,
            self._of_joint,
            self._of_body,
            self._of_law,
            self._of_actuator,
        )
        settle_many(packed, (NO_BODIES, NO_ROWS, np.zeros(0)), tuple(options), q, markers, found)
        each_s = (time.perf_counter() - start) / count
        ends = list(pairwise(self._ends.tolist()))
        one = partial(_equilibrium, each_s=each_s)
        return [
            one(case, q[first:last], markers[first + 2 * k : last + 2 * k + 2], row)
            for k, (case, (first, last), row) in enumerate(zip(self.cases, ends, found.tolist(), strict=True))
        ]


def _equilibrium(
    case: Case, q: Array, markers: Array, row: Sequence[float], each_s: float
) -> Equilibrium | None:
    converged, stable, size, iterations, outside = row
    if not converged:
        return None
    left: tuple[OutsideDomain, ...] = ()
    if outside:
        left = JointEfforts(case.chain).outside_domain(q, case.inputs.actuation)
    return Equilibrium(
        q.copy(), markers.copy(), size, True, bool(stable), int(iterations), each_s, outside_domain=left
    )


def _rows(points: Sequence[Array]) -> Array:
    """Stack arrays of threes, (…, 3): many times faster than `np.array`."""
    return np.asarray(np.concatenate(points), float).reshape(-1, 3)


def _ends(counts: Iterable[int]) -> Any:
    """Return the offset of each piece, followed by the total."""
    return np.array([0, *accumulate(counts)], np.int64)


def settle_together(
    cases: Sequence[Case],
    laws_of: Callable[[ChainModel], PackedLaws | None],
    options: NewtonOptions,
    starts: Sequence[Array] | None = None,
) -> dict[int, Equilibrium]:
    """Return equilibria, by index, of the cases that can be packed and that the direct method settles.

    Args:
        laws_of: the packed laws of a chain, or None.
        starts: coordinates (n, a) that each begins with; by default the straight state.
    """
    packs: dict[Form, list[tuple[int, PackedLaws]]] = {}
    for place, case in enumerate(cases):
        form = packing_form(case)
        laws = laws_of(case.chain) if form else None
        if form and laws is not None:
            packs.setdefault(form, []).append((place, laws))
    settled: dict[int, Equilibrium] = {}
    for form, members in packs.items():
        batch = Batch([cases[place] for place, _ in members], form, [laws for _, laws in members])
        begun = None if starts is None else [starts[place] for place, _ in members]
        if batch.sound:
            found = zip(members, batch.settled(options, begun), strict=True)
            settled |= {place: one for (place, _), one in found if one is not None}
    return settled


@njit(cache=True, nogil=True)
def settle_many(packed, unloaded, options, q, markers, found):  # type: ignore[no-untyped-def]
    """Fill q (J, a), markers (J + 2 C, 3) and found (C, 5), the output of `settle`, of C chains with J joints.

    Args:
        packed: see `Batch`; unloaded: the arrays of no loads at points and of no cords.
    """
    of_all, of_chain, of_joint, of_body, of_law, of_actuator = packed
    kind, axes, main, reach = of_all
    ends, actuators, numbers, positions, rotations, gravity, tip, others = of_chain
    offsets, rests, addresses, spans, less, boxes, drives = of_joint
    bodies, rows, none = unloaded
    for c in range(len(ends) - 1):
        i, j, k, m = ends[c], ends[c + 1], actuators[c], actuators[c + 1]
        first, last = i + c, j + c + 1
        body = (kind, axes, main, positions[c], rotations[c], offsets[i:j], rests[i:j])
        whole = (*body, of_body[0][first:last], of_body[1][first:last], reach)
        parameters = of_law[0][numbers[c] : numbers[c + 1]]
        laws = (addresses[i:j], spans[i:j], parameters, of_actuator[0][k:m], drives[i:j], less[i:j])
        loads = (of_actuator[1][k:m], gravity[c], tip[c], others[c, 0], others[c, 1])
        all_loads = (*loads, bodies, rows, rows, bodies, rows, rows, none)
        here = markers[i + 2 * c : j + 2 * c + 2]
        converged, stable, size, steps, outside = settle(
            whole, laws, boxes[i:j], all_loads, q[i:j], here, options
        )
        found[c, 0], found[c, 1], found[c, 2], found[c, 3], found[c, 4] = (
            converged,
            stable,
            size,
            steps,
            outside,
        )
