"""The polynomial law as a plain function: the same numbers as `evaluate`, in and around the box, compiled or not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pliant.records.law import Domain, Effort, JointLaw
from pliant_plugins.surrogates.polynomial.config import StudyCoefficients
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw
from pliant_plugins.surrogates.polynomial.study_form import study_law

BOX = Domain(np.array([0.0, 15e3]), np.array([[-0.2, 0.45]]))
STATED = StudyCoefficients(k_n=1.637e-6, m_a=-1.704e-6, b_a=0.0, m_e=0.1012, b_e=0.0245)
TABLE = 1e-3 * np.array(
    [[12.0, -20.0, 1.0, -2.0], [11.0, 2.5, -1.5, 0.8], [1.0, -1.2, 0.7, 0.0], [0.2, 0.5, 0.0, 0.0]]
)
WAVY = PolynomialLaw(TABLE, np.array([7.5e3, 7.5e3]), np.array([0.125, 0.325]), BOX, odd=-0.02)
LAWS = {
    "wavy": WAVY,
    "even": replace(WAVY, odd=0.0),
    "unstable": replace(WAVY, coefficients=-TABLE),
    "unbounded": study_law(STATED, True, Domain.unbounded(1)),
    "plain square": study_law(STATED, False, BOX),
    "bounded pressure": study_law(STATED, True, Domain(BOX.actuation, Domain.unbounded(1).deformation)),
}


def states(law: JointLaw) -> tuple[np.ndarray, np.ndarray]:
    """All corners and edges of the box, points just beside them, and random ones in and far outside."""
    p = np.array([0.0, 15e3, -1e-9, 15e3 * (1 + 1e-12), 7.5e3, -3e3, 40e3])
    u = np.array([-0.2, 0.45, -0.2 - 1e-12, 0.45 + 1e-12, 0.0, -0.7, 3.0])
    rng = np.random.default_rng(1)
    grid = np.stack(np.meshgrid(p, u), -1).reshape(-1, 2)
    some = rng.uniform([-10e3, -0.6], [30e3, 0.9], (200, 2))
    both = np.concatenate([grid, some])
    return both[:, 0], np.repeat(both[:, 1:], len(law.axes), axis=1)


def one_by_one(law: JointLaw, p: np.ndarray, u: np.ndarray) -> Effort:
    """`evaluate` through the plain function; what it is to fill starts as rubbish."""
    scalar = law.scalar()
    assert scalar is not None
    n, a = u.shape
    tau, gain, slope = np.full((n, a), 7.0), np.full((n, a), 7.0), np.full((n, a, a), 7.0)
    for i in range(n):
        scalar.function(float(p[i]), u[i], scalar.parameters, tau[i], gain[i], slope[i])
    return Effort(tau, gain, slope)


def require_same(found: Effort, wanted: Effort) -> None:
    for name in ("tau", "dtau_dp", "dtau_du"):
        values = getattr(wanted, name)
        np.testing.assert_allclose(
            getattr(found, name), values, rtol=1e-13, atol=1e-14 * np.abs(values).max(), err_msg=name
        )


@pytest.mark.parametrize("name", LAWS)
def test_the_plain_function_is_the_law(name: str) -> None:
    p, u = states(LAWS[name])
    require_same(one_by_one(LAWS[name], p, u), LAWS[name].evaluate(p, u))


@pytest.mark.parametrize("name", LAWS)
def test_parameters_are_finite_and_the_function_is_shared(name: str) -> None:
    scalar = LAWS[name].scalar()
    assert np.isfinite(scalar.parameters).all()
    assert scalar.function is WAVY.scalar().function


def test_compiled_it_gives_the_same_numbers() -> None:
    numba = pytest.importorskip("numba")
    scalar = WAVY.scalar()
    compiled = numba.njit(scalar.function)
    p, u = states(WAVY)
    tau, gain, slope = np.empty((len(p), 1)), np.empty((len(p), 1)), np.empty((len(p), 1, 1))
    for i in range(len(p)):
        compiled(p[i], u[i], scalar.parameters, tau[i], gain[i], slope[i])
    require_same(Effort(tau, gain, slope), WAVY.evaluate(p, u))
