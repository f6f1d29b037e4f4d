"""The joint law τ(p, u): what a surrogate leaves behind and every physics engine evaluates."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pliant.records.actuation import names_of
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar

JointKind = Literal["revolute", "spherical", "prismatic", "extensible"]
# How many coordinates a joint of each kind has.
N_AXES: Mapping[str, int] = {"revolute": 1, "spherical": 3, "prismatic": 1, "extensible": 4}
# The coordinate of an extensible joint that is no turn; it comes last.
EXTENSION = "e"
EXTENSIBLE_AXES = ("x", "y", "z", EXTENSION)


def travels(joint: str, axes: Sequence[str]) -> tuple[bool, ...]:
    """Which of a joint's coordinates are travels (m, with a force in N) and not turns (rad, with an effort in N·m)."""
    return tuple(joint == "prismatic" or axis == EXTENSION for axis in axes)


@dataclass(frozen=True, eq=False)
class Effort:
    """τ and its slopes for n joints with a axes: tau (n, a), dtau_dp (n, a), dtau_du (n, a, a).

    Of m > 1 actuations dtau_dp is (n, a, m).
    """

    tau: Array
    dtau_dp: Array
    dtau_du: Array


@dataclass(frozen=True, eq=False)
class Domain:
    """The box in which a law was fitted: actuation (2,) as (low, high), (m, 2) of several; deformation (a, 2)."""

    actuation: Array
    deformation: Array

    def excess(self, actuation: Array, deformation: Array) -> Array:
        """How far outside the box each joint is, (n, m + a): negative below, positive above, 0 inside."""
        values = np.column_stack([np.asarray(actuation, float), deformation])
        box = self.box
        return np.minimum(values - box[:, 0], 0.0) + np.maximum(values - box[:, 1], 0.0)

    @property
    def box(self) -> Array:
        """(m + a, 2) actuations, then deformations."""
        return np.vstack([self.actuation, self.deformation])

    @staticmethod
    def unbounded(n_axes: int) -> Domain:
        """A domain without limits, for stated laws that give none."""
        return Domain(np.array([-np.inf, np.inf]), np.tile([-np.inf, np.inf], (n_axes, 1)))


@dataclass(frozen=True, eq=False)
class LawRecord:
    """A law as data: the kind of surrogate that reads it, JSON values and arrays. No pickle."""

    kind: str
    values: Mapping[str, Any]
    arrays: Mapping[str, Array]


# f(actuation, deformation, parameters, tau, dtau_dp, dtau_du): fills tau (a,), dtau_dp (a,) and dtau_du (a, a).
# Of m > 1 actuations `actuation` is (m,), and dtau_dp (a·m,) has ∂τ_i/∂a_j at i·m + j.
ScalarFunction = Callable[[Any, Array, Array, Array, Array, Array], None]


@dataclass(frozen=True, eq=False)
class ScalarLaw:
    """A law as one plain function of numbers and small arrays, which an engine may compile, and its parameters.

    The function stands at the top of its file and uses arithmetic, `if`, loops, functions of `math` and other
    functions of the same file; it allocates nothing. All laws of one form share the function.

    Attributes:
        function, parameters: see above.
        shared: parameters (P,) and a number s → the parameters of the law τ(s p, u) in the same function; None where
            the form has no such parameters.
        less_rest: r where the law is τ(p, u) − r τ(0, u) with τ the function (`SharedElasticity`).
    """

    function: ScalarFunction
    parameters: Array
    shared: Callable[[Array, float], Array] | None = None
    less_rest: float = 0.0


class JointLaw(ABC):
    """τ(p, u) of one module's joint with u in the joint's own coordinates (docs/conventions.md).

    A revolute joint has one axis, a spherical one three (u is the rotation vector of the child in its parent's
    rest frame), a prismatic one an extension in metres and a force in newtons. An extensible one has the four axes
    x, y, z, e: it turns as a spherical one, then moves the child by e along the child's own x; its last effort is
    that force. τ = −∂Π/∂u, and a stable law
    has ∂τ/∂u < 0. Implementations are frozen; behaviour is added by wrapping, as effects do.

    A law of m > 1 actuations, τ(a, u), has all their names in `actuation_name` (`pressure_1_pa, pressure_2_pa`) and one
    trailing axis more wherever an actuation stands: a (n, m), `Effort.dtau_dp` (n, a, m), `Domain.actuation` (m, 2).
    """

    joint: JointKind
    axes: tuple[str, ...]
    actuation_name: str
    domain: Domain
    error: ErrorBar | None = None

    @abstractmethod
    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Effort and slopes of n joints at once.

        Args:
            actuation: (n,) in Pa or N; (n, m) of several.
            deformation: (n, a) in rad or m.
        """

    @property
    def actuations(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return names_of(self.actuation_name)

    def unactuated(self, n: int) -> Array:
        """n times no actuation, as `evaluate` takes it: (n,), or (n, m) of several."""
        m = len(self.actuations)
        return np.zeros(n) if m == 1 else np.zeros((n, m))

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Π(p, u) − Π(p, 0) in J, shape (n,): minus the work of τ along the straight path from 0 to u.

        The default integrates by 12-point Gauss–Legendre, exact for polynomial laws up to degree 23.
        """
        nodes, weights = np.polynomial.legendre.leggauss(12)
        work = np.zeros(len(deformation))
        for node, weight in zip((nodes + 1) / 2, weights / 2, strict=True):
            tau = self.evaluate(actuation, node * deformation).tau
            work += weight * np.einsum("na,na->n", tau, deformation)
        return -work

    def band(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array | None:
        """Half-width (n, a) of the band around τ in which what the law stands for lies with probability `level`.

        None where the law states no error, as laws of given coefficients do.
        """
        if self.error is None:
            return None
        return self.error.half_width(actuation, deformation, level)

    def draws(self, count: int, seed: int) -> tuple[JointLaw, ...]:
        """Laws as likely as this one, given its error; empty where the law has no way of its own to draw them."""
        return ()

    def scalar(self) -> ScalarLaw | None:
        """The same law for compiled engines; None where it has no such form, then engines call `evaluate`."""
        return None

    def behind(self) -> tuple[JointLaw, float, float]:
        """(law, α, γ): this law is τ with τ = law(p, v), v = α u + γ τ; itself, 1 and 0 where nothing stands around it.

        So engines compile what effects shorten (α) or put a spring behind (γ in rad per N·m).
        """
        return self, 1.0, 0.0

    @abstractmethod
    def record(self) -> LawRecord:
        """The law as data; `Surrogate.load` makes the same law of it."""


@dataclass(frozen=True, eq=False)
class FitReport:
    """Errors of a law on states that were not fitted, in its effort's unit, and the fit's residuals.

    `worst_of_range` is the worst absolute error divided by max − min of the effort over all states.
    """

    n_fitted: int
    n_heldout: int
    rmse: float
    worst: float
    worst_of_range: float
    r2: float
    effort_range: float
    details: Mapping[str, Any]
