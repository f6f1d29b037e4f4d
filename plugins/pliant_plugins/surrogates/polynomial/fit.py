"""Least squares of values and slopes; the degree is chosen by leaving out whole levels of the data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.fem import FemDataset
from pliant.records.law import Domain, JointKind
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw, largest_slope

# Slopes of degree d are up to d² times steeper than the values: with equal weight they would rule the fit.
SLOPE_WEIGHT = 0.2
FAR_MORE = 5.0  # times the folds' error: such misses of fitted states count instead of it
FOLDS = 6
SEED = 0
# States closer than this share of the half-range stand on one level.
LEVEL = 1e-3
# A bench meets its levels only nearly: states in groups narrower than this, and further apart, stand on levels too.
JITTER = 0.1
# Of up to this many levels two are left when an inner one is left out: they determine a straight line.
FEW_LEVELS = 3
# Errors below this share of the effort's range are all the same to everyone.
NEGLIGIBLE = 1e-10
RANK_TOLERANCE = 1e-10
# Stability may cost a factor of 3 and 0.2 % of the range; snap-through that is in the data costs more.
STABILITY_PRICE = (3.0, 2e-3)

Terms = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Candidate:
    """One set of terms with its cross-validated error, as shares of the effort's range.

    `rmse_se` is the standard error of `rmse` over the folds; `law` is fitted to all states of role "fit".
    """

    degree: int
    actuation_degree: int
    n_terms: int
    rmse: float
    rmse_se: float
    largest_slope: float
    law: PolynomialLaw


def fit_adaptive(data: FemDataset, domain: Domain, max_degree: int) -> tuple[Candidate, list[Candidate]]:
    """The chosen candidate and all that the states determine.

    Chosen is the one with the fewest terms whose error is within one standard error of the smallest, among
    the laws that are stable over the whole domain if one of them is about as good as the best: polynomials
    swing where a box has no data, while a module that really snaps through keeps its instability, which is
    reported. Deterministic. Raises `UserError` when the states do not determine even a plane.
    """
    system = _System(data, domain)
    sets = _term_sets(max_degree, *system.few)
    candidates = [c for terms in sets if (c := _candidate(system, *terms)) is not None]
    if not candidates:
        raise UserError(
            f"the {len(data)} states lie on one line of {data.actuation_name} and angle_rad and determine no "
            "law: add states at other angles under the same actuation"
        )
    best = min(candidates, key=lambda c: c.rmse)
    stable = [c for c in candidates if c.largest_slope < 0]
    affordable = STABILITY_PRICE[0] * best.rmse + STABILITY_PRICE[1]
    eligible = stable if any(c.rmse <= affordable for c in stable) else candidates
    best = min(eligible, key=lambda c: c.rmse)
    limit = best.rmse + best.rmse_se + NEGLIGIBLE
    chosen = min((c for c in eligible if c.rmse <= limit), key=lambda c: (c.n_terms, c.rmse))
    return chosen, candidates


def _term_sets(max_degree: int, few_x: bool, few_v: bool) -> Iterator[tuple[int, int, Terms]]:
    """Exponents (i, j) of x^i v^j with i/I + j/J ≤ 1: total degree, and half the degree in the actuation.

    Where the data have few levels of a coordinate, all terms are linear in it, and total degree with that limit
    joins the two: they have a product x v only beside squares of both.
    """
    seen = set()
    for degree in range(1, max_degree + 1):
        half = (degree + 1) // 2
        most = (1 if few_x else degree, 1 if few_v else degree)
        full = [(i, j) for i in range(degree + 1) for j in range(degree + 1)]
        sets = [[(i, j) for i, j in full if i * degree + j * top <= top * degree] for top in (degree, half)]
        if few_x or few_v:
            limited = [(i, j) for i, j in sets[0] if i <= most[0] and j <= most[1]]
            sets = [pairs for pairs in sets if set(pairs) <= set(limited)] + [limited]
        for pairs in sets:
            if tuple(pairs) not in seen:
                seen.add(tuple(pairs))
                yield degree, max(i for i, _ in pairs), np.array(pairs)


class _System:
    """The states in x, v ∈ [−1, 1] and τ / range, with the rows of slopes that the data have."""

    def __init__(self, data: FemDataset, domain: Domain) -> None:
        self.data, self.domain = data, domain
        self.x_map, self.v_map = _to_unit(domain.actuation), _to_unit(domain.deformation[0])
        self.x = (data.actuation - self.x_map[0]) / self.x_map[1]
        self.v = (data.angle_rad - self.v_map[0]) / self.v_map[1]
        self.range = float(np.ptp(data.moment_n_m))
        self.values = data.moment_n_m / self.range
        self.slopes = (
            data.dmoment_dp * self.x_map[1] / self.range,
            data.dmoment_du * self.v_map[1] / self.range,
        )
        # Slopes come from computations, which meet their levels and tell more of each than one value.
        slopes_known = [bool(np.isfinite(slope).any()) for slope in self.slopes]
        levels = [_levels(c, 0.0 if any(slopes_known) else JITTER) for c in (self.x, self.v)]
        self.few = [
            bool(level.max() < FEW_LEVELS) and not known
            for level, known in zip(levels, slopes_known, strict=True)
        ]
        self.folds = _folds(levels)

    def rows(self, terms: Terms) -> tuple[Array, Array, NDArray[np.int64]]:
        """Matrix (m, k), right-hand side (m,), state of each row (m,); the n rows of values come first."""
        (X, DX), (V, DV) = _chebyshev(self.x, terms[:, 0].max()), _chebyshev(self.v, terms[:, 1].max())
        i, j = terms.T
        matrix, right, state = [X[:, i] * V[:, j]], [self.values], [np.arange(len(self.x))]
        for block, slope in zip((DX[:, i] * V[:, j], X[:, i] * DV[:, j]), self.slopes, strict=True):
            known = np.flatnonzero(np.isfinite(slope))
            matrix.append(SLOPE_WEIGHT * block[known])
            right.append(SLOPE_WEIGHT * slope[known])
            state.append(known)
        return np.concatenate(matrix), np.concatenate(right), np.concatenate(state)

    def law(self, terms: Terms, solution: Array) -> PolynomialLaw:
        """The law of Chebyshev coefficients, in monomials of x and v."""
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
            joint=joint_of(data),
        )


def joint_of(data: FemDataset) -> JointKind:
    """The joint of a law of one axis: of a spherical joint's data each axis turns alone."""
    return "prismatic" if data.joint == "prismatic" else "revolute"


