"""The study's own coefficients of many designs: what a network is trained to, and the law that they make."""

from __future__ import annotations

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.fem import TRUSTED
from pliant.records.law import Domain, JointKind
from pliant.records.solved import SolvedDesigns
from pliant_plugins.surrogates.polynomial.config import StudyCoefficients
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw
from pliant_plugins.surrogates.polynomial.study_form import fit_study, study_law

# Of a law's stiffness at rest, what must be left in every corner of its box.
MARGIN = 0.02


def study_targets(designs: SolvedDesigns) -> Array:
    """(n, 4) k_n, m_a, b, m_e of each design, by least squares of the efforts (not by differences of energies).

    Raises `UserError` for a joint of several axes and for a design whose states do not determine them.
    """
    first = designs.data[0]
    if len(first.axes) > 1:
        raise UserError(
            f"form 'study' is the law of one axis, and the joint of these designs has {len(first.axes)} "
            f"({', '.join(first.axes)}); use form 'adaptive'."
        )
    found = []
    for data in designs.data:
        table = data.axis(first.main_axis)
        law = fit_study(table.rows(np.isin(table.status, TRUSTED) & (table.role == "fit")), odd=False)
        found.append([law.k_n, law.m_a, law.b_a - law.b_e, law.m_e])
    return np.array(found)


def law_of_targets(
    targets: Array, domain: Domain, actuation_name: str, axis: str, joint: JointKind
) -> PolynomialLaw:
    """The law of coefficients (4,), its stiffness raised where it would not be stable in the box."""
    k_n, m_a, b, m_e = (float(value) for value in targets)
    # ∂τ/∂u = m_a p + b − m_e u is largest in a corner of the box.
    corners = m_a * domain.actuation[:, None] + b - m_e * domain.deformation[0]
    stable = b - max(float(corners.max()) + MARGIN * abs(b), 0.0)
    coefficients = StudyCoefficients(k_n=k_n, m_a=m_a, b_a=0.0, m_e=m_e, b_e=-stable)
    return study_law(coefficients, False, domain, actuation_name, axis, joint)
