"""The linear system of a polynomial energy: equations of FEM states for Π and its derivatives; cross-validation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # scipy.stats, half a second, only where a law is fitted
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.fem import ModuleData
from pliant.records.law import Domain
from pliant_plugins.surrogates.polynomial.energy import EnergyBasis, Exponents, unit
from pliant_plugins.surrogates.polynomial.scoring import axes_known
from pliant_plugins.surrogates.polynomial.states import Mask

# As in a fit of one axis: slopes of degree d are up to d² times steeper than the values.
SLOPE_WEIGHT = 0.2
# Relative to the largest product of an effort's range and its axis' half-width.
ENERGY_WEIGHT = 1.0
# States closer than this share of the half-widths are one, mirror images in the lateral axes too.
SAME_PLACE = 1e-6
DETERMINED = 1e-9
WORST_CONDITION = 1e10


@dataclass(frozen=True, eq=False)
class EnergySolution:
    """Coefficients (m,) in J; misses (n, k), predicted minus true τ, each place left out in turn.

    `doubts` (n, k) are the standard deviations foretold for the misses over the ranges, for rows with a noise of 1.
    """

    coefficients: Array
    misses: Array
    doubts: Array


def least_squares(
    matrix: Array, right: Array, place: NDArray[np.int64], told: int
) -> tuple[Array, Array, Array] | None:
    """Fit the coefficients (t,) of an energy; return closed-form leave-one-place-out errors of the first `told` rows.

    Args:
        matrix, right: (r, t) and (r,) rows of −Π's derivatives, those of τ first.
        place: (r,) number of a row's place; rows of one place are left out together.
        told: number of rows of τ.

    Returns:
        Coefficients; errors (n_τ,) of the rows of τ, predicted minus true; their predicted standard deviations (n_τ,)
        for rows with a noise of 1. None if the rows, or those without some place, do not determine all terms.
    """
    sizes = np.linalg.norm(matrix, axis=0)
    if len(matrix) < matrix.shape[1] or not sizes.all():
        return None
    Q, R = np.linalg.qr(matrix / sizes)
    diagonal = np.abs(np.diagonal(R))
    if diagonal.max() > WORST_CONDITION * diagonal.min():
        return None
    coefficients = np.linalg.solve(R, Q.T @ right) / sizes
    residual = right - Q @ (Q.T @ right)
    misses, doubts = np.empty(told), np.empty(told)
    for one in range(place.max() + 1):
        rows = np.flatnonzero(place == one)
        values, vectors = np.linalg.eigh(np.eye(len(rows)) - Q[rows] @ Q[rows].T)
        if values[0] < DETERMINED:
            return None
        of_tau = rows < told
        missed = vectors @ ((vectors.T @ residual[rows]) / values)
        misses[rows[of_tau]] = -missed[of_tau]
        doubts[rows[of_tau]] = np.sqrt(np.sum(vectors**2 / values, axis=1))[of_tau]
    return coefficients, misses, doubts


class EnergySystem:
    """Scaled states and their data: τ, its slopes, the energy U − p·travel and −travel.

    At a converged state with fixed p and u, Π(p, u) = U − p·travel is stationary in all other unknowns, so that
    ∂Π/∂u = −τ and ∂Π/∂p = −travel; Π is fitted with terms of p alone if the data have both.

    Attributes:
        ranges: (k,) divisors of τ of each axis.
        with_energy: whether energies and travels are fitted.
        weights: (n,) of the states' equations, 1 by default.
        alone: (n,) marks states in which all lateral axes are at zero.
        places: (n,) number of each state's place; states of one place are left out together.
    """

    def __init__(
        self,
        data: ModuleData,
        domain: Domain,
        ranges: Array,
        with_energy: bool = True,
        weights: Array | None = None,
    ) -> None:
        self.weights = np.ones(len(data)) if weights is None else weights
        self.data, self.domain, self.ranges = data, domain, ranges
        self.actuation_map = _centred(domain.actuation)
        self.deformation_map = np.array([_centred(side) for side in domain.deformation])
        self.known = np.isfinite(data.energy_j) & np.isfinite(data.travel)
        self.with_energy = with_energy and bool(self.known.any())
        self.places = self._places()
        lateral = [k for k, axis in enumerate(data.axes) if axis != data.main_axis]
        away = np.abs(data.deformation[:, lateral]) > SAME_PLACE * self.deformation_map[lateral, 1]
        self.alone: Mask = np.logical_not(np.any(away, axis=1))
        self._columns: dict[tuple[int, ...], Array] = {}
        self._right, self._state = np.zeros(0), np.zeros(0, np.int64)

    def part(self, keep: NDArray[np.bool_]) -> EnergySystem:
        """Return the system of the states that a mask (n,) selects."""
        kept = self.data.rows(keep)
        return EnergySystem(kept, self.domain, self.ranges, self.with_energy, self.weights[keep])

    def weighted(self, weights: Array) -> EnergySystem:
        """Return the system with other weights (n,)."""
        return EnergySystem(self.data, self.domain, self.ranges, self.with_energy, weights)

    def basis(self, terms: Exponents) -> EnergyBasis:
        """Return the terms with this system's scales."""
        return EnergyBasis(terms, self.actuation_map, self.deformation_map)

    def rows(self, terms: Exponents) -> tuple[Array, Array, NDArray[np.int64]]:
        """Return matrix (r, m), right-hand side (r,) and state (r,) of each row; the n·k rows of τ come first."""
        data, k = self.data, len(self.ranges)
        p_scale, u_scale = self.actuation_map[1], self.deformation_map[:, 1]
        energy = float(np.max(self.ranges * u_scale))
        wanted = [(unit(1 + k, 1 + i), data.tau[:, i], -1 / self.ranges[i]) for i in range(k)]
        for i in range(k):
            weight = -SLOPE_WEIGHT / self.ranges[i] * p_scale
            wanted.append((unit(1 + k, 0, 1 + i), data.dtau_dp[:, i], weight))
            for j in range(i, k):
                shared = np.sqrt(u_scale[i] * u_scale[j] / (self.ranges[i] * self.ranges[j]))
                wanted.append((unit(1 + k, 1 + i, 1 + j), data.dtau_du[:, i, j], -SLOPE_WEIGHT * shared))
        if self.with_energy:
            held = np.where(self.known, data.energy_j - data.actuation * data.travel, np.nan)
            travel = np.where(self.known, data.travel, np.nan)
            wanted.append((unit(1 + k), -held, -ENERGY_WEIGHT / energy))
            wanted.append((unit(1 + k, 0), travel, -ENERGY_WEIGHT / energy * p_scale))
        basis, matrix, right, state = self.basis(terms), [], [], []
        for orders, value, weight in wanted:
            there = np.flatnonzero(np.isfinite(value))
            block = basis.derivative(data.actuation[there], data.deformation[there], orders)
            of_state = self.weights[there]
            matrix.append((weight * of_state)[:, None] * block)
            right.append(abs(weight) * of_state * value[there])
            state.append(there)
        return np.concatenate(matrix), np.concatenate(right), np.concatenate(state)

    def prepare(self, sets: Sequence[Exponents]) -> None:
        """Compute the columns of all terms of these sets at once, for `solve`."""
        missing = [t for t in {tuple(t) for terms in sets for t in terms.tolist()} if t not in self._columns]
        if missing:
            columns, self._right, self._state = self.rows(np.array(missing))
            self._columns.update(zip(missing, columns.T, strict=True))

    def solve(self, terms: Exponents) -> EnergySolution | None:
        """Fit by least squares; return the fit and left-out errors, or None if the states do not determine it."""
        self.prepare([terms])
        matrix = np.column_stack([self._columns[tuple(t)] for t in terms.tolist()])
        right, state = self._right, self._state
        found = least_squares(matrix, right, self.places[state], self.data.tau.size)
        if found is None:
            return None
        coefficients, misses, doubts = found
        of_state, weight = (len(self.ranges), len(self.data)), self.weights[:, None]
        return EnergySolution(
            coefficients,
            misses.reshape(of_state).T * self.ranges / weight,
            doubts.reshape(of_state).T / weight,
        )

    def _places(self) -> NDArray[np.int64]:
        """Return the number (n,) of each state's place: a state and its mirror image share one."""
        data = self.data
        u = (data.deformation - self.deformation_map[:, 0]) / self.deformation_map[:, 1]
        lateral = [k for k, axis in enumerate(data.axes) if axis != data.main_axis]
        u[:, lateral] = np.abs(u[:, lateral])
        x = (data.actuation - self.actuation_map[0]) / self.actuation_map[1]
        rounded = np.round(np.column_stack([x, u]) / SAME_PLACE).astype(np.int64)
        _, place = np.unique(rounded, axis=0, return_inverse=True)
        return place.ravel()