def _candidate(system: _System, degree: int, actuation_degree: int, terms: Terms) -> Candidate | None:
    """Cross-validate one set of terms; None where the states of any fold do not determine all its terms."""
    matrix, right, state = system.rows(terms)
    n = len(system.x)
    squares = []
    for left_out in system.folds:
        train = ~left_out[state]
        solution = _solve(matrix[train], right[train])
        if solution is None:
            return None
        squares.append((matrix[:n][left_out] @ solution - right[:n][left_out]) ** 2)
    solution = _solve(matrix, right)
    if solution is None:
        return None
    rmse = float(np.sqrt(np.concatenate(squares).mean()))
    # few levels: states that are never left out, at the box's corners, may show what the folds cannot
    kept = ~np.any(system.folds, axis=0)
    if kept.any():
        missed = float(np.sqrt(np.mean((matrix[:n][kept] @ solution - right[:n][kept]) ** 2)))
        rmse = missed if missed > FAR_MORE * rmse else rmse
    spread = float(np.std([fold.mean() for fold in squares]) / np.sqrt(len(squares)))
    law = system.law(terms, solution)
    standard_error = spread / (2 * rmse) if rmse else 0.0
    return Candidate(degree, actuation_degree, len(terms), rmse, standard_error, largest_slope(law), law)


def _solve(matrix: Array, right: Array) -> Array | None:
    if len(matrix) < matrix.shape[1]:
        return None
    solution: Array
    solution, _, rank, _ = np.linalg.lstsq(matrix, right, rcond=RANK_TOLERANCE)  # type: ignore[assignment]
    return solution if rank == matrix.shape[1] else None


def _folds(levels: list[NDArray[np.int64]]) -> list[Mask]:
    """States left out together: whole inner levels of actuation, then of angle.

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


def _levels(coordinate: Array, jitter: float) -> NDArray[np.int64]:
    """(n,) number of each state's level, from 0 in ascending order.

    Groups narrower than `jitter` and further apart are levels; where there are other groups, equal values are.
    """
    order = np.argsort(coordinate, kind="stable")
    steps = np.diff(coordinate[order])
    level = np.empty(len(coordinate), np.int64)
    for gap in (jitter, LEVEL):
        level[order] = np.concatenate([[0], np.cumsum(steps > gap)])
        if all(np.ptp(coordinate[level == k]) < gap for k in range(level.max() + 1)):
            break
    return level


def _to_unit(limits: Array) -> Array:
    """(2,) centre and half-width."""
    return np.array([limits.mean(), np.ptp(limits) / 2])


def _chebyshev(x: Array, degree: int) -> tuple[Array, Array]:
    """T_0…T_degree and their derivatives at x, both (n, degree + 1)."""
    values = np.asarray(chebyshev.chebvander(x, degree), dtype=np.float64)
    slopes = np.zeros_like(values)
    for k in range(1, degree + 1):
        slopes[:, k] = chebyshev.chebval(x, chebyshev.chebder(np.eye(degree + 1)[k]))
    return values, slopes


def _monomials(coefficients: Array) -> Array:
    """Monomial coefficients of a Chebyshev series, same length (cheb2poly drops trailing zeros)."""
    powers = chebyshev.cheb2poly(coefficients)
    return np.pad(powers, (0, len(coefficients) - len(powers)))
