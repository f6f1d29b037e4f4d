"""Joint law τ(p, u), the result of a surrogate that every physics engine evaluates."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pliant.records.actuation import SEPARATOR
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBand

JointKind = Literal["revolute", "spherical", "prismatic", "extensible"]
# Number of coordinates of each joint type.
N_AXES: Mapping[str, int] = {"revolute": 1, "spherical": 3, "prismatic": 1, "extensible": 4}
# The translational coordinate of an extensible joint; the last one.
EXTENSION = "e"
EXTENSIBLE_AXES = ("x", "y", "z", EXTENSION)


def travels(joint: str, axes: Sequence[str]) -> tuple[bool, ...]:
    """Return which of a joint's coordinates are translations (m, force in N) instead of rotations (rad, N·m)."""
    return tuple(joint == "prismatic" or axis == EXTENSION for axis in axes)


@dataclass(frozen=True, eq=False)
class Effort:
    """τ and its slopes for n joints with a axes: tau (n, a), dtau_dp (n, a), dtau_du (n, a, a).

    For m > 1 actuations dtau_dp is (n, a, m).
    """

    tau: Array
    dtau_dp: Array
    dtau_du: Array


@dataclass(frozen=True, eq=False)
class Domain:
    """The box in which a law was fitted: actuation (2,) as (low, high), (m, 2) for several; deformation (a, 2)."""

    actuation: Array
    deformation: Array

    def excess(self, actuation: Array, deformation: Array) -> Array:
        """Return the distance of each joint from the box, (n, m + a): negative below, positive above, 0 inside."""
        values = np.column_stack([np.asarray(actuation, float), deformation])
        box = self.box
        return np.minimum(values - box[:, 0], 0.0) + np.maximum(values - box[:, 1], 0.0)

    @property
    def box(self) -> Array:
        """(m + a, 2) actuations, then deformations."""
        return np.vstack([self.actuation, self.deformation])

    @staticmethod
    def unbounded(n_axes: int) -> Domain:
        """Return a domain without limits, for stated laws without limits."""
        return Domain(np.array([-np.inf, np.inf]), np.tile([-np.inf, np.inf], (n_axes, 1)))


@dataclass(frozen=True, eq=False)
class LawRecord:
    """A law as data: the kind of surrogate that loads it, JSON values and arrays. No pickle."""

    kind: str
    values: Mapping[str, Any]
    arrays: Mapping[str, Array]


# See `ScalarLaw`.
ScalarFunction = Callable[[Any, Array, Array, Array, Array, Array], None]


@dataclass(frozen=True, eq=False)
class ScalarLaw:
    """A law as one plain function of numbers and small arrays, which an engine may compile, and its parameters.

    It is called as

        function(actuation, deformation, parameters, tau, dtau_dp, dtau_du)

    with a number, u (a,) and the parameters (P,), returns nothing, and fills tau (a,), dtau_dp (a,) and dtau_du (a, a).
    For m > 1 actuations `actuation` is (m,), and dtau_dp (a·m,) has ∂τ_i/∂a_j at i·m + j.

    The function is at module level and uses arithmetic, `if`, loops, functions of `math` and other
    functions of the same file; it allocates nothing. All laws of one form share the function.

    Attributes:
        function, parameters: see above.
        shared: parameters (P,) and a number s → the parameters of the law τ(s p, u) in the same function; None if the
            form has no such parameters.
        less_rest: r if the law is τ(p, u) − r τ(0, u) with τ the function (`SharedElasticity`).
    """

    function: ScalarFunction
    parameters: Array
    shared: Callable[[Array, float], Array] | None = None
    less_rest: float = 0.0


