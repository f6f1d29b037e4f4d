"""Histories of a hinge chain in the compiled loop."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pliant.interfaces.physics import Variation
from pliant.mechanics.kinematics import base_rotations
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import Followed, History
from pliant.records.law import JointLaw
from pliant.records.term import LawTerm
from pliant_plugins.physics.compiled.body import Body
from pliant_plugins.physics.compiled.functions import CompiledTerms
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.physics.quasistatic.kernel import follow
from pliant_plugins.physics.quasistatic.packing import Clock, Drive, LawTable, tabulate
from pliant_plugins.physics.stepping import Paths

# Tables reach this much beyond the actuation that occurs, so that fits may scale and shift it.
MARGIN = 0.5
MOST_TABLES = 64


@dataclass(eq=False)
class HingeFollower:
    """The compiled loop with the law tables that it need not make twice."""

    config: QuasistaticConfig
    tables: dict[tuple[int, float, float], tuple[JointLaw, LawTable]] = field(default_factory=dict)

    def follow(self, chain: ChainModel, histories: Sequence[History], towards: Sequence[Variation]) -> Paths:
        """See `PhysicsBackend.follow`."""
        longest = self.config.longest_step_s
        drive, clock = Drive.of(chain, histories), Clock.of(chain, histories, longest)
        changes, clocks = [], []
        for v in towards:
            same = chain.payload_kg == v.chain.payload_kg and chain.actuators == v.chain.actuators
            driven_alike = same and all(a is b for a, b in zip(histories, v.histories, strict=True))
            changes.append(drive if driven_alike else Drive.of(v.chain, v.histories))
            clocks.append(clock if driven_alike else Clock.of(v.chain, v.histories, longest))
        linear = [
            k
            for k, v in enumerate(towards)
            if _same_body(chain, v.chain)
            and np.array_equal(drive.angles, changes[k].angles)
            and np.array_equal(clock.duration, clocks[k].duration)
        ]
        q, dq, converged = self._run(
            chain, drive, clock, [towards[k].chain for k in linear], [changes[k] for k in linear]
        )
        paths = _split(histories, q, converged)
        differences: dict[int, tuple[Followed, ...]] = {}
        for row, k in enumerate(linear):
            differences[k] = _split(histories, dq[row], converged)
        for k in set(range(len(towards))) - set(linear):
            there, _, _ = self._run(towards[k].chain, changes[k], clocks[k], [], [])
            differences[k] = _split(histories, there - q, converged)
        return paths, tuple(differences[k] for k in range(len(towards)))

    def _run(
        self,
        chain: ChainModel,
        drive: Drive,
        clock: Clock,
        towards: Sequence[ChainModel],
        changes: Sequence[Drive],
    ) -> tuple[Array, Array, Any]:
        body, terms = Body.of(chain), CompiledTerms.of(chain.terms, chain.n_joints)
        tables = [self._table(law, drive.pressure) for law in chain.laws]
        n, m = drive.pressure.shape
        axis = int(body.axes[0])
        order = [(axis + 1) % 3, (axis + 2) % 3, axis]
        rests = np.ascontiguousarray(body.rests[:, order][:, :, order])

        def stack(rows: list[Array], *shape: int) -> Array:
            return np.ascontiguousarray(np.array(rows, float).reshape(len(rows), *shape))

        parameters = [CompiledTerms.of(c.terms, c.n_joints).parameters for c in towards]
        result: tuple[Array, Array, Any] = follow(
            (
                terms.addresses,
                terms.rows,
                terms.parameters.ravel(),
                tables[0].cells.ravel()
                if len(tables) == 1
                else np.concatenate([table.cells.ravel() for table in tables]),
                np.stack([table.grid for table in tables]),
                (*tables[0].cells.shape[:2], terms.parameters.shape[1]),
                np.array([actuator.sign for actuator in chain.actuators], float),
                any(term.role != "moment" for term in chain.terms),
            ),
            terms.keeps,
            np.array([joint.law for joint in chain.joints]),
            (
                body.position,
                np.ascontiguousarray(base_rotations(body.rotation, drive.angles)[:, :, order]),
                np.ascontiguousarray(body.offsets[:, order]),
                rests,
                np.array([np.array_equal(rest, np.eye(3)) for rest in rests]),
                np.ascontiguousarray(body.arms[:, order]),
                body.masses,
            ),
            np.asarray(chain.gravity_m_s2, float),
            (drive.pressure, drive.force, drive.moment, drive.payload, drive.temperature),
            (clock.duration, clock.start, clock.specimen, clock.n_specimens, clock.substeps),
            (
                stack(parameters, terms.parameters.size),
                stack([np.asarray(c.gravity_m_s2, float) for c in towards], 3),
                stack([d.pressure for d in changes], n, m),
                stack([d.force for d in changes], n, 3),
                stack([d.moment for d in changes], n),
                stack([d.payload for d in changes], n),
                stack([d.temperature for d in changes], n),
            ),
            (self.config.tolerance, self.config.max_iterations, self.config.max_turn),
        )
        return result

    def _table(self, law: JointLaw, pressure: Array) -> LawTable:
        """The law's table; one for all actuations within the same power of two."""
        reach = float(np.abs(pressure).max()) * (1.0 + MARGIN) or 1.0
        high = 2.0 ** math.ceil(math.log2(reach))
        low = -high if pressure.min() < -0.1 * high else -0.25 * high
        key = (id(law), low, high)
        if key not in self.tables:
            while len(self.tables) >= MOST_TABLES:  # effects that change laws make new ones at every trial
                self.tables.pop(next(iter(self.tables)))
            self.tables[key] = (law, tabulate(law, (low, high)))  # the law is kept: its id stays its own
        return self.tables[key][1]


def _same_body(chain: ChainModel, other: ChainModel) -> bool:
    """Whether two chains differ in gravity, payload and term parameters only."""
    return (
        [id(law) for law in chain.laws] == [id(law) for law in other.laws]
        and chain.actuators == other.actuators
        and _alike(chain.joints, other.joints)
        and _alike(chain.bodies, other.bodies)
        and np.array_equal(chain.base_rotation, other.base_rotation)
        and np.array_equal(chain.base_position_m, other.base_position_m)
        and np.array_equal(chain.tip_offset_m, other.tip_offset_m)
        and [_form(term) for term in chain.terms] == [_form(term) for term in other.terms]
    )


def _alike(pieces: Sequence[object], others: Sequence[object]) -> bool:
    """Whether joints or bodies are the same, number by number: effects that change chains make new ones."""
    if pieces is others:
        return True
    numbers = ((x, vars(b)[name]) for a, b in zip(pieces, others, strict=True) for name, x in vars(a).items())
    return all(np.array_equal(x, y) for x, y in numbers)


def _form(term: LawTerm) -> tuple[object, ...]:
    """What of a term must not change while its parameters do."""
    return term.function, term.role, term.keeps, term.n_states, term.n_parameters


def _split(histories: Sequence[History], q: Array, converged: Any) -> tuple[Followed, ...]:
    ends = np.cumsum([len(h) for h in histories])[:-1]
    pieces = zip(np.split(q[:, :, None], ends), np.split(converged, ends), strict=True)
    return tuple(Followed(*piece) for piece in pieces)
