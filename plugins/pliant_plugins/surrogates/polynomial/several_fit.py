"""A polynomial energy of several actuations and axes, fitted to whole states; its degrees chosen by leaving states out.

Of a state everything is fitted at once: τ_i = −∂Π/∂u_i, its slopes by all actuations and axes, the energy
Π = U − Σ a_j travel_j and ∂Π/∂a_j = −travel_j. Where no state knows its energy and travels (a table from a bench) the
terms of the actuations alone, which have no effort, are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # scipy.stats only where a law is fitted
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.interfaces.surrogate import FittedLaw
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.fem import ModuleData
from pliant.records.law import Domain, JointLaw
from pliant_plugins.surrogates.polynomial.energy_system import SLOPE_WEIGHT, least_squares
from pliant_plugins.surrogates.polynomial.law import SEVERAL
from pliant_plugins.surrogates.polynomial.scoring import report_axes
from pliant_plugins.surrogates.polynomial.several_law import Exponents, SeveralLaw, powers, product
from pliant_plugins.surrogates.polynomial.states import split
from pliant_plugins.surrogates.records import stable_choice

# Degrees of the energy in the actuations and in the deformations that are tried.
DEGREES = ((1, 2), (2, 2), (2, 4), (3, 3), (3, 5), (4, 4), (4, 6), (5, 5), (6, 6), (8, 8))
# Limits relative to the equations, and in all: the cost of a law in an engine grows with its terms.
MOST_TERMS, MOST_OF_ALL = 0.5, 500
# Energies and travels, which actuations alone move by more than the deformations do, weigh little: they are there for
# the terms that have no effort.
ENERGY_WEIGHT = 0.02
# Of candidates within this factor of the smallest error the one with the fewest terms is taken.
ALIKE = 1.05
PLACES = 2048  # of the box, at which ∂τ/∂u is looked at


@dataclass(frozen=True, eq=False)
class SeveralInputsFit:
    """Degrees, terms, coefficients (t,) in J, and misses (n, k) of τ with each state left out in turn.

    `rmse` is the root mean square of the misses over the ranges.
    """

    degrees: tuple[int, int]
    exponents: Exponents
    coefficients: Array
    misses: Array
    rmse: float


def fit_several(data: ModuleData) -> FittedLaw:
    """Fit one law of all actuations and axes to trusted states of role "fit", scored on those of role "check".

    Raises `UserError` as `states.split` does, and where the states determine no law.
    """
    states = split(data, f"a law of {len(data.actuations)} actuations")
    system = _System(states.fit, states.domain, states.ranges)
    tried = [one for one in map(system.solve, _degrees(system)) if one is not None]
    if not tried:
        raise UserError(
            f"the {len(states.fit)} states to fit determine no law of {len(data.actuations)} actuations and "
            f"{len(data.axes)} axes: solve more (fem.max_states), or add rows to the table."
        )
    laws = [system.law(one) for one in tried]
    slopes = [largest_slope(law) for law in laws]
    best = stable_choice([one.rmse for one in tried], slopes)
    near = [
        k
        for k, one in enumerate(tried)
        if one.rmse <= ALIKE * tried[best].rmse and (slopes[k] < 0 or slopes[best] >= 0)
    ]
    place = min(near, key=lambda k: len(tried[k].coefficients))
    chosen, law = tried[place], laws[place]
    table = [
        {
            "actuation_degree": one.degrees[0],
            "degree": one.degrees[1],
            "terms": len(one.coefficients),
            "left_out_rmse_of_range": one.rmse,
            "stable": slope < 0,
            "chosen": one is chosen,
        }
        for one, slope in zip(tried, slopes, strict=True)
    ]
    choice = {
        "form": SEVERAL,
        "actuation_degree": chosen.degrees[0],
        "degree": chosen.degrees[1],
        "terms": len(chosen.coefficients),
        "left_out_rmse_of_range": chosen.rmse,
        "energies_fitted": system.with_energy,
        "candidates": table,
    }
    return FittedLaw(law, report_axes(law, states, choice, slopes[place]))


def largest_slope(law: JointLaw) -> float:
    """Return the largest eigenvalue of ∂τ/∂u over the box: below zero for a stable law."""
    box = law.domain.box
    points = scipy.stats.qmc.Sobol(len(box), scramble=False).random(PLACES)
    at = box[:, 0] + np.ptp(box, axis=1) * points
    m = len(law.actuations)
    return float(np.linalg.eigvalsh(law.evaluate(at[:, :m], at[:, m:]).dtau_du).max())


def _degrees(system: _System) -> list[tuple[int, int]]:
    """Return degrees with few enough terms for the states, small ones first."""
    fitting = [
        (count, degrees)
        for degrees in DEGREES
        if (count := len(system.terms(degrees))) <= min(MOST_TERMS * system.equations, MOST_OF_ALL)
    ]
    return [degrees for _, degrees in sorted(fitting)]


def weighted_degree_exponents(actuation: int, deformation: int, m: int, k: int) -> Exponents:
    """Return (t, m + k) exponents with Σ i/`actuation` + Σ l/`deformation` ≤ 1, the constant left out."""
    found = [np.zeros((1, 0), np.int64)]
    share = np.zeros(1)
    for top in [actuation] * m + [deformation] * k:
        kept = [(one, s, e) for one, s in zip(found[-1], share, strict=True) for e in range(top + 1)]
        kept = [(one, s, e) for one, s, e in kept if s + e / top <= 1 + 1e-9]
        found.append(np.array([[*one, e] for one, _, e in kept], np.int64))
        share = np.array([s + e / top for _, s, e in kept])
    return found[-1][found[-1].any(axis=1)]


@dataclass(frozen=True, eq=False)
class _System:
    """The states to fit, scaled, and their data."""

    data: ModuleData
    domain: Domain
    ranges: Array

    @property
    def m(self) -> int:
        return len(self.data.actuations)

    @property
    def k(self) -> int:
        return len(self.data.axes)

    @cached_property
    def maps(self) -> Array:
        """(m + k, 2) centres and half-widths of the box."""
        box = self.domain.box
        return np.column_stack([box.mean(axis=1), np.ptp(box, axis=1) / 2])

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """Return (n,) whether energy and travels are given."""
        travels = np.isfinite(self.data.travel).all(axis=1)
        return np.asarray(np.isfinite(self.data.energy_j) & travels)

    @property
    def with_energy(self) -> bool:
        return bool(self.known.any())

    @cached_property
    def wanted(self) -> list[tuple[dict[int, int], Array, float]]:
        """Return, for each kind of equation, the derivative of −Π, values (n,) and weight. Those of τ come first."""
        data, m, k = self.data, self.m, self.k
        half, ranges = self.maps[:, 1], self.ranges
        found = [({m + i: 1}, data.tau[:, i], 1 / ranges[i]) for i in range(k)]
        for i in range(k):
            for j in range(m):
                found.append(({m + i: 1, j: 1}, data.dtau_dp[:, i, j], SLOPE_WEIGHT * half[j] / ranges[i]))
            for j in range(i, k):
                weight = SLOPE_WEIGHT * np.sqrt(half[m + i] * half[m + j] / (ranges[i] * ranges[j]))
                orders = {m + i: 2} if i == j else {m + i: 1, m + j: 1}
                found.append((orders, data.dtau_du[:, i, j], float(weight)))
        if self.with_energy:
            energy = ENERGY_WEIGHT / float(np.max(ranges * half[m:]))
            work = np.sum(data.actuation * data.travel, axis=1)
            found.append(({}, np.where(self.known, work - data.energy_j, np.nan), energy))
            for j in range(m):
                found.append(({j: 1}, np.where(self.known, data.travel[:, j], np.nan), energy * half[j]))
        return found

    def terms(self, degrees: tuple[int, int]) -> Exponents:
        """Return (t, m + k) exponents of these degrees that the states can determine."""
        every = weighted_degree_exponents(*degrees, self.m, self.k)
        return every if self.with_energy else every[every[:, self.m :].any(axis=1)]

    @property
    def equations(self) -> int:
        return sum(int(np.isfinite(values).sum()) for _, values, _ in self.wanted)

    def solve(self, degrees: tuple[int, int]) -> SeveralInputsFit | None:
        """Fit by least squares; return the fit and leave-one-out errors, or None if terms are undetermined."""
        data, m = self.data, self.m
        exponents = self.terms(degrees)
        at = np.column_stack([data.actuation, data.deformation])
        tables = [powers(at[:, d], self.maps[d], exponents[:, d], d >= m) for d in range(at.shape[1])]
        matrix, right, state = [], [], []
        for orders, values, weight in self.wanted:
            there = np.flatnonzero(np.isfinite(values))
            matrix.append(-weight * product(tables, orders)[there])
            right.append(weight * values[there])
            state.append(there)
        # Π is known up to a constant; the rest state has none.
        A, b, of_row = np.concatenate(matrix), np.concatenate(right), np.concatenate(state)
        if self.with_energy:
            A, b = self._less_rest(A, b, exponents)
        found = least_squares(A, b, of_row, self.k * len(data))
        if found is None:
            return None
        coefficients, misses, _ = found
        shares = misses.reshape(self.k, len(data)).T
        rmse = float(np.sqrt(np.mean(shares**2)))
        return SeveralInputsFit(degrees, exponents, coefficients, shares * self.ranges, rmse)

    def _less_rest(self, A: Array, b: Array, exponents: Exponents) -> tuple[Array, Array]:
        """Subtract the energy of the rest state, a = 0 and u = 0."""
        tables = [
            powers(np.zeros(1), self.maps[d], exponents[:, d], d >= self.m) for d in range(len(self.maps))
        ]
        place = next(k for k, (orders, _, _) in enumerate(self.wanted) if not orders)
        counts = [int(np.isfinite(values).sum()) for _, values, _ in self.wanted]
        rows = slice(sum(counts[:place]), sum(counts[: place + 1]))
        A = A.copy()
        A[rows] += self.wanted[place][2] * product(tables, {})
        return A, b

    def law(self, one: SeveralInputsFit) -> SeveralLaw:
        """Return the law of a candidate, with its error bar."""
        data = self.data
        bar = ErrorBar.from_residuals(self.domain.box, data.actuation, data.deformation, one.misses)
        return SeveralLaw(
            one.exponents,
            one.coefficients,
            self.maps,
            self.domain,
            data.actuation_name,
            data.axes,
            data.joint,
            bar,
        )
