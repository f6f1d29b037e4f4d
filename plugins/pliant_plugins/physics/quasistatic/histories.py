"""Histories of a chain in the compiled loop: chain and runs as arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.physics import Variation
from pliant.mechanics.kinematics import ChainGeometry, base_rotations
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import Followed, History, run_by_run
from pliant.records.law import JointLaw
from pliant.records.term import LawTerm, term_parameters
from pliant_plugins.physics.compiled.laws import CompiledTerms
from pliant_plugins.physics.quasistatic.compiled_solver import NO_BODIES, NO_ROWS, Body
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.physics.quasistatic.joint_effort import new_space
from pliant_plugins.physics.quasistatic.kernel import follow, follow_spatial
from pliant_plugins.physics.quasistatic.loop_laws import (
    ANGLE_NODES,
    PRESSURE_NODES,
    CalledLaws,
    LawTable,
    WideLaws,
    is_wide,
    tabulate,
)
from pliant_plugins.physics.stepping import Paths, check_driven, n_parts

# Tables reach this much beyond the actuation that occurs, so that fits may scale and shift it.
MARGIN = 0.5
MOST_TABLES = 64


class Drive(NamedTuple):
    """Inputs at the samples of all runs one after another: N samples, m actuators."""

    pressure: Array
    force: Array
    moment: Array
    payload: Array
    temperature: Array
    angles: Array

    @staticmethod
    def from_histories(chain: ChainModel, histories: Sequence[History]) -> Drive:
        """Collect the inputs. Raises `UserError` if a history lacks an input of the chain, or a number of it."""
        join = np.concatenate
        if any(a.input not in h.actuation for a in chain.actuators for h in histories):
            check_driven(chain, histories)
        pressures = [join([h.actuation[a.input] for h in histories]) for a in chain.actuators]
        payloads = (
            np.full(len(h), chain.payload_kg if h.payload_kg is None else h.payload_kg) for h in histories
        )
        drive = Drive(
            np.stack(pressures, axis=1),
            join([h.tip_force_n for h in histories]),
            join([h.moment_n_m for h in histories]),
            join(list(payloads)),
            join([h.temperature_c for h in histories]),
            join([h.base_angles_rad for h in histories]),
        )
        if not all(np.all(np.isfinite(values)) for values in drive):
            check_driven(chain, histories)
        if chain.laws[0].joint == "prismatic" and drive.moment.any():
            raise UserError("a chain of prismatic joints takes no end moment: leave moment_n_m at 0")
        return drive


class Clock(NamedTuple):
    """Time and order: duration of the step to each sample, whether a run starts there, whose specimen it is."""

    duration: Array
    start: Any
    specimen: Any
    n_specimens: int
    substeps: Any

    @staticmethod
    def from_histories(chain: ChainModel, histories: Sequence[History], longest_step_s: float) -> Clock:
        """Divide steps longer than `longest_step_s` into equal parts.

        Raises:
            UserError: a time that is not a number.
        """
        names = list(dict.fromkeys(h.specimen for h in histories))
        lengths = [len(h) for h in histories]
        first = np.cumsum([0, *lengths[:-1]])
        timed = [h.time_s is not None for h in histories]
        time = np.concatenate([np.zeros(len(h)) if h.time_s is None else h.time_s for h in histories])
        if not np.all(np.isfinite(time)):
            check_driven(chain, histories)
        duration = np.diff(time, prepend=time[:1])
        duration[first] = 0.0
        duration[~np.repeat(timed, lengths)] = np.inf
        start = np.zeros(len(duration), np.bool_)
        start[first] = True
        specimen = np.repeat([names.index(h.specimen) for h in histories], lengths)
        finite = np.where(np.isfinite(duration), duration, 0.0)
        return Clock(duration, start, specimen, len(names), n_parts(finite, longest_step_s))


@dataclass(eq=False)
class Follower:
    """The compiled loop with the law tables that it need not make twice."""

    config: QuasistaticConfig
    tables: dict[tuple[int, float, float], tuple[JointLaw, LawTable]] = field(default_factory=dict)
    lock: Any = field(default_factory=Lock)  # fits may run in threads

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle for a worker, without the tables."""
        return Follower, (self.config,)

    def takes(self, chain: ChainModel) -> bool:
        """Return whether the loop can follow this chain: its laws have a scalar form, or are tabulated."""
        return CalledLaws.from_laws([law for law in chain.laws if not is_tabulated(law)]) is not None

    def follow(self, chain: ChainModel, histories: Sequence[History], towards: Sequence[Variation]) -> Paths:
        """See `PhysicsBackend.follow`."""
        longest = self.config.longest_step_s
        drive, clock = Drive.from_histories(chain, histories), Clock.from_histories(chain, histories, longest)
        changes, clocks = [], []
        for v in towards:
            same = chain.payload_kg == v.chain.payload_kg and chain.actuators == v.chain.actuators
            driven_alike = same and all(a is b for a, b in zip(histories, v.histories, strict=True))
            changes.append(drive if driven_alike else Drive.from_histories(v.chain, v.histories))
            clocks.append(clock if driven_alike else Clock.from_histories(v.chain, v.histories, longest))
        linear = [
            k
            for k, v in enumerate(towards)
            if _same_body(chain, v.chain)
            and np.array_equal(drive.angles, changes[k].angles)
            and np.array_equal(clock.duration, clocks[k].duration)
        ]
        still = [
            k for k in linear if _same_numbers(chain, towards[k].chain) and _same_drive(drive, changes[k])
        ]
        moving = [k for k in linear if k not in still]
        q, dq, converged = self._run(chain, drive, clock, [(towards[k].chain, changes[k]) for k in moving])
        shape = (len(q), chain.n_joints, len(chain.axes))
        paths = _split(histories, q.reshape(shape), converged)
        differences: dict[int, tuple[Followed, ...]] = {}
        for k in still:  # readings change, joints do not
            differences[k] = _split(histories, np.zeros(shape), converged)
        for row, k in enumerate(moving):
            differences[k] = _split(histories, dq[row].reshape(shape), converged)
        for k in set(range(len(towards))) - set(linear):
            there, _, _ = self._run(towards[k].chain, changes[k], clocks[k], [])
            differences[k] = _split(histories, (there - q).reshape(shape), converged)
        return paths, tuple(differences[k] for k in range(len(towards)))

    def _run(
        self, chain: ChainModel, drive: Drive, clock: Clock, towards: Sequence[tuple[ChainModel, Drive]]
    ) -> tuple[Array, Array, Any]:
        """Return coordinates (N, n·a), their first-order changes (K, N, n·a), and convergence of each sample (N,)."""
        terms = CompiledTerms.from_terms(chain.terms, chain.n_joints)
        hinges = chain.laws[0].joint == "revolute"
        model, laws, body = (self._hinges if hinges else _spatial)(chain, terms, drive)
        gravity = np.asarray(chain.gravity_m_s2, float)
        parameters = [CompiledTerms.from_terms(c.terms, c.n_joints).parameters for c, _ in towards]
        gravities = [np.asarray(c.gravity_m_s2, float) for c, _ in towards]
        loop: Any = follow if hinges else follow_spatial
        units = np.tile(1.0 / ChainGeometry.from_chain(chain).reach, chain.n_joints)
        result: tuple[Array, Array, Any] = loop(
            model,
            terms.keeps,
            laws,
            body,
            gravity,
            tuple(drive[:5]),
            (*clock, _numbers_by_run(clock, (chain, drive), towards)),
            (
                _stack(parameters, terms.arrays[2]),
                _stack(gravities, gravity),
                *(_stack([d[k] for _, d in towards], drive[k]) for k in range(5)),
            ),
            (self.config.tolerance, self.config.max_iterations, self.config.max_turn, units),
        )
        return result

    def _hinges(self, chain: ChainModel, terms: CompiledTerms, drive: Drive) -> tuple[Any, Any, Any]:
        """Return model, joint laws and body as arguments of `kernel.follow`."""
        body = Body.from_chain(chain)
        wide = [law for law in chain.laws if is_wide(law)]
        narrow = [law for law in chain.laws if not is_wide(law)]
        # Index of each law among those of its kind.
        place = [
            sum(is_wide(law) == is_wide(other) for other in chain.laws[:k])
            for k, law in enumerate(chain.laws)
        ]
        acting = [_acting(chain, law, drive.pressure) for law in narrow]
        tables = [self._table(law, values) for law, values in zip(narrow, acting, strict=True)]
        axis = int(body.axes[0])
        order = [(axis + 1) % 3, (axis + 2) % 3, axis]
        rests = np.ascontiguousarray(body.rests[:, order][:, :, order])

        cells = [table.cells.ravel() for table in tables] or [np.zeros(0)]
        model = (
            terms.arrays,
            cells[0] if len(cells) == 1 else np.concatenate(cells),
            np.array([table.grid for table in tables]).reshape(-1, 4),
            (PRESSURE_NODES - 1, ANGLE_NODES - 1),
            np.array([actuator.sign for actuator in chain.actuators], float),
            _is_split(chain),
            _drives(chain),
            tuple(WideLaws.from_laws(wide) or ()),
        )
        placed = (
            body.position,
            np.ascontiguousarray(base_rotations(body.rotation, drive.angles)[:, :, order]),
            np.ascontiguousarray(body.offsets[:, order]),
            rests,
            np.array([np.array_equal(rest, np.eye(3)) for rest in rests]),
            np.ascontiguousarray(body.arms[:, order]),
            body.masses,
        )
        return model, np.array([place[joint.law] for joint in chain.joints]), placed

    def _table(self, law: JointLaw, pressure: Array) -> LawTable:
        """Return the law's table; one for all actuations within the same power of two."""
        reach = float(np.abs(pressure).max()) * (1.0 + MARGIN) or 1.0
        high = 2.0 ** math.ceil(math.log2(reach))
        low = -high if pressure.min() < -0.1 * high else -0.25 * high
        key = (id(law), low, high)
        with self.lock:
            if key not in self.tables:
                while (
                    len(self.tables) >= MOST_TABLES
                ):  # effects that change laws make new ones at every trial
                    self.tables.pop(next(iter(self.tables)))
                self.tables[key] = (law, tabulate(law, (low, high)))  # the law is kept: its id stays its own
            return self.tables[key][1]


