"""The states of a fit in unit coordinates, as rows of least squares, and which of them are left out together."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.fem import FemDataset
from pliant.records.law import Domain, JointKind
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw

# Slopes of degree d are up to d² times steeper than the values: with equal weight they would rule the fit.
SLOPE_WEIGHT = 0.2
# Of Π over the product of the effort's range and the half-width in u, and of its slope.
POTENTIAL_WEIGHT = 1.0
FOLDS = 6
SEED = 0
# States closer than this, in scaled coordinates, are on one level.
LEVEL = 1e-3
# A bench reaches its levels only approximately: states in groups narrower than this, and further apart, count too.
JITTER = 0.1
# Of up to this many levels two are left when an inner one is left out: they determine a straight line.
FEW_LEVELS = 3
# States are a grid if their levels have at most this number of crossings per state.
CROSSINGS = 2.0

Terms = NDArray[np.int64]
Mask = NDArray[np.bool_]


class System:
    """The states in x, v ∈ [−1, 1] and τ / range, with the rows of slopes that the data have.

    Attributes:
        x, v, values: (n,) the states.
        range: max − min of the effort, N·m.
        potential, travel: (n,) Π = U − p·travel and −∂Π/∂x, scaled; NaN if a state lacks one of them.
        few: whether the data have so few levels of x, of v, that terms must be linear in it.
        folds: masks (n,) of states that are left out together (`_folds`).
        grid: whether the states are on crossings of levels, so that neighbours predict left-out single states.
    """

    def __init__(self, data: FemDataset, domain: Domain) -> None:
        self.data, self.domain = data, domain
        # centre and half-width
        sides = (domain.actuation, domain.deformation[0])
        self.x_map, self.v_map = (np.array([side.mean(), np.ptp(side) / 2]) for side in sides)
        self.x = (data.actuation - self.x_map[0]) / self.x_map[1]
        self.v = (data.angle_rad - self.v_map[0]) / self.v_map[1]
        self.range = float(np.ptp(data.moment_n_m))
        self.values = data.moment_n_m / self.range
        self.slopes = (
            data.dmoment_dp * self.x_map[1] / self.range,
            data.dmoment_du * self.v_map[1] / self.range,
        )
        travel = np.full(len(self.x), np.nan) if data.travel is None else data.travel
        held, unit = data.energy_j - data.actuation * travel, self.range * self.v_map[1]
        self.potential = held / unit
        self.travel = np.where(np.isfinite(held), travel, np.nan) * self.x_map[1] / unit
        # Slopes are from computations, which reach their levels exactly and give more than one value for each.
        slopes_known = [bool(np.isfinite(slope).any()) for slope in self.slopes]
        levels = [coordinate_levels(c, 0.0 if any(slopes_known) else JITTER) for c in (self.x, self.v)]
        self.few = [
            bool(level.max() < FEW_LEVELS) and not known
            for level, known in zip(levels, slopes_known, strict=True)
        ]
        self.folds = _folds(levels)
        crossings = np.prod([level.max() + 1 for level in levels])
        self.grid = bool(crossings <= CROSSINGS * len(self.x))

    def rows(self, terms: Terms) -> tuple[Array, Array, NDArray[np.int64]]:
        """Return matrix (m, k), right-hand side (m,), state of each row (m,); the n rows of values come first.

        The effort τ of a term is T_i(x) T_j(v), its energy Π the integral −T_i ∫T_j from v = 0. Terms with j = −1 are
        those of Π that bear no effort, T_i(x); with them Π and its slope by x are fitted too.
        """
        (X, DX), (V, DV) = _chebyshev(self.x, terms[:, 0].max()), _chebyshev(self.v, terms[:, 1].max())
        i, j = terms[:, 0], np.maximum(terms[:, 1], 0)
        bears = terms[:, 1] >= 0
        wanted = [
            (bears * X[:, i] * V[:, j], self.values, 1.0),
            (bears * DX[:, i] * V[:, j], self.slopes[0], SLOPE_WEIGHT),
            (bears * X[:, i] * DV[:, j], self.slopes[1], SLOPE_WEIGHT),
        ]
        if not bears.all():
            # ∫ T_0 … from 0 to v
            series = [chebyshev.chebint(one, lbnd=0) for one in np.eye(j.max() + 1)]
            integrals = np.stack([chebyshev.chebval(self.v, one) for one in series], axis=1)
            integral = np.where(bears, -integrals[:, j], 1.0)
            wanted.append((X[:, i] * integral, self.potential, POTENTIAL_WEIGHT))
            wanted.append((-DX[:, i] * integral, self.travel, POTENTIAL_WEIGHT))
        matrix, right, state = [], [], []
        for block, given, weight in wanted:
            known = np.flatnonzero(np.isfinite(given))
            matrix.append(weight * block[known])
            right.append(weight * given[known])
            state.append(known)
        return np.concatenate(matrix), np.concatenate(right), np.concatenate(state)

    def law(self, terms: Terms, solution: Array) -> PolynomialLaw:
        """Return the law of Chebyshev coefficients, in monomials of x and v."""
        bears = terms[:, 1] >= 0
        terms, solution = terms[bears], solution[bears]
        table = np.zeros(terms.max(axis=0) + 1)
        table[terms[:, 0], terms[:, 1]] = solution * self.range
        for axis in (0, 1):
            table = np.apply_along_axis(_monomials, axis, table)
        data = self.data
        return PolynomialLaw(
            table,
            self.x_map,
            self.v_map,
            self.domain,
            actuation_name=data.actuation_name,
            axes=(data.axis,),
            joint=one_axis_joint(data),
        )


def values_at(terms: Terms, x: Array, v: Array) -> Array:
    """Return (n, k) efforts of the terms at points of [−1, 1]²."""
    X, V = (chebyshev.chebvander(c, int(terms[:, k].max())) for k, c in enumerate((x, v)))
    return X[:, terms[:, 0]] * V[:, np.maximum(terms[:, 1], 0)] * (terms[:, 1] >= 0)


def one_axis_joint(data: FemDataset) -> JointKind:
    """Return the joint of a one-axis law: each axis of a spherical joint's data turns alone."""
    return "prismatic" if data.joint == "prismatic" else "revolute"


