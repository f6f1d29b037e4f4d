"""The form of the published study, stated or fitted.

    τ(p, u) = k_n p + (m_a p + b_a) u − (m_e u²/2 + b_e u)

from the virtual work of an actuation part with the slope k_a(p) = m_a p + b_a and an elastic part with the
slope k_e(u) = m_e u + b_e (Yao, Howard, Maiolino, Adv. Intell. Syst. 2026, doi 10.1002/aisy.70406). The study
took the coefficients from finite differences of energies; here they are one linear least-squares problem in τ
itself. b_a and b_e enter as b_a − b_e only, so a fit reports b_a = 0.
"""

from __future__ import annotations

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.fem import FemDataset
from pliant.records.law import Domain, JointKind
from pliant_plugins.surrogates.polynomial.config import StatedDomain, StudyCoefficients
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw

# A state that the others do not determine cannot be left out.
DETERMINED = 1e-9
FEWEST_MISSES = 4
UNITY = np.array([0.0, 1.0])


def study_law(
    coefficients: StudyCoefficients,
    odd: bool,
    domain: Domain,
    actuation_name: str = "pressure_pa",
    axis: str = "y",
    joint: JointKind = "revolute",
) -> PolynomialLaw:
    """The law of the study's coefficients in SI; `odd` puts u|u| for u²."""
    k = coefficients
    table = np.zeros((2, 2 if odd else 3))
    table[1, 0] = k.k_n
    table[1, 1] = k.m_a
    table[0, 1] = k.b_a - k.b_e
    if not odd:
        table[0, 2] = -k.m_e / 2
    return PolynomialLaw(
        table, UNITY, UNITY, domain, -k.m_e / 2 if odd else 0.0, actuation_name, (axis,), joint
    )


def fit_study(data: FemDataset, odd: bool) -> StudyCoefficients:
    """Least squares of the moments in the four identifiable coefficients; slopes are not used.

    Raises `UserError` when the states do not determine them.
    """
    p, u = data.actuation, data.angle_rad
    columns = _columns(p, u, odd)
    scale = np.maximum(np.abs(columns).max(axis=0), np.finfo(float).tiny)
    solution, _, rank, _ = np.linalg.lstsq(columns / scale, data.moment_n_m, rcond=1e-10)
    if rank < 4:
        raise UserError(
            f"the study's form has four coefficients and the {len(data)} states determine only {rank}: add "
            "states at other pressures and with other moments"
        )
    k_n, m_a, b, m_e = (float(value) for value in solution / scale)
    return StudyCoefficients(k_n=k_n, m_a=m_a, b_a=0.0, m_e=m_e, b_e=-b)


def study_bar(law: PolynomialLaw, data: FemDataset) -> ErrorBar | None:
    """The bar of a fitted law of the study's form: each state's miss, grown to what it is with that state left out."""
    p, u = data.actuation, data.angle_rad
    columns = _columns(p, u, law.odd != 0.0)
    basis = np.linalg.qr(columns / np.abs(columns).max(axis=0))[0]
    free = 1 - np.sum(basis**2, axis=1)
    missed = law.evaluate(p, u[:, None]).tau[:, 0] - data.moment_n_m
    known = free > DETERMINED
    if np.sum(known) < FEWEST_MISSES:
        return None
    box = np.vstack([law.domain.actuation, law.domain.deformation])
    return ErrorBar.of(box, p[known], u[known, None], (missed[known] / free[known])[:, None])


def _columns(p: Array, u: Array, odd: bool) -> Array:
    """(n, 4) what multiplies k_n, m_a, b_a − b_e and m_e."""
    return np.stack([p, p * u, u, -u * (np.abs(u) if odd else u) / 2], axis=1)


def stated_domain(domain: StatedDomain | None) -> Domain:
    """The record of a stated domain; what is not stated is unbounded."""
    everywhere = Domain.unbounded(1)
    if domain is None:
        return everywhere
    deformation = domain.deformation or domain.extension_m
    return Domain(
        everywhere.actuation if domain.actuation is None else np.array(domain.actuation, float),
        everywhere.deformation if deformation is None else np.array([deformation], float),
    )
