"""Actuations that bring a chain to a target: Gauss–Newton through its equilibrium, within bounds.

With r(p) the target's residual at the equilibrium under p, and J = ∂r/∂p by the implicit function theorem, a step
solves min |r + J Δ|² over the inputs that are free to move; a step that does not lower |r| is damped (Levenberg and
Marquardt). Bounds are kept by projection. Starts are the nearest equilibria of the reachable set. Inputs are scaled by
their ranges.

Redundancy: among all actuations that reach the target, the solution has the smallest sum of squares, scaled by the
ranges (along a path: the smallest change from the previous pose); it is found by steps in the null space of J.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pliant.errors import NotReachedError, UserError
from pliant.interfaces.simulation import Simulation
from pliant.inverse.answer import REACHED_M, InverseAnswer
from pliant.inverse.limits import input_bounds
from pliant.inverse.reachable import Reachable, sample
from pliant.inverse.target import Target
from pliant.records.design import Array
from pliant.records.rollout import Inputs, Response

SETTLED_M = 1e-10  # of the residual: below this no step is needed
MOST_STEPS, MOST_SLIDES = 60, 40
STARTS = 8
FIRST_DAMPING, MOST_DAMPING = 1e-3, 1e8
# Squared share of the largest singular value below which a direction does not move the target.
IDLE = 1e-8
SMALL_SHARE = 1e-7  # of a range: a smaller move counts as no move
# Of a range: tolerance of the distance to the wanted actuations.
NO_DRIFT = 1e-3
# Of the target, in m: how far a step along the null space may leave it before the next step corrects that.
ASTRAY_M = 2e-3


@dataclass(frozen=True, eq=False)
class _Place:
    """A point of the search: inputs scaled by their ranges, equilibrium, residual, and slopes by the scaled inputs."""

    x: Array
    found: Response
    r: Array
    J: Array
    cost: float


class InverseStatics:
    """Inverse statics of one chain in an engine with gradients."""

    def __init__(
        self,
        simulation: Simulation,
        bounds: Mapping[str, tuple[float, float]] | None = None,
        samples: int | None = None,
    ) -> None:
        """Prepare the inverse of a chain.

        Args:
            simulation: of the chain.
            bounds: low and high of inputs; those of the laws' data for the others.
            samples: equilibria of the reachable set to start from.

        Raises:
            UserError: an input without bounds.
        """
        self.simulation, self.chain = simulation, simulation.chain
        self.inputs = self.chain.inputs
        self.bounds = input_bounds(self.chain, bounds)
        self._range = np.ptp(self.bounds, axis=1)
        self._samples = samples
        self._reachable: Reachable | None = None
        self._no_force = np.zeros(3)
        # With redundant inputs, steps along the null space correct the remaining error.
        self._enough_m = SETTLED_M if len(self.inputs) == 1 else REACHED_M / 2
        self._evaluations = 0

    @property
    def reachable(self) -> Reachable:
        """Equilibria over the whole range of the inputs; solved on first access."""
        if self._reachable is None:
            self._reachable = sample(self.simulation, self.inputs, self.bounds, self._samples)
        return self._reachable

    def solve(self, target: Target) -> InverseAnswer:
        """Return the actuations for one target.

        Raises:
            UserError: an invalid target.
            NotReachedError: a chain without any equilibrium in the bounds.
        """
        self._evaluations = 0
        target = target.checked(self.chain.n_joints)
        low, high = self.bounds[:, 0] / self._range, self.bounds[:, 1] / self._range
        best, tried = None, 0
        for number in self._nearest(target):
            tried += 1
            start = self.reachable.actuation[number] / self._range
            place = self._descend(target, start, self.reachable.joint_angles[number], low, high)
            if place is not None and (best is None or place.cost < best.cost):
                best = place
            if best is not None and best.cost <= REACHED_M**2:
                best = self._slide(target, best, low, high, np.zeros(len(low)))
                break
        if best is None:
            raise NotReachedError(
                "the chain settles nowhere near the target under these bounds; narrow them."
            )
        return self._answer(best, low, high, tried)

    def path(
        self,
        targets: Sequence[Target],
        rates: Mapping[str, float] | None = None,
        time_step_s: float = 1.0,
    ) -> list[InverseAnswer]:
        """Return the actuations along a path, each started from the previous one.

        Args:
            targets: in order, `time_step_s` apart.
            rates: largest change of an input per second; unlimited for inputs that are not named.
            time_step_s: between targets.
        """
        for name in rates or {}:
            if name not in self.inputs:
                raise UserError(f"'rates' names {name}; the inputs are {', '.join(self.inputs)}.")
        limits = np.array([(rates or {}).get(name, np.inf) for name in self.inputs])
        most = limits * time_step_s / self._range
        answers: list[InverseAnswer] = []
        for target in targets:
            if not answers:
                answers.append(self.solve(target))
                continue
            before = answers[-1]
            answers.append(self._next(target.checked(self.chain.n_joints), before, most))
        return answers

    def _next(self, target: Target, before: InverseAnswer, most: Array) -> InverseAnswer:
        self._evaluations = 0
        x = np.array([before.actuation[name] for name in self.inputs]) / self._range
        low = np.maximum(self.bounds[:, 0] / self._range, x - most)
        high = np.minimum(self.bounds[:, 1] / self._range, x + most)
        place = self._descend(target, x, before.response.joint_angles, low, high)
        if place is not None and place.cost <= REACHED_M**2:
            return self._answer(self._slide(target, place, low, high, x), low, high, 1)
        if np.isinf(most).all():  # free to jump
            other = self.solve(target)
            if place is None or other.distance_m**2 < place.cost:
                return other
        if place is None:
            raise NotReachedError("the chain does not settle along the path; make its steps smaller.")
        return self._answer(place, low, high, 1)

    def _nearest(self, target: Target) -> NDArray[np.int64]:
        """Return the indices of the samples nearest to the target, nearest first."""
        distances = self.reachable.distances(target, self._turn(target))
        return np.argsort(distances, kind="stable")[:STARTS]

    def _turn(self, target: Target) -> float:
        return self.chain.length_m if target.turn_m is None else target.turn_m

    def _at(self, target: Target, x: Array, q: Array, force: Array) -> _Place | None:
        """Return the equilibrium at x, started from q; None where the chain does not converge."""
        self._evaluations += 1
        values = dict(zip(self.inputs, (x * self._range).tolist(), strict=True))
        found = self.simulation.respond(Inputs(values, force), q)
        if not found.converged:
            return None
        r, slopes = target.residual(found, self._turn(target))
        return _Place(x, found, r, slopes * self._range, float(r @ r))

    def _force(self, target: Target) -> Array:
        return self._no_force if target.push_n is None else -target.push_n

    def _descend(self, target: Target, x: Array, q: Array, low: Array, high: Array) -> _Place | None:
        """Return the nearest minimum of the distance; None where the start has no equilibrium."""
        force = self._force(target)
        place = self._at(target, np.clip(x, low, high), q, force)
        damping = 0.0
        for _ in range(MOST_STEPS):
            if place is None or place.cost <= self._enough_m**2:
                break
            step = _step(place, low, high, damping)
            moved = np.clip(place.x + step, low, high)
            if np.abs(moved - place.x).max() < 1e-13:
                break
            tried = self._at(target, moved, place.found.joint_angles, force)
            if tried is not None and tried.cost < place.cost:
                stalled = place.cost - tried.cost <= 1e-14 * place.cost
                place, damping = tried, damping / 10.0 if damping > FIRST_DAMPING else 0.0
                if stalled:
                    break
            else:
                damping = max(10.0 * damping, FIRST_DAMPING)
                if damping > MOST_DAMPING:
                    break
        return place

    def _slide(self, target: Target, place: _Place, low: Array, high: Array, wanted: Array) -> _Place:
        """Move along the actuations that reach the target to those nearest to the wanted ones.

        Each step goes to the nearest actuations that reach the target to first order, which also corrects the residual.
        """
        if len(place.x) == 1:
            return place
        force, best, share = self._force(target), place, 1.0
        for _ in range(MOST_SLIDES):
            step = _nearest_that_reaches(place, low, high, wanted) - place.x
            size = np.abs(step).max()
            if size < SMALL_SHARE or (size < NO_DRIFT and place.cost <= REACHED_M**2):
                break
            tried = self._at(target, place.x + share * step, place.found.joint_angles, force)
            if tried is None or tried.cost > max(ASTRAY_M**2, place.cost):
                share *= 0.5
                if share < 1e-2:
                    break
                continue
            place, share = tried, min(1.0, 2.0 * share)
            if place.cost <= REACHED_M**2 and _far(place, wanted) < _far(best, wanted):
                best = place
        return best

    def _answer(self, place: _Place, low: Array, high: Array, starts: int) -> InverseAnswer:
        values = place.x * self._range
        limits = {}
        for name, x, least, most in zip(self.inputs, place.x, low, high, strict=True):
            if x - least < SMALL_SHARE or most - x < SMALL_SHARE:
                limits[name] = "low" if x - least < SMALL_SHARE else "high"
        distance = float(np.sqrt(place.cost))
        actuation = dict(zip(self.inputs, values.tolist(), strict=True))
        return InverseAnswer(actuation, distance, limits, replace(place.found), starts, self._evaluations)


def _far(place: _Place, wanted: Array) -> float:
    return float(np.linalg.norm(place.x - wanted))


def _step(place: _Place, low: Array, high: Array, damping: float) -> Array:
    """Return the damped Gauss–Newton step of the inputs that are not at a bound; the smallest if several solve it."""
    g = place.J.T @ place.r
    free = ~(((place.x <= low) & (g > 0.0)) | ((place.x >= high) & (g < 0.0)))
    step = np.zeros(len(g))
    if len(g) == 1:
        size = float(place.J[:, 0] @ place.J[:, 0])
        if free[0] and size > 0.0:
            step[0] = -g[0] / (size * (1.0 + damping))
        return step
    if not free.any():
        return step
    part = place.J[:, free]
    sizes, ways = np.linalg.eigh(part.T @ part)
    inverse = np.zeros(len(sizes))
    moving = sizes > IDLE * sizes[-1]
    inverse[moving] = 1.0 / (sizes[moving] + damping * sizes[-1])
    step[free] = -ways @ (inverse * (ways.T @ g[free]))
    return step


def _nearest_that_reaches(place: _Place, low: Array, high: Array, wanted: Array) -> Array:
    """Return the y in the bounds nearest to `wanted` with J (y − x) = −r, as far as J allows it, by an active set."""
    y, free = wanted.copy(), np.ones(len(wanted), bool)
    goal = place.J @ place.x - place.r
    for _ in range(len(y)):
        part = place.J[:, free]
        left = goal - place.J[:, ~free] @ y[~free] - part @ wanted[free]
        sizes, ways = np.linalg.eigh(part @ part.T)
        kept = sizes > IDLE * max(float(sizes[-1]), 1e-300)
        y[free] = wanted[free] + part.T @ (ways[:, kept] @ ((ways[:, kept].T @ left) / sizes[kept]))
        beyond = np.where(free, np.maximum(low - y, y - high), 0.0)
        worst = int(np.argmax(beyond))
        if beyond[worst] <= 0.0:
            break
        y[worst] = low[worst] if y[worst] < low[worst] else high[worst]
        free[worst] = False
        if not free.any():
            break
    y = np.clip(y, low, high)
    if np.linalg.norm(place.J @ y - goal) > 0.1 * np.linalg.norm(place.J @ (y - place.x)) + REACHED_M:
        return np.clip(
            place.x + _step(place, low, high, 0.0), low, high
        )  # too many inputs are at bounds: only reduce the residual
    return y
