"""Histories of a hinge chain in the compiled loop: chain and runs as arrays, laws as tables of bicubic cells.

Laws of several actuations are called as they are: tables over all of them would be large, or coarse.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from pliant.interfaces.physics import Variation
from pliant.mechanics.kinematics import base_rotations
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import Followed, History, run_by_run
from pliant.records.law import JointLaw
from pliant.records.term import LawTerm
from pliant_plugins.physics.compiled.laws import CompiledTerms, PackedLaws
from pliant_plugins.physics.quasistatic.compiled_solver import Body
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.physics.quasistatic.kernel import follow
from pliant_plugins.physics.stepping import Paths, check_driven, n_parts

# Tables reach this much beyond the actuation that occurs, so that fits may scale and shift it.
MARGIN = 0.5
MOST_TABLES = 64


class Drive(NamedTuple):
    """What changes from sample to sample, of all runs one after another: N samples, m actuators."""

    pressure: Array
    force: Array
    moment: Array
    payload: Array
    temperature: Array
    angles: Array

    @staticmethod
    def of(chain: ChainModel, histories: Sequence[History]) -> Drive:
        """Raises `UserError` where a history lacks an input of the chain, or a number of it."""
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
        return drive


class Clock(NamedTuple):
    """Time and order: duration of the step to each sample, whether a run starts there, whose specimen it is."""

    duration: Array
    start: Any
    specimen: Any
    n_specimens: int
    substeps: Any

    @staticmethod
    def of(chain: ChainModel, histories: Sequence[History], longest_step_s: float) -> Clock:
        """Steps longer than `longest_step_s` are cut into equal parts.

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


PRESSURE_NODES = 33
ANGLE_NODES = 241
# Cubic Hermite basis on [0, 1]: coefficients of 1, x, x², x³ from value and slope at both ends.
HERMITE = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [-3, 3, -2, -1], [2, -2, 1, 1]], float)


class LawTable(NamedTuple):
    """cells (p, u, 4, 4): coefficients of xᵃ yᵇ in each; grid: first p, step, first u, step."""

    cells: Array
    grid: Array


def tabulate(law: JointLaw, actuation: tuple[float, float]) -> LawTable:
    """Cells over the given actuation and the law's domain with as much again on both sides.

    Values and first slopes of τ agree with the law at the nodes; between them the error is of fourth order in
    the spacing. A law without a domain is tabulated over ±π.
    """
    p = np.linspace(*actuation, PRESSURE_NODES)
    low, high = law.domain.deformation[0]
    if np.isfinite(low) and np.isfinite(high):
        width = high - low
        low, high = max(-np.pi, low - width), min(np.pi, high + width)
    else:
        low, high = -np.pi, np.pi
    u = np.linspace(low, high, ANGLE_NODES)
    grid_p, grid_u = np.meshgrid(p, u, indexing="ij")
    effort = law.evaluate(grid_p.ravel(), grid_u.reshape(-1, 1))
    shape, dp, du = grid_p.shape, p[1] - p[0], u[1] - u[0]
    value = effort.tau.reshape(shape)
    in_p, in_u = effort.dtau_dp.reshape(shape) * dp, effort.dtau_du.reshape(shape) * du
    mixed = np.gradient(in_u, axis=0, edge_order=2)
    corners = np.empty((len(p) - 1, len(u) - 1, 4, 4))
    for row, (by_value, by_u) in enumerate(((value, in_u), (in_p, mixed))):
        for end in range(2):
            rows = slice(end, len(p) - 1 + end)
            for side in range(2):
                columns = slice(side, len(u) - 1 + side)
                corners[:, :, 2 * row + end, side] = by_value[rows, columns]
                corners[:, :, 2 * row + end, 2 + side] = by_u[rows, columns]
    # HERMITE @ corners @ HERMITE.T of every cell, as one product of two matrices: much faster.
    cells = corners.reshape(-1, 16) @ np.kron(HERMITE, HERMITE).T
    return LawTable(cells.reshape(corners.shape), np.array([p[0], dp, u[0], du]))


class WideLaws(NamedTuple):
    """Laws of several actuations as the loop calls them: addresses (l,), spans (l, 2) of the parameters (P,).

    `around` (l, 2) has α and γ of `JointLaw.behind`; then come as many zeros as a law may have actuations, and space
    for one call: deformation, effort, its slopes by all of them and by the deformation.
    """

    addresses: Any
    spans: Any
    parameters: Array
    around: Array
    zeros: Array
    at: Array
    value: Array
    by_a: Array
    by_u: Array

    @staticmethod
    def of(laws: Sequence[JointLaw]) -> WideLaws | None:
        """None where one of them has no scalar form."""
        known = [law.behind() for law in laws]
        packed = PackedLaws.of([law for law, _, _ in known])
        if packed is None:
            return None
        around = np.array([number for _, *number in known], float).reshape(-1, 2)
        most = max(packed.counts, default=1)
        space = (np.zeros(most), np.empty(1), np.empty(1), np.empty(most), np.empty((1, 1)))
        return WideLaws(packed.addresses, packed.spans, packed.parameters, around, *space)


def is_wide(law: JointLaw) -> bool:
    """Whether a law takes several actuations at once."""
    return len(law.actuations) > 1


