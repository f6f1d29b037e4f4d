"""Equilibrium of a chain inside a dynamics engine by dynamic relaxation with kinetic damping (Cundall 1976).

The engine moves in pseudo-time with its own forces. When the unbalanced effort works against the motion, the
kinetic energy has peaked, and the chain is halted, so that no damping constant is tuned. Convergence is checked by
the common statics at the engine's joint coordinates, so that an engine with other conventions never converges.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pliant.mechanics.statics import ChainStatics, Loads, unstable_mode
from pliant.records.design import Array

# A step with a larger joint rotation is undone and repeated with more caution.
LONGEST_TURN = 0.4
# Size of the perturbation that leaves an unstable equilibrium.
NUDGE = 1e-3
MAX_CAUTION = 1e6
# Joint rotation at which the chain is considered divergent.
FURTHEST_TURN = 100.0
# Factor on the caution after an accepted step.
REGAIN = 0.8


class Mover(Protocol):
    """Interface of a chain in an engine for the relaxation."""

    @property
    def q(self) -> Array:
        """(n, a) joint coordinates."""

    @property
    def rates(self) -> Array:
        """(n, a) joint rates."""

    def halt(self, q: Array) -> None:
        """Put the chain at q without velocity."""

    def relax_step(self, loads: Loads, q: Array, load_stiffness: Array, caution: float) -> None:
        """Make one pseudo-time step under the true forces from the present coordinates q.

        Args:
            load_stiffness: (n,) bound of the loads' stiffness at each joint, added to the law's stiffness.
            caution: factor ≥ 1 on all numerical stiffness or inertia; larger means shorter moves.
        """


@dataclass(frozen=True, eq=False)
class Relaxed:
    """Result of a relaxation after `steps` steps; residual is the largest unbalanced effort."""

    q: Array
    residual: float
    converged: bool
    stable: bool
    steps: int


def relax(mover: Mover, statics: ChainStatics, loads: Loads, tolerance: float, max_steps: int) -> Relaxed:
    """Relax from the present state; end halted, at a minimum of the potential or with `converged` False.

    Rotations are converted to joint coordinates by `ChainGeometry.reach`.
    """
    q, reach = mover.q, statics.geometry.reach
    mover.halt(q)
    caution = 1.0
    steps = 0
    while True:
        residual = statics.residual(q, loads)
        size = float(np.abs(residual).max())
        balanced = size <= tolerance
        mode = unstable_mode(statics.balance(q, loads).stiffness) if balanced else None
        found = balanced and mode is None
        lost = not np.isfinite(size) or np.any(np.abs(q) > FURTHEST_TURN * reach)
        if found or lost or steps == max_steps or caution > MAX_CAUTION:
            mover.halt(q)
            return Relaxed(q, size, found, found, steps)
        if mode is not None:
            mode = mode.reshape(q.shape)
            q = q + NUDGE * (mode / np.abs(mode / reach).max())
            mover.halt(q)
        elif np.sum(residual * mover.rates) < 0.0:
            mover.halt(q)
        mover.relax_step(loads, q, _joint_bounds(statics, q, loads), caution)
        steps += 1
        moved = mover.q
        if np.isfinite(moved).all() and np.all(np.abs(moved - q) <= LONGEST_TURN * reach):
            q, caution = moved, max(1.0, REGAIN * caution)
        else:
            caution *= 2.0
            mover.halt(q)


def _joint_bounds(statics: ChainStatics, q: Array, loads: Loads) -> Array:
    """Return (n,) half the row sums of |load stiffness|: a mode descends if the metric has half its stiffness.

    Translations of rotational joints are scaled by the reach: the bound is N·m, divided by reach² for a translation.
    """
    stiffness = np.abs(statics.load_stiffness(q, loads))
    if statics.geometry.slide is not None:
        every = np.tile(statics.geometry.reach, len(q))
        stiffness = every[:, None] * stiffness * every
    rows = stiffness.sum(axis=1).reshape(q.shape)
    return np.asarray(0.5 * rows.max(axis=1))