def is_tabulated(law: JointLaw) -> bool:
    """Return whether the loop interpolates a law in a table and needs no scalar form: hinges under one actuation."""
    return law.joint == "revolute" and not is_wide(law)


def _spatial(chain: ChainModel, terms: CompiledTerms, drive: Drive) -> tuple[Any, Any, Any]:
    """Return model, joint laws and body as arguments of `kernel.follow_spatial`."""
    body, laws, a = Body.from_chain(chain), CalledLaws.from_laws(chain.laws), len(chain.axes)
    assert laws is not None
    model = (
        terms.arrays,
        tuple(laws),
        np.array([actuator.turn(a) for actuator in chain.actuators], float).reshape(-1, a, a),
        new_space(a, max(len(law.actuations) for law in chain.laws)),
        np.array([actuator.sign for actuator in chain.actuators], float),
        _is_split(chain),
        _drives(chain),
        np.zeros(len(chain.actuators)),
    )
    placed = (
        body.kind,
        np.ascontiguousarray(base_rotations(body.rotation, drive.angles)),
        body.axes,
        body.main,
        *(body.position, body.offsets, body.rests, body.arms, body.masses, body.reach),
        (NO_BODIES, NO_ROWS, np.zeros(0)),
    )
    return model, np.array([joint.law for joint in chain.joints]), placed