@dataclass(eq=False)
class HingeFollower:
    """The compiled loop with the law tables that it need not make twice."""

    config: QuasistaticConfig
    tables: dict[tuple[int, float, float], tuple[JointLaw, LawTable]] = field(default_factory=dict)
    lock: Any = field(default_factory=Lock)  # fits may run in threads

    def __reduce__(self) -> tuple[Any, ...]:
        """As it travels to a worker: without its tables."""
        return HingeFollower, (self.config,)

    def takes(self, chain: ChainModel) -> bool:
        """Whether the loop can follow this chain: hinges, with laws of one actuation or with a scalar form."""
        hinges = chain.laws[0].joint == "revolute"
        return hinges and WideLaws.of([law for law in chain.laws if is_wide(law)]) is not None

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
        q, dq, converged = self._run(chain, drive, clock, [(towards[k].chain, changes[k]) for k in linear])
        paths = _split(histories, q, converged)
        differences: dict[int, tuple[Followed, ...]] = {}
        for row, k in enumerate(linear):
            differences[k] = _split(histories, dq[row], converged)
        for k in set(range(len(towards))) - set(linear):
            there, _, _ = self._run(towards[k].chain, changes[k], clocks[k], [])
            differences[k] = _split(histories, there - q, converged)
        return paths, tuple(differences[k] for k in range(len(towards)))

    def _run(
        self, chain: ChainModel, drive: Drive, clock: Clock, towards: Sequence[tuple[ChainModel, Drive]]
    ) -> tuple[Array, Array, Any]:
        body, terms = Body.of(chain), CompiledTerms.of(chain.terms, chain.n_joints)
        wide = [law for law in chain.laws if is_wide(law)]
        narrow = [law for law in chain.laws if not is_wide(law)]
        # Where each law stands among those of its kind.
        place = [
            sum(is_wide(law) == is_wide(other) for other in chain.laws[:k])
            for k, law in enumerate(chain.laws)
        ]
        acting = [_acting(chain, law, drive.pressure) for law in narrow]
        tables = [self._table(law, values) for law, values in zip(narrow, acting, strict=True)]
        axis = int(body.axes[0])
        order = [(axis + 1) % 3, (axis + 2) % 3, axis]
        rests = np.ascontiguousarray(body.rests[:, order][:, :, order])

        def stack(rows: Sequence[Array], like: Array) -> Array:
            return np.ascontiguousarray(np.array(rows, float).reshape(len(rows), *like.shape))

        gravity, flat = np.asarray(chain.gravity_m_s2, float), terms.arrays
        parameters = [CompiledTerms.of(c.terms, c.n_joints).parameters for c, _ in towards]
        gravities = [np.asarray(c.gravity_m_s2, float) for c, _ in towards]
        cells = [table.cells.ravel() for table in tables] or [np.zeros(0)]
        drives = [(*chain.drives_of(joint), len(chain.laws[joint.law].actuations)) for joint in chain.joints]
        result: tuple[Array, Array, Any] = follow(
            (
                flat,
                cells[0] if len(cells) == 1 else np.concatenate(cells),
                np.array([table.grid for table in tables]).reshape(-1, 4),
                (PRESSURE_NODES - 1, ANGLE_NODES - 1),
                np.array([actuator.sign for actuator in chain.actuators], float),
                any(term.role != "moment" for term in chain.terms),
                np.array(drives, np.int64),
                tuple(WideLaws.of(wide) or ()),
            ),
            terms.keeps,
            np.array([place[joint.law] for joint in chain.joints]),
            (
                body.position,
                np.ascontiguousarray(base_rotations(body.rotation, drive.angles)[:, :, order]),
                np.ascontiguousarray(body.offsets[:, order]),
                rests,
                np.array([np.array_equal(rest, np.eye(3)) for rest in rests]),
                np.ascontiguousarray(body.arms[:, order]),
                body.masses,
            ),
            gravity,
            tuple(drive[:5]),
            tuple(clock),
            (
                stack(parameters, flat[2]),
                stack(gravities, gravity),
                *(stack([d[k] for _, d in towards], drive[k]) for k in range(5)),
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
        with self.lock:
            if key not in self.tables:
                while (
                    len(self.tables) >= MOST_TABLES
                ):  # effects that change laws make new ones at every trial
                    self.tables.pop(next(iter(self.tables)))
                self.tables[key] = (law, tabulate(law, (low, high)))  # the law is kept: its id stays its own
            return self.tables[key][1]


def _acting(chain: ChainModel, law: JointLaw, pressure: Array) -> Array:
    """Those columns of the actuators' values that act on joints with this law; all where no joint has it."""
    spans = {chain.drives_of(joint) for joint in chain.joints if chain.laws[joint.law] is law}
    columns = sorted({k for first, last in spans for k in range(first, last)})
    return pressure[:, columns] if columns else pressure


def _same_body(chain: ChainModel, other: ChainModel) -> bool:
    """Whether two chains differ in gravity, payload and term parameters only."""

    def alike(pieces: Sequence[object], others: Sequence[object]) -> bool:
        """Joints or bodies, number by number: effects that change chains make new ones."""
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


def _split(histories: Sequence[History], q: Array, converged: Any) -> tuple[Followed, ...]:
    pieces = zip(run_by_run(q[:, :, None], histories), run_by_run(converged, histories), strict=True)
    return tuple(Followed(*piece) for piece in pieces)
