"""The compiled way to the equilibrium of a chain, for one and for many that share laws and geometry."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from pliant.mechanics.efforts import actuation_values
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.statics import Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Inputs, Response
from pliant_plugins.physics.compiled.equilibrium import settle
from pliant_plugins.physics.compiled.laws import CompiledLaws, PackedLaws
from pliant_plugins.physics.compiled.response import respond as compiled_respond
from pliant_plugins.physics.quasistatic.newton import (
    ChainSolution,
    NewtonOptions,
    Responder,
    Solver,
)

KINDS = ("revolute", "spherical", "prismatic", "extensible")
MOST_PACKS = 256
NO_ROWS, NO_BODIES = np.zeros((0, 3)), np.zeros(0, np.int64)


class Body(NamedTuple):
    """Constants of a chain: kind of joint, its axes (a,), position, base rotation, offsets, rest rotations.

    `arms` and `masses` have n + 1 entries: the moving bodies' centres of mass, then the tip without a mass. `reach` is
    `ChainGeometry.relative_reach`. The travel of an extensible joint is the last coordinate, along the child's x.
    """

    kind: int
    axes: Any
    main: int
    position: Array
    rotation: Array
    offsets: Array
    rests: Array
    arms: Array
    masses: Array
    reach: Array

    @staticmethod
    def from_chain(chain: ChainModel) -> Body:
        geometry = ChainGeometry.from_chain(chain)
        moving = chain.bodies[1:]
        return Body(
            KINDS.index(geometry.kind),
            np.argmax(geometry.basis, axis=0).astype(np.int64),
            geometry.main,
            _plain(geometry.base_position),
            _plain(geometry.base_rotation),
            _plain(geometry.offsets),
            _plain(geometry.rest_rotations),
            np.array([*(b.com_m for b in moving), chain.tip_offset_m], float),
            np.array([*(b.mass_kg for b in moving), 0.0], float),
            _plain(geometry.relative_reach),
        )


def load_arrays(loads: Loads, pressures: Array, payload_kg: float) -> tuple[Any, ...]:
    """Return the loads for the compiled statics: pressures (k,), gravity, tip force, moment, payload, forces, cords.

    Forces are bodies (m,), points (m, 3) and forces (m, 3); cords bodies, points, pulleys and tensions (c,).
    """

    def stack_rows(acting: Any, *names: str) -> tuple[Any, ...]:
        bodies = np.array([load.body for load in acting], np.int64) if acting else NO_BODIES
        rows = ([getattr(load, name) for load in acting] for name in names)
        return bodies, *(np.array(row, float) if row else NO_ROWS for row in rows)

    gravity, tip_force = _plain(loads.gravity_m_s2), _plain(loads.tip_force_n)
    return (
        *(pressures, gravity, tip_force, float(loads.moment_n_m), float(payload_kg)),
        *stack_rows(loads.forces, "point_m", "force_n"),
        *stack_rows(loads.cords, "point_m", "pulley_m"),
        np.array([cord.tension_n for cord in loads.cords], float),
    )


def _plain(values: Array) -> Array:
    """Return a contiguous and writable copy, because numba recompiles for arrays that are not."""
    return np.array(values, float, order="C")


class Packs:
    """A cache of the last few hundred packed laws and bodies, keyed by the identity of their sources."""

    def __init__(self) -> None:
        self._kept: dict[tuple[Any, ...], tuple[ChainModel, Any]] = {}
        self._lock = Lock()

    def pack(self, chain: ChainModel) -> tuple[tuple[Any, ...], CompiledLaws | None]:
        """Return `Body` and `CompiledLaws` of a chain, whatever its loads, payload and gravity."""
        base = (chain.base_position_m, chain.base_rotation)
        parts = (chain.joints, chain.bodies, chain.laws, chain.tip_offset_m, *base)
        body = self._keep(("body", *map(id, parts)), chain, lambda c: tuple(Body.from_chain(c)))
        placed = ("joints", *map(id, chain.laws), id(chain.joints), chain.actuators)
        return body, self._keep(placed, chain, lambda c: CompiledLaws.in_place(c, self.laws(c)))

    def laws(self, chain: ChainModel) -> PackedLaws | None:
        """Return the packed laws of a chain, whatever its geometry; None if a law has no scalar form."""
        found: PackedLaws | None = self._keep(
            ("laws", *map(id, chain.laws)), chain, lambda c: PackedLaws.from_laws(c.laws)
        )
        return found

    def _keep(self, key: tuple[Any, ...], chain: ChainModel, make: Callable[[ChainModel], Any]) -> Any:
        known = self._kept.get(key)
        if known is None:
            # The chain is kept: the identities of its parts stay their own.
            known = (chain, make(chain))
            with self._lock:
                while len(self._kept) >= MOST_PACKS:
                    self._kept.pop(next(iter(self._kept)))
                self._kept[key] = known
        return known[1]


def compiled_solver(chain: ChainModel, options: NewtonOptions, packs: Packs) -> Solver | None:
    """Return the solver of a chain without law terms whose laws all have a scalar form; None for others.

    Where Newton's way fails it follows the overdamped motion from q.
    """
    body, laws = packs.pack(chain)
    if chain.terms or laws is None:
        return None
    parts = (body, laws.arrays, laws.boxes)

    def solve(q: Array, loads: Loads) -> ChainSolution:
        pressures = actuation_values(chain.actuators, loads.actuation)
        arrays = load_arrays(loads, pressures, chain.payload_kg)
        q, markers = q.copy(), np.empty((len(q) + 2, 3))
        *found, outside = settle(*parts, arrays, q, markers, tuple(options))
        converged, stable, size, iterations = found
        return ChainSolution(q, size, converged, stable, iterations, markers, not outside)

    if not settle.overloads:  # compile or load now, so that no equilibrium's time includes it
        solve(np.zeros((chain.n_joints, len(chain.axes))), Loads.none(chain))
    return solve


def responder(chain: ChainModel, options: NewtonOptions, packs: Packs) -> Responder:
    """Return a solver of equilibria with slopes for a chain that is compiled; loads except the actuation are packed
    once.
    """
    body, laws = packs.pack(chain)
    assert laws is not None
    inputs, n = chain.inputs, chain.n_joints
    # (inputs, actuators) which actuators an input drives
    share = np.array([[float(a.input == name) for a in chain.actuators] for name in inputs])
    behind = np.argmax(share, axis=0)
    # The load arrays of the inputs that were last packed, which hold them alive.
    packed: tuple[Inputs, tuple[Any, ...]] | None = None

    def respond(given: Inputs, start: Array) -> Response:
        nonlocal packed
        if packed is None or any(
            getattr(given, name) is not getattr(packed[0], name) for name in OTHER_LOADS
        ):
            loads = Loads.from_inputs(chain, given)
            packed = (
                given,
                load_arrays(loads, actuation_values(chain.actuators, given.actuation), chain.payload_kg),
            )
        values = np.array([given.actuation[name] for name in inputs], float)
        q, k = np.array(start, float), len(behind)
        markers, by_p = np.empty((n + 2, 3)), np.empty((k, n + 2, 3))
        turn, spin = np.empty((3, 3)), np.empty((k, 3))
        arrays = (values[behind], *packed[1][1:])
        found = compiled_respond(
            body, laws.arrays, laws.boxes, arrays, q, markers, by_p, turn, spin, tuple(options)
        )
        if k > len(inputs):
            by_p, spin = np.tensordot(share, by_p, 1), share @ spin
        return Response(q, markers, by_p, turn, spin, found[0] and found[5], not found[4])

    return respond


# Of `Inputs`: what stays the same while actuations are looked for.
OTHER_LOADS = ("tip_force_n", "moment_n_m", "forces", "cords")
