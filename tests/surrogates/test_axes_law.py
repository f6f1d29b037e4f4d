"""Laws of spherical and prismatic joints: three polynomial axes in one, stated and fitted; wrong studies."""

from __future__ import annotations

import numpy as np
import pytest
from tests.surrogates.laws import MAIN, SIDE, TWIST, WAVY, points, spatial, stated, surrogate, with_a_box

from pliant.errors import UserError
from pliant.records.fem import FemDataset
from pliant.records.law import Domain, JointLaw
from pliant.testing.samples import sample_table, softening_law
from pliant_plugins.surrogates.polynomial.axes import AxesLaw
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw


def test_each_axis_has_its_own_effort() -> None:
    law = spatial()
    assert (law.joint, law.axes, law.actuation_name) == ("spherical", ("x", "y", "z"), "pressure_pa")
    p, u = np.array([8e3, 12e3]), np.array([[0.1, 0.2, -0.3], [-0.2, 0.4, 0.05]])
    effort = law.evaluate(p, u)
    for k, c in enumerate((TWIST, MAIN, SIDE)):
        v = u[:, k]
        wanted = c["k_n"] * p + c["m_a"] * p * v - (c["m_e"] * v * np.abs(v) / 2 + c["b_e"] * v)
        np.testing.assert_allclose(effort.tau[:, k], wanted, rtol=1e-12)
        np.testing.assert_allclose(
            effort.dtau_du[:, k, k], c["m_a"] * p - c["m_e"] * np.abs(v) - c["b_e"], rtol=1e-12
        )
    off = effort.dtau_du[:, ~np.eye(3, dtype=bool)]
    np.testing.assert_array_equal(off, 0.0)


def test_the_potential_is_the_general_quadrature() -> None:
    law = with_a_box()
    p, u = points(law, 0.0)
    inside = np.abs(u).max(axis=1) < 0.2  # the quadrature meets a corner of |u| at its end only
    quadrature = JointLaw.potential(law, p, u)
    np.testing.assert_allclose(law.potential(p, u)[inside], quadrature[inside], rtol=1e-9, atol=1e-14)


def test_the_domain_is_what_the_axes_share() -> None:
    box = {"actuation": ["5 kPa", "20 kPa"], "deformation": ["-10 deg", "10 deg"]}
    axes = {
        "x": stated(TWIST),
        "y": stated(MAIN, domain={"actuation": [0, 15e3]}),
        "z": stated(SIDE, domain=box),
    }
    law = surrogate(axes=axes).stated()
    assert isinstance(law, AxesLaw)
    np.testing.assert_array_equal(law.domain.actuation, [5e3, 15e3])
    np.testing.assert_allclose(law.domain.deformation[2], np.radians([-10, 10]))
    assert np.isinf(law.domain.deformation[:2]).all()
    excess = law.domain.excess(np.array([16e3]), np.array([[0.0, 2.0, 0.2]]))
    np.testing.assert_allclose(excess, [[1e3, 0.0, 0.0, 0.2 - np.radians(10)]])


def table() -> FemDataset:
    return sample_table(softening_law(), noise_n_m=2e-5)


def test_an_axis_is_fitted_beside_stated_ones() -> None:
    made = surrogate(axes={"x": stated(TWIST), "y": {}, "z": stated(SIDE)})
    assert made.stated() is None and made.needs_fem() and not made.tables()
    fitted = made.fit_axes({"": table()})
    alone = surrogate().fit(table())
    assert isinstance(fitted.law, AxesLaw)
    p, u = np.full(5, 9e3), np.linspace(-0.1, 0.3, 5)
    np.testing.assert_array_equal(
        fitted.law.evaluate(p, np.stack([0 * u, u, 0 * u], 1)).tau[:, 1],
        alone.law.evaluate(p, u[:, None]).tau[:, 0],
    )
    for name in ("n_fitted", "n_heldout", "worst", "worst_of_range", "r2"):
        assert getattr(fitted.report, name) == getattr(alone.report, name)
    assert fitted.report.rmse == pytest.approx(alone.report.rmse)
    assert fitted.report.details["stated_axes"] == ["x", "z"]
    assert fitted.report.details["axes"]["y"]["degree"] == alone.report.details["degree"]


def test_two_fitted_axes_report_the_worst_in_both() -> None:
    made = surrogate(
        axes={"x": stated(TWIST), "y": {"data": "y.csv"}, "z": {"data": "z.csv", "max_degree": 1}}
    )
    assert set(made.tables()) == {"y", "z"} and not made.needs_fem()
    report = made.fit_axes({"y": table(), "z": table()}).report
    of_y, of_z = report.details["axes"]["y"], report.details["axes"]["z"]
    assert of_z["rmse"] > of_y["rmse"]
    assert report.worst == of_z["worst"] and report.r2 == of_z["r2"]
    assert report.n_heldout == of_y["n_heldout"] + of_z["n_heldout"]
    assert of_y["rmse"] < report.rmse < of_z["rmse"]


def test_fem_states_on_another_axis_are_not_taken() -> None:
    made = surrogate(axes={"x": stated(TWIST), "y": stated(MAIN), "z": {}})
    with pytest.raises(UserError, match="axis z: the FEM stage solves axis y only"):
        made.fit_axes({"": table()})


def test_a_prismatic_law_is_stated_in_newtons_and_metres() -> None:
    coefficients = {"k_n": 1e-4, "m_a": 0.0, "m_e": 1e4, "b_e": 200.0}
    made = surrogate(
        joint="prismatic",
        **stated(coefficients, domain={"extension": ["-2 mm", "5 mm"], "actuation": [0, 2e4]}),
    )
    law = made.stated()
    assert isinstance(law, PolynomialLaw)
    assert (law.joint, law.axes) == ("prismatic", ("x",))
    np.testing.assert_allclose(law.domain.deformation, [[-0.002, 0.005]])
    tau = law.evaluate(np.array([1e4]), np.array([[0.003]])).tau
    assert tau[0, 0] == pytest.approx(1.0 - (1e4 * 0.003**2 / 2 + 0.6))
    again = made.load(law.record())
    assert (again.joint, again.axes) == ("prismatic", ("x",))


def test_unequal_inputs_and_separate_pressures_are_refused() -> None:
    axes = {"x": stated(TWIST), "y": stated(MAIN, actuation_name="tendon_force_n"), "z": stated(SIDE)}
    with pytest.raises(UserError, match="pressure_pa and tendon_force_n"):
        surrogate(axes=axes).stated()
    x, y, z = spatial().laws
    low, high = (
        PolynomialLaw(law.coefficients, law.actuation_map, law.deformation_map, domain)
        for law, domain in ((y, Domain(np.array([0.0, 1e3]), y.domain.deformation)), (z, WAVY.domain))
    )
    shifted = PolynomialLaw(
        high.coefficients,
        high.actuation_map,
        high.deformation_map,
        Domain(np.array([2e3, 3e3]), z.domain.deformation),
    )
    with pytest.raises(
        UserError, match="no pressure_pa in common: x -inf to inf, y 0 to 1000, z 2000 to 3000"
    ):
        AxesLaw((x, low, shifted))