def _centred(limits: Array) -> Array:
    """Return (2,) centre and half-width; exactly 0 is the centre of a symmetric side."""
    centre, half = float(limits.mean()), float(np.ptp(limits)) / 2
    return np.array([0.0 if abs(centre) < SAME_PLACE * half else centre, half])


# Points of the box at which the bar's shape is kept, and how far each of them reaches.
PLACES = 512
REACH = 0.25
FEWEST_SCORES = 10


def error_bar(system: EnergySystem, terms: Exponents, solution: EnergySolution) -> ErrorBar:
    """Return the bar with the predictive deviation of least squares (as `posterior.CoefficientPosterior`).

    Scores are the misses of places left out over the deviation foretold for them, of all axes together: each axis
    where it is explored or held.
    """
    k = len(system.ranges)
    box = np.concatenate([system.domain.actuation[None], system.domain.deformation])
    places = 2 * scipy.stats.qmc.Sobol(1 + k, scramble=False).random(PLACES) - 1
    sizes = shape(system, terms, box.mean(axis=1) + places * np.ptp(box, axis=1) / 2) * system.ranges
    known = axes_known(system.data)
    scores = (np.abs(solution.misses) / system.ranges / solution.doubts)[known]
    scores = scores[np.isfinite(scores)]
    if len(scores) < FEWEST_SCORES:
        return ErrorBar.from_residuals(box, system.data.actuation, system.data.deformation, solution.misses)
    return ErrorBar.from_shape(box, places, sizes, np.tile(scores[:, None], (1, k)), REACH)


def shape(system: EnergySystem, terms: Exponents, at: Array) -> Array:
    """Return (n, k) predictive deviation of τ over its range at p, u (n, 1 + k), for a noise of 1."""
    matrix = system.rows(terms)[0]
    norms = np.linalg.norm(matrix, axis=0)
    root = np.asarray(np.linalg.qr(matrix / norms, mode="r"))
    k, basis = len(system.ranges), system.basis(terms)
    found = np.empty((len(at), k))
    for i in range(k):
        rows = basis.derivative(at[:, 0], at[:, 1:], unit(1 + k, 1 + i)) / (system.ranges[i] * norms)
        found[:, i] = np.sqrt(1 + np.sum(solve_triangular(root, rows.T, trans="T") ** 2, axis=0))
    return found
