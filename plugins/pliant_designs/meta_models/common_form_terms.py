"""Which terms x^i v_1^j … of an energy a family's designs share, and the equations that their states give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.records.actuation import Levels
from pliant.records.design import Array
from pliant.records.fem import ModuleData
from pliant_designs.meta_models.common_form_scales import fitted
from pliant_plugins.surrogates.polynomial.energy import EnergyBasis, Exponents, unit
from pliant_plugins.surrogates.polynomial.several_fit import DEGREES as SEVERAL_DEGREES
from pliant_plugins.surrogates.polynomial.several_fit import weighted_degree_exponents as several_terms

# As in the polynomial surrogate: slopes of a polynomial are steeper than its values.
SLOPE_WEIGHT = 0.2
# From this many times an axis' typical effort on, errors count relative to the effort.
LARGE = 2.0
# How many powers of the main axis a power of a side axis counts for.
COST = 1.5
# Efforts of side axes below this share of their range, with the side axes at rest, count as zero.
SYMMETRY = 1e-5
# With several actuations: the cost of a fit grows with its cube, the cost of a law in an engine linearly.
MOST_TERMS = 360


@dataclass(frozen=True, eq=False)
class Equations:
    """Weighted equations of the states of one design, in scaled units: rows · c = right.

    Attributes:
        rows: (e, m) derivatives of the terms.
        right: (e,) scaled efforts and slopes.
        state: (e,) the state that each stems from.
        value: (e,) whether it is an effort, no slope.
    """

    rows: Array
    right: Array
    state: NDArray[np.int64]
    value: NDArray[np.bool_]

    def select_states(self, keep: NDArray[np.bool_]) -> Equations:
        """Return the equations of the states that a mask chooses."""
        chosen = keep[self.state]
        return Equations(self.rows[chosen], self.right[chosen], self.state[chosen], self.value[chosen])

    def lifted(self, lift: Array) -> Equations:
        """Return the equations for z with c = lift · z."""
        return Equations(self.rows @ lift, self.right, self.state, self.value)


def orthonormal(blocks: Sequence[Equations]) -> Array:
    """Return (m, m) L with c = L z such that |z|² is the mean square of the equations over all designs."""
    rows = np.concatenate([one.rows / np.sqrt(len(blocks) * len(one.right)) for one in blocks])
    held = 1e-7 * np.abs(rows).max() * np.eye(rows.shape[1])
    return np.linalg.inv(np.linalg.qr(np.concatenate([rows, held]), mode="r"))


def scaled_basis(exponents: Exponents) -> EnergyBasis:
    """Return terms of scaled variables: actuations by their largest values, deformations by their reach."""
    k = exponents.shape[1] - 1  # all but the first coordinate, further actuations among them
    return EnergyBasis(exponents, np.array([0.0, 1.0]), np.tile([0.0, 1.0], (k, 1)))


def equations(
    data: ModuleData, exponents: Exponents, actuation: Levels, sizes: Array, weights: Array
) -> Equations:
    """Return equations of the trusted states of role "fit" of one design.

    Args:
        actuation: scale of the actuation; (m,) of several.
        sizes: (k + 1,) reach of each axis and energy of this design.
        weights: (k,) weight of each axis.
    """
    keep = fitted(data)
    reach, energy = sizes[:-1], sizes[-1]
    basis, m, k = scaled_basis(exponents), len(data.actuations), len(data.axes)
    x, v = data.actuation[keep] / actuation, data.deformation[keep] / reach

    def derivative_rows(*places: int) -> Array:
        # τ = −∂Π/∂u: the minus sign of every row.
        return -basis.derivative(x, v, unit(m + k, *places))

    n = int(keep.sum())
    scales, gains = np.reshape(actuation, -1), data.dtau_dp[keep].reshape(n, k, m)
    blocks: list[tuple[Array, Array, bool]] = []
    for i in range(k):
        to_unit = weights[i] * reach[i] / energy
        blocks.append((weights[i] * derivative_rows(m + i), to_unit * data.tau[keep, i], True))
        for j in range(m):
            by_p = SLOPE_WEIGHT * to_unit * scales[j] * gains[:, i, j]
            blocks.append((SLOPE_WEIGHT * weights[i] * derivative_rows(j, m + i), by_p, False))
        for j in range(i, k):
            weight = SLOPE_WEIGHT * np.sqrt(weights[i] * weights[j])
            by_u = weight * reach[i] * reach[j] / energy * data.dtau_du[keep, i, j]
            blocks.append((weight * derivative_rows(m + i, m + j), by_u, False))
    blocks = [_tempered(*block) for block in blocks]
    rows, right = (np.concatenate([block[k] for block in blocks]) for k in (0, 1))
    state, value = np.tile(np.arange(n), len(blocks)), np.repeat([block[2] for block in blocks], n)
    known = np.isfinite(right)
    return Equations(rows[known], right[known], state[known], value[known])


def _tempered(rows: Array, right: Array, value: bool) -> tuple[Array, Array, bool]:
    """Weight equations far larger than typical ones by their relative error: efforts at a stop are huge."""
    size = np.where(np.isfinite(right), np.abs(right), 0.0) / (LARGE if value else LARGE * SLOPE_WEIGHT * 2)
    weight = 1 / np.sqrt(1 + size**2)
    return rows * weight[:, None], right * weight, value


def term_sets(axes: int, main: int, even: bool, actuations: int = 1) -> list[Exponents]:
    """Return sets of exponents (t, m + k), small ones first; `even`: unchanged under a sign change of side axes.

    Of several actuations none is the one that drives the main axis: all axes count alike, as in the polynomial law.
    """
    if actuations > 1:
        every = (several_terms(*degrees, actuations, axes) for degrees in SEVERAL_DEGREES)
        moving = [one[one[:, actuations:].any(axis=1)] for one in every]
        return [_by_degree(one) for one in sorted(moving, key=len) if len(one) <= MOST_TERMS]
    sides = [k for k in range(axes) if k != main]
    if not sides:
        degrees = [(1, 3), (2, 3), (2, 4), (3, 5), (4, 6), (4, 7), (5, 8)]
    else:
        degrees = [(1, 3), (2, 4), (2, 6), (3, 8), (3, 11), (3, 14)]
    return [_terms(axes, main, sides, even, *degree) for degree in degrees]


def _by_degree(exponents: Exponents) -> Exponents:
    """Sort the exponents by degree, so that `orthonormal` orthogonalises each term to those of lower degree."""
    return exponents[np.lexsort((*exponents.T[::-1], exponents.sum(axis=1)))]


def _terms(axes: int, main: int, sides: list[int], even: bool, top_x: int, top_v: int) -> Exponents:
    """Return terms with i/I + (j + 2 (side powers))/J ≤ 1 for efforts of degree I and J, at most four side powers."""
    found = []
    for powers in np.ndindex(*([top_x + 1] + [top_v + 2] * axes)):
        i, u = powers[0], np.array(powers[1:])
        across = int(u[sides].sum())
        if u.sum() == 0 or across > 4 or (even and across % 2):
            continue
        if i / top_x + (int(u[main]) + COST * across - 1) / top_v <= 1 + 1e-9:
            found.append((i + int(u[main]) + COST * across, powers))
    return np.array([powers for _, powers in sorted(found)], np.int64)  # as `_by_degree`, with the costs


def is_even(data: tuple[ModuleData, ...], ranges: Array) -> bool:
    """Return whether side axes at rest have no effort in any fitted state: the module then has a plane of symmetry."""
    if len(data[0].actuations) > 1:  # any of them may bend the module about any axis
        return False
    for one in data:
        main = one.axes.index(one.main_axis)
        sides = np.array([k for k in range(len(one.axes)) if k != main])
        if not len(sides):
            return False
        rest = fitted(one) & np.all(np.abs(one.deformation[:, sides]) < 1e-9, axis=1)
        if np.any(np.abs(one.tau[rest][:, sides]) > SYMMETRY * ranges[sides]):
            return False
    return True
