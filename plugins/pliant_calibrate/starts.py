"""Starting point of a search for laws with powers, such as Ogden's, whose error has several minima.

Once the powers are fixed, the stress of an incompressible solid is linear in the moduli, so that linear least squares
gives the moduli. Only the powers are searched, from the study's own and from every set out of `POWERS`.
Sources: Golub, Pereyra, SIAM J. Numer. Anal. 10 (1973) 413 (variable projection); Kaufman, BIT 15 (1975) 49 (slopes).
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant_calibrate.fitting import BlackBox, minimised

POWERS = (-6.0, -3.0, -1.3, 1.3, 2.5, 4.5, 8.0)
SEARCHED = 5  # number of starts of smallest error that are searched
TRUNCATED = 1e-12  # singular values of the linear problem, relative to the largest


def best_start(problem: BlackBox, unstressed: Array, first: Array, linear: NDArray[np.bool_]) -> Array:
    """Return the constants (k,) of smallest error that a search of the powers finds; `first` if none is better.

    Args:
        problem: residuals that are linear in the moduli.
        unstressed: (n,) the residuals for zero moduli.
        first: the study's constants.
        linear: (k,) which of them are moduli.
    """
    reduced = _Reduced(problem, unstressed, first, linear)
    sets = [first[~linear], *map(np.array, combinations(POWERS, int(np.sum(~linear))))]
    with np.errstate(over="ignore", invalid="ignore"):  # invalid powers
        own = problem.residuals(first)
        errors = [(float(e @ e), k) for k, e in enumerate(map(reduced.error, sets)) if e is not None]
        found = [minimised(reduced.problem(), sets[k]) for _, k in sorted(errors)[:SEARCHED]]
        best = min((f for f in found if f is not None), key=lambda f: f.residuals @ f.residuals, default=None)
        if best is None or (own is not None and own @ own <= best.residuals @ best.residuals):
            return first
        values = reduced.constants(best.values)
    return first if values is None else values


@dataclass(frozen=True, eq=False)
class _Reduced:
    """The misfit as a function of only the powers; attributes as the arguments of `best_start`."""

    full: BlackBox
    unstressed: Array
    first: Array
    linear: NDArray[np.bool_]

    def problem(self) -> BlackBox:
        """Return the least-squares problem over the powers."""
        limit = None if self.full.limit is None else self.full.limit[~self.linear]
        ones = np.ones(int(np.sum(~self.linear)))
        full = self.full
        return _Projected(self.error, ones, full.step, True, full.tolerance, limit=limit, reduced=self)

    def constants(self, powers: Array) -> Array | None:
        """Return all constants (k,) for these powers, the moduli by linear least squares."""
        values, scales = self.first.copy(), self.full.scales
        values[~self.linear] = powers
        columns = []
        for k in np.flatnonzero(self.linear):
            alone = np.where(
                self.linear, 0.0, values
            )  # avoids the difference of two large stresses for any power
            alone[k] = scales[k]
            stressed = self.full.residuals(alone)
            if stressed is None:
                return None
            columns.append(stressed - self.unstressed)
        slopes = np.stack(columns, axis=1)
        sizes = np.maximum(np.linalg.norm(slopes, axis=0), np.finfo(float).tiny)
        moduli = np.linalg.lstsq(slopes / sizes, -self.unstressed, rcond=TRUNCATED)[0] / sizes
        values[self.linear] = moduli * scales[self.linear]
        return values

    def error(self, powers: Array) -> Array | None:
        """Return the residuals (n,) for these powers."""
        values = self.constants(powers)
        return None if values is None else self.full.residuals(values)


@dataclass(frozen=True, eq=False)
class _Projected(BlackBox):
    """The reduced misfit with slopes that need no search for each difference."""

    _: KW_ONLY
    reduced: _Reduced

    def jacobian(self, values: Array, here: Array) -> Array | None:
        """Return ∂r/∂powers (n, j) with adapted moduli: the part outside the span of the moduli's slopes (n, i)."""
        full, linear, whole = self.reduced.full, self.reduced.linear, self.reduced.constants(values)
        slopes = None if whole is None else full.jacobian(whole, here)
        if slopes is None:
            return None
        moduli, powers = slopes[:, linear], slopes[:, ~linear]
        moduli = moduli / np.maximum(np.linalg.norm(moduli, axis=0), np.finfo(float).tiny)
        return np.asarray(powers - moduli @ np.linalg.lstsq(moduli, powers, rcond=TRUNCATED)[0], float)