def _drives(chain: ChainModel) -> Any:
    """Return (n, 3) first and last (exclusive) actuator of each joint, and the number of its law's actuations."""
    spans = [(*chain.actuator_range(joint), len(chain.laws[joint.law].actuations)) for joint in chain.joints]
    return np.array(spans, np.int64)


def _is_split(chain: ChainModel) -> bool:
    """Return whether a term acts on the elastic or the actuation part of the laws alone."""
    return any(term.role != "moment" for term in chain.terms)


def _numbers_by_run(
    clock: Clock, base: tuple[ChainModel, Drive], towards: Sequence[tuple[ChainModel, Drive]]
) -> tuple[Array, Array]:
    """Return the terms' numbers under the payload of each run: (R, n·P), and (K, R, n·P) of the variations.

    Both are empty (R = 0) if no term depends on the payload or no run has another payload than its chain.
    """
    begins = np.flatnonzero(clock.start)
    every = [(chain, drive.payload[begins] - chain.payload_kg) for chain, drive in (base, *towards)]
    width = term_parameters(base[0].terms, base[0].n_joints).size
    if not any(more.any() and any(term.per_payload_kg for term in chain.terms) for chain, more in every):
        return np.zeros((0, width)), np.zeros((len(towards), 0, width))
    numbers = [
        [
            term_parameters([term.carrying(float(kg)) for term in chain.terms], chain.n_joints).ravel()
            for kg in more
        ]
        for chain, more in every
    ]
    return np.array(numbers[0]), np.array(numbers[1:]).reshape(len(towards), len(begins), width)


