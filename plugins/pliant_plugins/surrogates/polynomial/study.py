"""Fits of the form of the published study: by least squares of moments, or as published.

    τ(p, u) = k_n p + (m_a p + b_a) u − (m_e u²/2 + b_e u)

from the virtual work of an actuation part with the slope k_a(p) = m_a p + b_a and an elastic part with the
slope k_e(u) = m_e u + b_e (Yao, Howard, Maiolino, Adv. Intell. Syst. 2026, doi 10.1002/aisy.70406). The study took the
coefficients from finite differences of energies; here they follow from one linear least-squares problem in τ. b_a and
b_e enter as b_a − b_e only, so a fit reports b_a = 0.

The published procedure (`fit_differences`): finite differences of energies and moments.

Virtual work at a fixed actuation p: a step du takes the work τ du out of the module and the actuation's work into it,
so that dU = p dV − τ du with the strain energy U. The moment is split into

    τ(p, u) = A(p, u) − E(p, u),  E = ∂U/∂u elastic,  A = τ + ∂U/∂u of the actuation,

and the study takes the slope of A for a linear function of p alone, k_a = m_a p + b_a, and that of E for a linear
function of u alone, k_e = m_e u + b_e; then τ = ∫ (k_a − k_e) du + k_n p (Yao, Howard, Maiolino, Adv. Intell. Syst.
2026, doi 10.1002/aisy.70406).

The paper does not print every step. Assumed here: adjacent states are neighbours in u at one pressure; E is ΔU/Δu at
their midpoint, A there the mean moment plus E; k_e and k_a are differences of neighbouring E and A at the midpoints of
those; k_a over p and k_e over u are straight lines of least squares, all differences with equal weight; k_n p is the
line through zero that is nearest to the moments at u = 0, each interpolated between the two adjacent states (at
pressures whose states are on one side of u = 0: the residual of τ there without k_n p).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.fem import FemDataset
from pliant_plugins.surrogates.config import StudyCoefficients
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw

# A state that the others do not determine cannot be left out.
DETERMINED = 1e-9
FEWEST_MISSES = 4


def fit_study(data: FemDataset, odd: bool) -> StudyCoefficients:
    """Fit the four identifiable coefficients to the moments by least squares; slopes are not used.

    Raises `UserError` when the states do not determine them.
    """
    p, u = data.actuation, data.angle_rad
    columns = _columns(p, u, odd)
    scale = np.maximum(np.abs(columns).max(axis=0), np.finfo(float).tiny)
    solution, _, rank, _ = np.linalg.lstsq(columns / scale, data.moment_n_m, rcond=1e-10)
    if rank < 4:
        raise UserError(
            f"the published form has four coefficients and the {len(data)} states determine only {rank}: add "
            "states at other pressures and with other moments"
        )
    k_n, m_a, b, m_e = (float(value) for value in solution / scale)
    return StudyCoefficients(k_n=k_n, m_a=m_a, b_a=0.0, m_e=m_e, b_e=-b)


def study_bar(law: PolynomialLaw, data: FemDataset) -> ErrorBar | None:
    """Return the bar of a fitted law of the published form, from leave-one-out errors."""
    p, u = data.actuation, data.angle_rad
    columns = _columns(p, u, law.odd != 0.0)
    basis = np.linalg.qr(columns / np.abs(columns).max(axis=0))[0]
    free = 1 - np.sum(basis**2, axis=1)
    missed = law.evaluate(p, u[:, None]).tau[:, 0] - data.moment_n_m
    known = free > DETERMINED
    if np.sum(known) < FEWEST_MISSES:
        return None
    box = np.vstack([law.domain.actuation, law.domain.deformation])
    return ErrorBar.from_residuals(box, p[known], u[known, None], (missed[known] / free[known])[:, None])


def _columns(p: Array, u: Array, odd: bool) -> Array:
    """Return (n, 4) columns of k_n, m_a, b_a − b_e and m_e."""
    return np.stack([p, p * u, u, -u * (np.abs(u) if odd else u) / 2], axis=1)


# Second differences need three states; a line in p needs two pressures.
STATES, PRESSURES = 3, 2
# States closer than this share of the range count as one pressure, or as one angle.
SAME = 1e-6


@dataclass(frozen=True, eq=False)
class _AtOneActuation:
    """States at one actuation in ascending u, all (m,)."""

    actuation: float
    u: Array
    tau: Array
    energy: Array

    def slopes(self) -> tuple[Array, Array, Array]:
        """Return u, k_a and k_e, each (m − 2,)."""
        width = np.diff(self.u)
        middle = (self.u[1:] + self.u[:-1]) / 2
        elastic = np.diff(self.energy) / width
        driven = (self.tau[1:] + self.tau[:-1]) / 2 + elastic
        apart = np.diff(middle)
        return (middle[1:] + middle[:-1]) / 2, np.diff(driven) / apart, np.diff(elastic) / apart


def energies_known(data: FemDataset) -> bool:
    """Return whether the data have strain energies of states that the environment constrains off the free branch."""
    return bool(np.any(np.isfinite(data.energy_j) & (data.branch == "constrained")))


def fit_differences(data: FemDataset, odd: bool = False) -> StudyCoefficients:
    """Fit coefficients by the published procedure; `odd` takes k_e for linear in |u|.

    Raises:
        UserError: energies are not known on the constrained branch, or too few pressures or angles have states
            enough.
    """
    if not energies_known(data):
        raise UserError(
            "procedure 'finite_differences' needs strain energies (column energy_j) of constrained states, and the "
            "data have none: take 'procedure: least_squares'"
        )
    rows = _rows(data)
    if len(rows) < PRESSURES:
        raise UserError(
            f"procedure 'finite_differences' needs {STATES} states or more at each of {PRESSURES} or more values of "
            f"{data.actuation_name}, and the {len(data)} states have {len(rows)} such: take 'procedure: "
            "least_squares', or solve levels with 'fem.sampling: grid'"
        )
    slopes = [row.slopes() for row in rows]
    u, driven, elastic = (np.concatenate(part) for part in zip(*slopes, strict=True))
    p = np.concatenate([np.full(len(part[0]), row.actuation) for row, part in zip(rows, slopes, strict=True)])
    along = np.abs(u) if odd else u
    if np.ptp(along) <= SAME * np.ptp(data.angle_rad):
        raise UserError(
            "procedure 'finite_differences' needs a stiffness at two or more angles, and the states give it at one "
            f"({u[0]:.3g}): add angles, or take 'procedure: least_squares'"
        )
    m_a, b_a = _line(p, driven)
    m_e, b_e = _line(along, elastic)
    at_zero = np.array([_at_zero(row, (m_a, b_a), (m_e, b_e), odd) for row in rows])
    pressures = np.array([row.actuation for row in rows])
    k_n = float(pressures @ at_zero / (pressures @ pressures))
    return StudyCoefficients(k_n=k_n, m_a=m_a, b_a=b_a, m_e=m_e, b_e=b_e)


def _rows(data: FemDataset) -> list[_AtOneActuation]:
    """Return the pressures with enough states of known energy."""
    known = data.rows(np.isfinite(data.energy_j))
    order = np.argsort(known.actuation, kind="stable")
    steps = np.diff(known.actuation[order]) > SAME * np.ptp(known.actuation)
    rows = []
    for index in np.split(order, np.flatnonzero(steps) + 1):
        index = index[np.argsort(known.angle_rad[index], kind="stable")]
        apart = np.diff(known.angle_rad[index], prepend=-np.inf) > SAME * np.ptp(known.angle_rad)
        index = index[apart]
        if len(index) >= STATES:
            rows.append(
                _AtOneActuation(
                    float(known.actuation[index].mean()),
                    known.angle_rad[index],
                    known.moment_n_m[index],
                    known.energy_j[index],
                )
            )
    return rows


def _line(x: Array, y: Array) -> tuple[float, float]:
    """Fit slope and intercept by least squares."""
    centre = x.mean()
    slope = float((x - centre) @ y / ((x - centre) @ (x - centre)))
    return slope, float(y.mean() - slope * centre)


def _at_zero(
    row: _AtOneActuation, driven: tuple[float, float], elastic: tuple[float, float], odd: bool
) -> float:
    """Return τ at u = 0 under the row's actuation, with the lines k_a and k_e."""
    if row.u[0] <= 0.0 <= row.u[-1]:
        return float(np.interp(0.0, row.u, row.tau))
    nearest = int(np.argmin(np.abs(row.u)))
    u = float(row.u[nearest])
    k_a = driven[0] * row.actuation + driven[1]
    bent = u * (abs(u) if odd else u) / 2
    return float(row.tau[nearest]) - (k_a * u - elastic[0] * bent - elastic[1] * u)
