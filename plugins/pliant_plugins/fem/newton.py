"""Equilibria of one module under control of its actuation and of its joint's axes.

q are the globals of the rod frame and v all other unknowns. With Π = U − a W (actuation a, what it works
on W) and K = Π_vv factorised once, back-substitutions Z = K⁻¹ [r_v, Π_vq, W_v] give Newton's step under any control,

    S Δq = −ρ + b Δa − f,    S = Π_qq − Π_qv K⁻¹ Π_vq,   ρ = r_q − Π_qv K⁻¹ r_v,   b = W_q − Π_qv K⁻¹ W_v

and, at equilibrium, the exact slopes of the reactions to the joint's axes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from pliant.records.actuation import Levels
from pliant.records.design import Array
from pliant_plugins.fem.iteration import (
    DivergedError,
    Iteration,
    SingularMatrixError,
    Tolerance,
    in_load_steps,
)

# An interpolated guess may be this many times farther off than the tangent's: half the way is no shorter for it.
LEAP = 5.0


@dataclass(frozen=True, eq=False)
class Control:
    """The prescribed quantities.

    Attributes:
        actuation: Pa or N, (m,) of several.
        held: (G,) which globals are held.
        goal: (G,) values of those that are held.
        effort: (G,) external efforts on the piece that oppose the others; zero at a target.
    """

    actuation: Levels
    held: NDArray[np.bool_]
    goal: Array
    effort: Array


class Functional(Protocol):
    """A scalar of x with its gradient, whose last G entries are those of the globals."""

    @property
    def value(self) -> float: ...
    @property
    def gradient(self) -> Array: ...


Of = TypeVar("Of", bound=Functional)


@dataclass(frozen=True, eq=False)
class PathPoint(Generic[Of]):
    """A trial state x, whose last G entries are the globals, under actuations a: U and the W of each of them there."""

    x: Array
    actuation: Levels
    energy: Of
    travels: tuple[Of, ...]

    @property
    def residual(self) -> Array:
        """Gradient of Π; its last G are minus the external efforts on the piece."""
        residual = self.energy.gradient
        for level, travel in zip(np.atleast_1d(self.actuation).tolist(), self.travels, strict=True):
            residual = residual - level * travel.gradient
        return residual

    @property
    def travel(self) -> Levels:
        """W, (m,) of several actuations."""
        values = [float(travel.value) for travel in self.travels]
        return values[0] if len(values) == 1 else np.array(values)


@dataclass(frozen=True, eq=False)
class Reduced:
    """Back-substitutions Z (n, 1 + G + m) under m actuations and the reduced system in the globals."""

    solved: Array
    stiffness: Array  # S (G, G)
    residual: Array  # ρ (G,)
    actuation: Array  # b (G,), (G, m) of several actuations

    @staticmethod
    def from_condensed(solved: Array, full: Array, globals_: int) -> Reduced:
        """Reduce from Z and the condensed columns (G, 1 + G + m): residual, stiffness, works."""
        b = full[:, 1 + globals_ :]
        b = b[:, 0] if b.shape[1] == 1 else b
        return Reduced(solved, full[:, 1 : 1 + globals_], full[:, 0], b)

    def slopes(self, axes: tuple[int, ...]) -> tuple[Array, Array]:
        """Return ∂M/∂a (k,) or (k, m), ∂M/∂q (k, k) of efforts M against the globals `axes`, others at equilibrium."""
        S, b, joint = self.stiffness, self.actuation, np.array(axes)
        others = np.setdiff1d(np.arange(len(b)), joint)
        lever = np.asarray(np.linalg.solve(S[np.ix_(others, others)], S[np.ix_(others, joint)]), float)
        by_actuation = b[joint] - lever.T @ b[others]
        return by_actuation, S[np.ix_(joint, others)] @ lever - S[np.ix_(joint, joint)]


class FemSystem(Protocol):
    """A backend's discrete system. A step is what the unknowns v and the globals change by."""

    @property
    def count(self) -> int:
        """Number G of the globals."""

    def evaluate(self, x: Array, actuation: Levels) -> PathPoint[Any] | None:
        """Return U and W at x; None if a cell is inverted."""

    def reduce(self, point: PathPoint[Any]) -> Reduced:
        """Factorise and condense. Raises `SingularMatrixError`."""

    def again(self, point: PathPoint[Any]) -> tuple[Array, Array]:
        """Return (r_v, K⁻¹ r_v) of a point with the last factorised matrix."""

    def step(self, inner: Array, globals_: Array) -> Array:
        """Return the change of x for one of the unknowns and the globals."""

    def work(self, point: PathPoint[Any], step: tuple[Array, Array], control: Control) -> float:
        """Return the work (J) of the residual along a step under a control, ≥ 0."""