class JointLaw(ABC):
    """τ(p, u) of one module's joint with u in the joint's own coordinates (docs/conventions.md).

    A revolute joint has one axis, a spherical one three (u is the rotation vector of the child in its parent's
    rest frame), a prismatic one an extension in metres and a force in newtons. An extensible one has the four axes
    x, y, z, e: it rotates as a spherical one, then moves the child by e along the child's x; its last effort is that
    force. τ = −∂Π/∂u, and a stable law has ∂τ/∂u < 0. Implementations are frozen; behaviour is added by wrapping, as
    effects do.

    A law of m > 1 actuations, τ(a, u), has all their names in `actuation_name` (`pressure_1_pa, pressure_2_pa`) and an
    additional trailing axis for actuations: a (n, m), `Effort.dtau_dp` (n, a, m), `Domain.actuation` (m, 2).

    Attributes:
        joint: revolute, spherical, prismatic or extensible.
        axes: names of the coordinates, in the order of u.
        actuation_name: `pressure_pa`, `tendon_force_n`, …
        domain: the box in which the law is valid; `Domain.unbounded` without limits.
        error: of the law, any object with `half_width`; None if `band` is overridden or the error is not known.
    """

    joint: JointKind
    axes: tuple[str, ...]
    actuation_name: str
    domain: Domain
    error: ErrorBand | None = None

    @abstractmethod
    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Return effort and slopes of n joints at once.

        Args:
            actuation: (n,) in Pa or N; (n, m) for several.
            deformation: (n, a) in rad or m.
        """

    @property
    def actuations(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return tuple(self.actuation_name.split(SEPARATOR))

    def unactuated(self, n: int) -> Array:
        """Return zero actuations of n joints for `evaluate`: (n,), or (n, m) for several."""
        m = len(self.actuations)
        return np.zeros(n) if m == 1 else np.zeros((n, m))

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Return Π(p, u) − Π(p, 0) in J, shape (n,): minus the work of τ along the straight path from 0 to u.

        The default integrates by 12-point Gauss–Legendre, exact for polynomial laws up to degree 23.
        """
        nodes, weights = np.polynomial.legendre.leggauss(12)
        work = np.zeros(len(deformation))
        for node, weight in zip((nodes + 1) / 2, weights / 2, strict=True):
            tau = self.evaluate(actuation, node * deformation).tau
            work += weight * np.einsum("na,na->n", tau, deformation)
        return -work

    def band(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array | None:
        """Return half-width (n, a) of the band around τ that contains the true effort with probability `level`.

        None if the law states no error, as laws of given coefficients do. By default it is that of `error`; a law with
        its own band overrides this, needs no `error`, and returns a band at every state or at no state.
        """
        if self.error is None:
            return None
        return self.error.half_width(actuation, deformation, level)

    @property
    def states_error(self) -> bool:
        """Return whether the law has a band, by its `error` or by its own `band`."""
        if self.error is not None:
            return True
        box = np.where(np.isfinite(self.domain.box), self.domain.box, 0.0).mean(axis=1)
        m = len(self.actuations)
        return self.band(box[:1] if m == 1 else box[None, :m], box[None, m:]) is not None

    def draws(self, count: int, seed: int) -> tuple[JointLaw, ...]:
        """Return random laws as likely as this one, given its error; empty if the law does not implement draws."""
        return ()

    def scalar(self) -> ScalarLaw | None:
        """Return the same law for compiled engines; None without such a form, so that engines call `evaluate`."""
        return None

    def unwrap(self) -> tuple[JointLaw, float, float]:
        """Return (law, α, γ): this law is τ with τ = law(p, v), v = α u + γ τ; itself, 1 and 0 without a wrapper.

        With it engines compile laws that effects shorten (α) or put in series with a spring (γ in rad per N·m).
        """
        return self, 1.0, 0.0

    @abstractmethod
    def record(self) -> LawRecord:
        """Return the law as data, from which `Surrogate.load` rebuilds it."""


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

    @staticmethod
    def from_errors(
        n_fitted: int,
        predicted: Array,
        given: Array,
        effort_range: float,
        details: Mapping[str, Any] | None = None,
    ) -> FitReport:
        """Return the report of predicted efforts at the held-out states, whose true efforts are `given`."""
        missed = predicted - given
        spread, worst = float(np.sum((given - given.mean()) ** 2)), float(np.abs(missed).max())
        r2 = 1.0 - float(np.sum(missed**2)) / spread if spread else math.nan
        of_range = worst / effort_range if effort_range else 0.0
        rmse = float(np.sqrt(np.mean(missed**2)))
        return FitReport(
            n_fitted, len(given), rmse, worst, of_range, r2, float(effort_range), dict(details or {})
        )