def _stack(rows: Sequence[Array], like: Array) -> Array:
    return np.ascontiguousarray(np.array(rows, float).reshape(len(rows), *like.shape))


def _acting(chain: ChainModel, law: JointLaw, pressure: Array) -> Array:
    """Return the columns of the actuators' values that act on joints with this law; all if no joint has it."""
    spans = {chain.actuator_range(joint) for joint in chain.joints if chain.laws[joint.law] is law}
    columns = sorted({k for first, last in spans for k in range(first, last)})
    return pressure[:, columns] if columns else pressure


def _same_body(chain: ChainModel, other: ChainModel) -> bool:
    """Return whether two chains differ in gravity, payload and term parameters only."""

    def alike(pieces: Sequence[object], others: Sequence[object]) -> bool:
        """Compare joints or bodies, number by number: effects that change chains make new ones."""
        pairs = zip(pieces, others, strict=True)
        numbers = ((x, vars(b)[name]) for a, b in pairs for name, x in vars(a).items())
        return pieces is others or all(np.array_equal(x, y) for x, y in numbers)

    def forms(terms: Sequence[LawTerm]) -> list[tuple[object, ...]]:
        return [(t.function, t.role, t.keeps, t.n_states, t.n_parameters) for t in terms]

    bases = ("base_rotation", "base_position_m", "tip_offset_m")
    return (
        [id(law) for law in chain.laws] == [id(law) for law in other.laws]
        and chain.actuators == other.actuators
        and alike(chain.joints, other.joints)
        and alike(chain.bodies, other.bodies)
        and all(np.array_equal(getattr(chain, name), getattr(other, name)) for name in bases)
        and forms(chain.terms) == forms(other.terms)
    )


def _same_numbers(chain: ChainModel, other: ChainModel) -> bool:
    """Return whether two chains of the same body have the same gravity and term parameters."""
    here, there = (term_parameters(one.terms, one.n_joints) for one in (chain, other))
    return np.array_equal(chain.gravity_m_s2, other.gravity_m_s2) and np.array_equal(here, there)


def _same_drive(drive: Drive, other: Drive) -> bool:
    return other is drive or all(np.array_equal(a, b) for a, b in zip(drive, other, strict=True))


def _split(histories: Sequence[History], q: Array, converged: Any) -> tuple[Followed, ...]:
    pieces = zip(run_by_run(q, histories), run_by_run(converged, histories), strict=True)
    return tuple(Followed(*piece) for piece in pieces)
