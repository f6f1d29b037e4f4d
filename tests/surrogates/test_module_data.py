"""Laws from FEM data of several axes, and of states of bodies that may penetrate each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.surrogates.laws import states

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.fem import PASSED, SELF_CONTACT, FemDataset
from pliant_plugins.surrogates.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial


def data(axis: str, p: Array, u: Array, stiffness: float = 1.0, gain: float = 0.0) -> FemDataset:
    """Return τ = g p − s (1 + 0.3 p) u with its slopes; the last state is left out of the fit."""
    tau = gain * p - stiffness * (1 + 0.3 * p) * u
    check = np.arange(len(p)) == len(p) - 1
    slopes = (gain - 0.3 * stiffness * u, -stiffness * (1 + 0.3 * p))
    return states(p, u, tau, *slopes, check=check, axis=axis, energy_j=np.zeros(len(p)))


CROSS = np.array([0.0, 0.0, 1.0, 1.0, 0.5, 0.5, 0.5, 0.0, 1.0, 0.5, 0.5, 0.9])
ANGLE = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, 0.0, 0.0, 0.0, -0.5, 0.5, 0.9])


def test_corners_that_are_never_left_out_count() -> None:
    """Three levels each way and a product p·u: the folds, inner levels, do not contain it."""
    fitted = Polynomial(PolynomialConfig()).fit(data("z", CROSS, ANGLE))
    assert fitted.report.worst_of_range < 1e-6


def test_a_spherical_modules_axes_are_fitted_alike() -> None:
    stiffness = {"x": 2.0, "y": 1.0, "z": 3.0}
    of_axes = {a: data(a, CROSS, ANGLE, s, gain=0.5 * (a == "y")) for a, s in stiffness.items()}
    law = Polynomial(PolynomialConfig()).fit_axes(of_axes).law
    assert law.joint == "spherical" and law.axes == ("x", "y", "z")
    effort = law.evaluate(np.array([1.0]), np.array([[0.1, 0.2, 0.3]]))
    assert effort.tau[0] == pytest.approx([-0.26, 0.5 - 0.26, -1.17], rel=1e-6)


def test_a_missing_axis_is_named() -> None:
    with pytest.raises(UserError, match="no states of axis z: the data have x, y"):
        Polynomial(PolynomialConfig()).fit_axes({a: data(a, CROSS, ANGLE) for a in "xy"})


def test_states_that_pass_are_trusted_and_states_in_contact_end_the_domain() -> None:
    whole = data("y", CROSS, ANGLE, gain=0.5)
    outer = np.abs(ANGLE) > 0.6
    touching = replace(whole, status=np.where(outer, SELF_CONTACT, "ok"))
    with pytest.raises(UserError, match=r"self_contact: pass"):
        Polynomial(PolynomialConfig()).fit(touching)
    passing = replace(whole, status=np.where(outer, PASSED, "ok"))
    law = Polynomial(PolynomialConfig()).fit(passing).law
    assert law.domain.deformation[0].tolist() == [-1.0, 1.0]