@dataclass(frozen=True, eq=False)
class FemEquilibrium:
    """A converged point with its reduced system, ready to be left again."""

    point: PathPoint[Any]
    reduced: Reduced
    iterations: int


@dataclass(frozen=True, eq=False)
class Newton:
    """Newton's method for equilibria of one module under control of actuation and joint axes."""

    system: FemSystem
    tolerance: Tolerance

    def at(self, x: Array, actuation: Levels) -> FemEquilibrium:
        """Return the system at x, which the caller knows to be an equilibrium."""
        point = self.system.evaluate(x, actuation)
        if point is None:
            raise DivergedError("the state to start from has inverted cells")
        return FemEquilibrium(point, self.system.reduce(point), 0)

    def at_once(self, target: Control, expected: Array) -> FemEquilibrium | None:
        """Solve for equilibrium at `target` from the expected x; None if that is too far from it."""
        way = _ToControl(self.system, target)
        tolerance = replace(self.tolerance, too_long=LEAP * self.tolerance.too_long)
        try:
            guess = self.system.evaluate(expected, target.actuation)
            point, count = way.converged(guess, tolerance, final=True, patient=False)
            return FemEquilibrium(point, self.system.reduce(point), count + 1)
        except (DivergedError, SingularMatrixError, np.linalg.LinAlgError):
            return None

    def advance(self, start: FemEquilibrium, target: Control) -> FemEquilibrium:
        """Solve for equilibrium at `target`, in load steps from `start`. Raises `DivergedError`."""
        first, G = start.point, self.system.count
        globals_, efforts = first.x[-G:], -first.residual[-G:]

        def step(here: FemEquilibrium, goal: float, patient: bool) -> tuple[FemEquilibrium, int]:
            control = target
            if goal != 1.0:
                control = Control(
                    first.actuation + goal * (target.actuation - first.actuation),
                    target.held,
                    globals_ + goal * (target.goal - globals_),
                    np.where(target.held, 0.0, efforts + goal * (target.effort - efforts)),
                )
            way = _ToControl(self.system, control)
            predicted = way.moved(here.point, way.tangent(here.point, here.reduced), 1.0)
            point, count = way.converged(predicted, self.tolerance, goal == 1.0, patient)
            return FemEquilibrium(point, self.system.reduce(point), count + 1), count + 1

        end, count = in_load_steps(start, step, self.tolerance.max_halvings)
        return FemEquilibrium(end.point, end.reduced, count)


@dataclass(frozen=True, eq=False)
class _ToControl(Iteration[PathPoint[Any], tuple[Array, Array]]):
    """The iteration to one control."""

    system: FemSystem
    target: Control
    last: list[Reduced] = field(default_factory=list)  # of the last correction, one at most

    def correction(self, point: PathPoint[Any]) -> tuple[Array, Array]:
        self.last[:] = [self.system.reduce(point)]
        return self.tangent(point, self.last[0])

    def again(self, point: PathPoint[Any]) -> tuple[Array, Array] | None:
        """Solve again; K is symmetric, so that Π_qv K⁻¹ r_v = Z_qᵀ r_v."""
        G, (known,) = self.system.count, self.last
        right, solved = self.system.again(point)
        Z = np.column_stack([solved, known.solved[:, 1:]])
        left = point.residual[-G:] - known.solved[:, 1 : 1 + G].T @ right
        return self.tangent(point, replace(known, solved=Z, residual=left))

    def tangent(self, point: PathPoint[Any], reduced: Reduced) -> tuple[Array, Array]:
        """Return Newton's step of actuation, prescribed globals and all other unknowns together."""
        control, G = self.target, self.system.count
        rise, held, free = control.actuation - point.actuation, control.held, ~control.held
        change = np.zeros(G)
        change[held] = (control.goal - point.x[-G:])[held]
        right = (
            -reduced.residual + times(reduced.actuation, rise) - control.effort - reduced.stiffness @ change
        )
        change[free] = np.linalg.solve(reduced.stiffness[np.ix_(free, free)], right[free])
        Z = reduced.solved
        works = Z[:, 1 + G :]
        by_actuation = times(works[:, 0] if works.shape[1] == 1 else works, rise)
        return -Z[:, 0] - Z[:, 1 : 1 + G] @ change + by_actuation, change

    def work(self, point: PathPoint[Any], step: tuple[Array, Array]) -> float:
        return self.system.work(point, step, self.target)

    def moved(self, point: PathPoint[Any], step: tuple[Array, Array], length: float) -> PathPoint[Any] | None:
        return self.system.evaluate(point.x + length * self.system.step(*step), self.target.actuation)


def times(slopes: Array, change: Levels) -> Array:
    """Return slopes by the actuation, (…) or (…, m), times its change, a number or (m,)."""
    return np.asarray(slopes * change if np.ndim(change) == 0 else slopes @ change)