def _folds(levels: list[NDArray[np.int64]]) -> list[Mask]:
    """Return states left out together: whole inner levels of actuation, then of angle.

    FEM states stand on a grid. With single states left out, a polynomial that swings between the levels
    predicts the missing state from its row and column, and the error looks far too small.
    """
    folds = []
    for level in levels:
        # The outer levels stay: leaving them out would score extrapolation.
        inner = np.random.default_rng(SEED).permutation(np.arange(1, level.max()))
        folds += [np.isin(level, inner[k::FOLDS]) for k in range(min(FOLDS, len(inner)))]
    n = len(levels[0])
    return folds or [np.arange(n) == k for k in range(n)]


def coordinate_levels(coordinate: Array, jitter: float = 0.0) -> NDArray[np.int64]:
    """Return (n,) number of each state's level, from 0 in ascending order.

    Groups narrower than `jitter` and further apart are levels; where there are other groups, equal values are.
    """
    order = np.argsort(coordinate, kind="stable")
    steps = np.diff(coordinate[order])
    level = np.empty(len(coordinate), np.int64)
    for gap in (jitter, LEVEL) if jitter else (LEVEL,):
        level[order] = np.concatenate([[0], np.cumsum(steps > gap)])
        if gap == LEVEL or all(np.ptp(coordinate[level == k]) < gap for k in range(level.max() + 1)):
            break
    return level


def _chebyshev(x: Array, degree: int) -> tuple[Array, Array]:
    """Return T_0…T_degree and their derivatives at x, both (n, degree + 1)."""
    values = np.asarray(chebyshev.chebvander(x, degree), dtype=np.float64)
    slopes = np.zeros_like(values)
    for k in range(1, degree + 1):
        slopes[:, k] = chebyshev.chebval(x, chebyshev.chebder(np.eye(degree + 1)[k]))
    return values, slopes


def _monomials(coefficients: Array) -> Array:
    """Return monomial coefficients of a Chebyshev series, same length (cheb2poly drops trailing zeros)."""
    powers = chebyshev.cheb2poly(coefficients)
    return np.pad(powers, (0, len(coefficients) - len(powers)))
