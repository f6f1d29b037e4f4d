"""Adaptive sampling: states are added where the law is least certain, until its error is below the requested one.

A Gaussian process is fitted to all states with their slopes (`gaussian`). The next state is the point of a
lattice over the box with the largest standard deviation. Each new state tests the process: the deviations are
multiplied by the factor by which the last residuals exceed them. Sampling ends when twice the largest
deviation and the last residuals are below the error, as a share of the effort's range.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.pipeline.sampling.gaussian import Process, effort_orders, fit, slope_orders
from pliant.pipeline.sampling.walk import Sampled, SamplingRun, StateTarget
from pliant.records.design import Array

LATTICE = 21  # candidates along each side of the box
TESTS = 2  # number of last states that must be predicted within the error
REMEMBERED = 6  # number of last residuals that scale the deviations
# Smallest ratio of a new state's distance to a failed one over that to a solved one.
WARY = 2.0
FEWEST_STATES = 4
TINY = 1e-12  # smallest standard deviation, against division by zero
SAME = 1e-9  # scaled distance below which two places are equal


@dataclass(frozen=True, eq=False)
class LawView:
    """States of one axis: p, u, τ, ∂τ/∂p and ∂τ/∂u, all (n,), slopes with the free axes following."""

    actuation: Array
    deformation: Array
    tau: Array
    dtau_dp: Array
    dtau_du: Array

    def __len__(self) -> int:
        return len(self.actuation)

    def mirrored(self) -> LawView:
        """Return the view with the states at −u added; for an even energy they differ only in the sign of τ."""
        away = self.deformation != 0
        signs = (1.0, -1.0, -1.0, -1.0, 1.0)
        columns = (self.actuation, self.deformation, self.tau, self.dtau_dp, self.dtau_du)
        return LawView(*(np.concatenate([c, sign * c[away]]) for c, sign in zip(columns, signs, strict=True)))


def law_view(states: Sequence[Sampled], axis: str, axes: Sequence[str]) -> LawView:
    """Return the law of `axis` from states in which the other axes are free: dτ_j = 0 for all j ≠ k."""
    k, rows = list(axes).index(axis), []
    for state in (one.state for one in states):
        others = [j for j in range(len(state.deformation)) if j != k]
        by_p, by_u = float(state.dtau_dp[k]), float(state.dtau_du[k, k])
        if others:
            K = state.dtau_du
            moved = np.column_stack([state.dtau_dp[others], K[others, k]])
            follow = np.linalg.solve(K[np.ix_(others, others)], moved)
            by_p -= float(K[k, others] @ follow[:, 0])
            by_u -= float(K[k, others] @ follow[:, 1])
        rows.append((state.actuation, float(state.deformation[k]), float(state.tau[k]), by_p, by_u))
    return LawView(*np.array(rows, dtype=float).reshape(len(rows), 5).T)


@dataclass(frozen=True)
class Box:
    """Range in which one axis is sampled, (low, high) in actuation and in u, and its piece.

    `symmetric`: u ranges from −L to L, and only states at u ≥ 0 are solved; those at −u follow by symmetry.
    """

    axis: str
    piece: str
    actuation: tuple[float, float]
    deformation: tuple[float, float]
    symmetric: bool = False

    def scaled(self, actuation: Array, deformation: Array) -> Array:
        """Return (n, 2) scaled to [−1, 1]."""
        sides = ((actuation, self.actuation), (deformation, self.deformation))
        return np.stack([(2 * c - low - high) / (high - low) for c, (low, high) in sides], axis=1)

    def lattice(self) -> tuple[Array, Array]:
        """Return the actuations and deformations (LATTICE²,) of the candidate states."""
        low, high = self.deformation
        sides = (self.actuation, (0.0 if self.symmetric else low, high))
        p, u = np.meshgrid(*(np.linspace(*side, LATTICE) for side in sides))
        return p.ravel(), u.ravel()

    def target(self, actuation: float, deformation: float) -> StateTarget:
        """Return the state to solve at a place."""
        held = {self.axis: deformation}
        return StateTarget("constrained", actuation, held, explored=self.axis, piece=self.piece)

    def corners(self) -> list[StateTarget]:
        """Return the corners, the easiest first: without actuation, then bent with it, then against it."""
        (p0, p1), (u0, u1) = self.actuation, self.deformation
        places = ((p0, u1), (p1, u1), (p0, u0), (p1, u0))
        return [self.target(p, u) for p, u in places if not (self.symmetric and u < 0)]

    def fitted(self, walk: SamplingRun) -> list[Sampled]:
        """Return the states to fit inside the box, without those that only determined its border."""
        k = walk.pieces[self.piece].axes.index(self.axis)
        low, high = self.deformation
        margin = SAME * (high - low)
        return [
            one
            for one in walk.piece_states(self.piece)
            if one.target.role == "fit"
            and (one.target.explored == self.axis or one.target.branch == "free")
            and low - margin <= float(one.state.deformation[k]) <= high + margin
        ]

    def view(self, walk: SamplingRun) -> LawView:
        """Return the law of the states to fit, including their mirror images."""
        view = law_view(self.fitted(walk), self.axis, walk.pieces[self.piece].axes)
        return view.mirrored() if self.symmetric else view


def refine(
    walk: SamplingRun, box: Box, wanted: float, most: int, expect: Callable[[int], None]
) -> dict[str, Any]:
    """Add states until the error is below `wanted` or the axis has `most` states to fit.

    `expect` gets the estimated number of remaining states of this axis.

    Returns:
        The accuracy of the law as shares of the effort's range, as JSON values: the requested `error`; `stated_error`
        of the process over the box, None before the first fit; `reached`, whether that and the last residuals are below
        it; `tests`, for each new state its place, predicted and true value, deviation and residual.
    """
    tests: list[dict[str, float]] = []
    stated, reached = np.inf, False
    lengths: Array | None = None
    while len(view := box.view(walk)) >= FEWEST_STATES:
        size = float(np.ptp(view.tau)) or 1.0
        process = _process(view, box, size, lengths)
        lengths = process.lengths
        allowed = _allowed(walk, box)
        if not allowed.any():
            break
        p, u = (c[allowed] for c in box.lattice())
        mean, deviation = _predict(process, box, p, u)
        stated = 2 * _too_small(process, tests) * float(deviation.max())
        last = [test["miss"] for test in tests[-TESTS:]]
        reached = len(last) == TESTS and max(last) <= wanted and stated <= wanted
        count = len(box.fitted(walk))
        if reached or count >= most:
            break
        # The error decreases by about a fifth with each state (measured on bending bellows).
        left = int(np.log(max(stated / wanted, 1.0)) / np.log(1.25))
        expect(min(most - count, max(1 + left, TESTS - len(tests))))
        worst = int(np.argmax(deviation))
        place = {"actuation": float(p[worst]), "deformation": float(u[worst])}
        state = walk.solve(box.target(**place))
        if state is not None:
            tau = float(state.tau[walk.pieces[box.piece].axes.index(box.axis)])
            foretold = float(mean[worst]) * size
            test = {**place, "foretold": foretold, "found": tau, "deviation": float(deviation[worst])}
            tests.append({**test, "miss": abs(foretold - tau) / size})
    stated_error = stated if np.isfinite(stated) else None
    return {"error": wanted, "stated_error": stated_error, "reached": reached, "tests": tests}


def _process(view: LawView, box: Box, size: float, near: Array | None) -> Process:
    """Return the process of −∂Π/∂v, v the scaled angle, so that all values are of order one."""
    half_p, half_u = (np.ptp(side) / 2 for side in (box.actuation, box.deformation))
    values = -np.stack([view.tau, view.dtau_dp * half_p, view.dtau_du * half_u], axis=1) / size
    orders = np.concatenate([effort_orders(1), slope_orders(1)])
    return fit(box.scaled(view.actuation, view.deformation), orders, values.ravel(), near)


def _predict(process: Process, box: Box, p: Array, u: Array) -> tuple[Array, Array]:
    """Return τ and its standard deviation, relative to the range, both (m,)."""
    mean, deviation = process.predict(box.scaled(p, u), effort_orders(1))
    return -mean[:, 0], deviation[:, 0]


def _too_small(process: Process, tests: list[dict[str, float]]) -> float:
    """Return the factor for the deviations, at least 1.

    The factor is the larger root mean square of residuals over deviations, of the last tests and of the leave-one-out
    predictions of all states.
    """
    misses, spread = process.left_out()
    of_all = np.abs(misses) / np.maximum(spread, TINY)
    of_tests = [test["miss"] / max(test["deviation"], TINY) for test in tests[-REMEMBERED:]]
    ratios = [np.sqrt(np.mean(np.square(one))) for one in (of_all, of_tests) if len(one)]
    return max(1.0, *map(float, ratios))


def _allowed(walk: SamplingRun, box: Box) -> np.ndarray:
    """Return which candidates may be solved: those that are neither solved nor near a failure."""
    candidates = box.scaled(*box.lattice())

    def distance(p: Array, u: Array) -> Array:
        if len(p) == 0:
            return np.full(len(candidates), np.inf)
        apart = candidates[:, None] - box.scaled(p, u)[None]
        return np.asarray(np.linalg.norm(apart, axis=2).min(axis=1))

    view = law_view(box.fitted(walk), box.axis, walk.pieces[box.piece].axes)
    to_solved = distance(view.actuation, view.deformation)
    stops = [t for t in walk.stops if t.piece == box.piece and t.explored == box.axis and t.held]
    to_failed = distance(np.array([t.actuation for t in stops]), np.array([t.held[box.axis] for t in stops]))
    return np.asarray((to_failed >= WARY * to_solved) & (to_solved > SAME))


def interpolated(view: LawView, box: Box) -> Callable[[Array, Array], tuple[Array, Array]]:
    """Return the process of all states as a function of p and u, both (m,): τ and its standard deviation, both (m,)."""
    size = float(np.ptp(view.tau)) or 1.0
    process = _process(view, box, size, None)

    def tau(actuation: Array, deformation: Array) -> tuple[Array, Array]:
        mean, deviation = _predict(process, box, actuation, deformation)
        return size * mean, size * deviation

    return tau


def check_error(walk: SamplingRun, box: Box) -> float | None:
    """Return the largest error of the process at the trusted check states, as a share of the effort's range."""
    checks = [
        one
        for one in walk.piece_states(box.piece)
        if one.target.role == "check" and one.target.explored == box.axis and one.state.trusted
    ]
    view = box.view(walk)
    if not checks or len(view) < FEWEST_STATES:
        return None
    seen = law_view(checks, box.axis, walk.pieces[box.piece].axes)
    tau, _ = interpolated(view, box)(seen.actuation, seen.deformation)
    return float(np.abs(tau - seen.tau).max() / (np.ptp(view.tau) or 1.0))
