"""Fitting polynomial laws: recovery, slopes, choice of degree, scores, messages, published data."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError
from tests.surrogates.laws import states

from pliant.errors import UserError
from pliant.records.fem import FemDataset
from pliant_plugins.surrogates.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial

REFERENCE = Path(__file__).parents[2] / ".." / "shared" / "data" / "reference"


def module(p, u):
    """Return a smooth module that is no polynomial: τ and its slopes."""
    q = p / 15e3
    tau = 0.024 * q * (1 + 0.15 * q) * np.exp(-1.2 * u) - 0.012 * np.sinh(2.5 * u) / (1 + 0.3 * q)
    by_p = (0.024 * (1 + 0.3 * q) * np.exp(-1.2 * u) + 0.0036 * np.sinh(2.5 * u) / (1 + 0.3 * q) ** 2) / 15e3
    by_u = -0.0288 * q * (1 + 0.15 * q) * np.exp(-1.2 * u) - 0.03 * np.cosh(2.5 * u) / (1 + 0.3 * q)
    return tau, by_p, by_u


def grid(n_p: int, n_u: int):
    """Return Chebyshev–Lobatto levels of pressure and angle, and 40 states between them to score."""
    levels = [(1 - np.cos(np.pi * np.arange(n) / (n - 1))) / 2 for n in (n_p, n_u)]
    p, u = (values.ravel() for values in np.meshgrid(15e3 * levels[0], -0.2 + 0.65 * levels[1]))
    rng = np.random.default_rng(1)
    check = np.arange(len(p) + 40) >= len(p)
    return np.append(p, rng.uniform(0, 15e3, 40)), np.append(u, rng.uniform(-0.2, 0.45, 40)), check


def fem_like(n_p: int = 6, n_u: int = 7, slopes: bool = True) -> FemDataset:
    p, u, check = grid(n_p, n_u)
    tau, by_p, by_u = module(p, u)
    return states(p, u, tau, by_p if slopes else None, by_u if slopes else None, check=check)


def fit(data: FemDataset, **config):
    return Polynomial(PolynomialConfig(**config)).fit(data)


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
def test_a_polynomial_is_recovered_and_its_degree_is_found(degree: int) -> None:
    p, u, check = grid(8, 9)
    x, v = p / 15e3, u / 0.45
    rng = np.random.default_rng(degree)
    table = (
        1e-4 * rng.normal(size=(degree + 1, degree + 1)) * (np.add.outer(*[range(degree + 1)] * 2) <= degree)
    )
    table[0, 1], table[0, degree], table[degree, 0] = -0.03, table[0, degree] - 1e-3, table[degree, 0] + 1e-3
    fitted = fit(states(p, u, np.polynomial.polynomial.polyval2d(x, v, table), check=check))
    assert fitted.report.details["degree"] == degree
    assert fitted.report.worst_of_range < 1e-11
    effort = fitted.law.evaluate(p, u[:, None])
    by_v = np.polynomial.polynomial.polyval2d(x, v, np.polynomial.polynomial.polyder(table, axis=1)) / 0.45
    np.testing.assert_allclose(effort.dtau_du[:, 0, 0], by_v, rtol=1e-9)


def test_a_fem_like_data_set_is_fitted_to_a_hundred_thousandth() -> None:
    report = fit(fem_like()).report
    assert report.worst_of_range < 1e-5
    assert report.details["stable"]
    assert report.details["slope_errors"]["dmoment_du"] < 1e-4
    assert (report.n_fitted, report.n_heldout) == (42, 40)


def test_on_few_states_slopes_are_worth_a_factor_ten() -> None:
    with_slopes, values_only = (fit(fem_like(3, 4, slopes)).report.rmse for slopes in (True, False))
    assert with_slopes < values_only / 10


def test_slopes_that_are_missing_in_some_states_are_left_out() -> None:
    data = fem_like()
    by_u = data.dmoment_du.copy()
    by_u[::3] = np.nan
    assert fit(replace(data, dmoment_du=by_u)).report.worst_of_range < 1e-4


def test_noise_is_not_fitted() -> None:
    """At 1 % noise the chosen law is nearer to the truth than the highest degree, and than the noise."""
    data = fem_like(10, 12, slopes=False)
    noise = 0.01 * np.ptp(data.moment_n_m) * np.random.default_rng(0).normal(size=len(data))
    noisy = replace(data, moment_n_m=data.moment_n_m + np.where(data.role == "fit", noise, 0.0))
    report = fit(noisy).report
    assert report.details["terms"] <= 10
    assert report.rmse < 0.6 * noise.std()
    crowded = max(report.details["cross_validation"], key=lambda row: row["terms"])
    chosen = next(row for row in report.details["cross_validation"] if row["chosen"])
    assert chosen["rmse_of_range"] < crowded["rmse_of_range"]


def test_the_cross_validated_error_is_honest_on_a_grid() -> None:
    """With single states left out it is 4e-10 of the range here: rows and columns reveal them."""
    p, u = (values.ravel() for values in np.meshgrid(np.linspace(0, 15e3, 8), np.linspace(-0.2, 0.45, 9)))
    rng = np.random.default_rng(1)
    check = np.arange(len(p) + 40) >= len(p)
    p, u = np.append(p, rng.uniform(0, 15e3, 40)), np.append(u, rng.uniform(-0.2, 0.45, 40))
    report = fit(states(p, u, module(p, u)[0] - 0.004 * np.tanh(12 * u), check=check)).report
    chosen = next(row for row in report.details["cross_validation"] if row["chosen"])
    assert 1 / 3 < chosen["rmse_of_range"] / (report.rmse / report.effort_range) < 3


def coupled(p, u):
    """Return a bench's law: gain and stiffness affect each other, and the module stiffens."""
    return 1.6e-6 * p - 1.7e-6 * p * u - 0.0245 * u - 0.05 * u**2 + 0.03 * u**3


@pytest.mark.parametrize("levels", [2, 3])
def test_few_pressures_are_enough_for_a_law_that_is_linear_in_pressure(levels: int) -> None:
    p, u = np.meshgrid(np.linspace(0, 15e3, levels), np.linspace(-0.1, 0.4, 8), indexing="ij")
    fitted = fit(states(p.ravel(), u.ravel(), coupled(p, u).ravel()))
    assert fitted.report.worst_of_range < 1e-9
    assert fitted.report.details["actuation_degree"] == 1


def test_two_angles_are_enough_for_a_law_that_is_linear_in_angle() -> None:
    p, u = np.meshgrid(np.linspace(0, 15e3, 6), [0.0, 0.3], indexing="ij")
    moment = 1.6e-6 * p - 1.7e-6 * p * u - 0.0245 * u - 2e-12 * p**2
    assert fit(states(p.ravel(), u.ravel(), moment.ravel())).report.worst_of_range < 1e-9


@pytest.mark.parametrize("seed", range(5))
def test_pressures_that_a_bench_meets_nearly_are_still_two_levels(seed: int) -> None:
    """Without data between the levels, no term may bend the law there because of the scatter."""
    random = np.random.default_rng(seed)
    p = np.repeat([0.0, 15e3], 8) + random.normal(size=16) * 50
    u = np.tile(np.linspace(-0.1, 0.4, 8), 2) + random.normal(size=16) * 1e-3
    noise = 1e-4 * random.normal(size=16)
    fitted = fit(states(p, u, coupled(p, u) + noise))
    between = np.linspace(0, 0.3, 7)
    middle = np.full(7, 7.5e3)
    missed = fitted.law.evaluate(middle, between[:, None]).tau[:, 0] - coupled(middle, between)
    assert fitted.report.details["actuation_degree"] == 1
    assert np.abs(missed).max() < 0.03 * np.ptp(coupled(p, u))


def test_data_without_check_states_hold_out_a_fifth() -> None:
    data = fem_like(6, 7).select("fit")
    report = fit(data).report
    assert (report.n_fitted, report.n_heldout) == (34, 8)
    assert "no state has role check in the domain" in report.details["held_out"]
    np.testing.assert_array_equal(fit(data).law.domain.actuation, [0, 15e3])


def with_status(data: FemDataset, states: list[int], status: str) -> FemDataset:
    statuses = data.status.astype("<U16")
    statuses[states] = status
    return replace(data, status=statuses)


def test_states_that_fem_does_not_trust_are_left_out_and_counted() -> None:
    data = with_status(fem_like(), [3, 50], "suspect")
    moment = data.moment_n_m.copy()
    moment[3] += 1.0
    report = fit(replace(data, moment_n_m=moment)).report
    assert report.details["excluded"] == {"suspect": 2}
    assert (report.n_fitted, report.n_heldout) == (41, 39)
    assert report.worst_of_range < 1e-4


def test_check_states_outside_the_fitted_box_are_not_scored() -> None:
    data = fem_like()
    angle = data.angle_rad.copy()
    moved = np.flatnonzero(data.role == "check")[:3]
    angle[moved] += 1.0
    report = fit(replace(data, angle_rad=angle)).report
    assert report.details["excluded"] == {"outside the fitted box": 3}
    assert report.n_heldout == int(np.sum(data.role == "check")) - 3
    assert report.worst_of_range < 1e-4


def test_self_contact_ends_the_domain_and_fills_its_corners() -> None:
    data = fem_like()
    lowest = np.flatnonzero((data.role == "fit") & (data.angle_rad == data.angle_rad.min()))
    middle = np.abs(data.angle_rad - data.angle_rad.mean()) + 1e9 * (data.role != "fit")
    inside = int(np.argmin(middle))
    fitted = fit(with_status(data, [*lowest.tolist(), inside], "self_contact"))
    assert fitted.law.domain.deformation[0, 0] > data.angle_rad.min()
    assert fitted.report.details["in_contact"] == 1
    assert fitted.report.details["excluded"]["self_contact"] == len(lowest)
    assert fitted.report.n_fitted == int(np.sum(data.role == "fit")) - len(lowest)


def test_a_box_with_empty_corners_gets_a_stable_law() -> None:
    """Pressure ramps of a bench have no state at low pressure and large angle, where high degrees oscillate."""
    rng = np.random.default_rng(0)
    p = rng.uniform(0, 15e3, 200)
    u = 0.45 * p / 15e3 * rng.uniform(0.6, 1.0, 200)
    q = p / 15e3
    moment = 0.02 * q * np.exp(-1.2 * u) - 0.006 * np.sinh(3 * u) - 2e-3 * np.tanh(25 * (u - 0.2 * q))
    report = fit(states(p, u, moment + 1e-5 * rng.normal(size=200))).report
    best = min(report.details["cross_validation"], key=lambda row: row["rmse_of_range"])
    assert not best["stable"]
    assert report.details["stable"]
    assert report.worst_of_range < 0.02
    assert 0.1 < report.details["coverage"] < 0.5


def test_snap_through_in_the_data_is_kept_and_reported() -> None:
    p, u, check = grid(6, 9)
    v = (u - 0.125) / 0.2
    report = fit(states(p, u, 0.01 * p / 15e3 + 0.01 * (v - v**3), check=check)).report
    assert report.worst_of_range < 1e-10
    assert not report.details["stable"]
    assert report.details["largest_slope"] == pytest.approx(0.05, rel=1e-3)


# -- messages --------------------------------------------------------------------------------------


def spoiled(**columns) -> FemDataset:
    data = fem_like(slopes=False)
    return replace(data, **{name: np.array(change(getattr(data, name))) for name, change in columns.items()})


def put(index: int, value: float):
    def change(column):
        column = column.copy()
        column[index] = value
        return column

    return change


def spread(column):
    return np.linspace(-0.2, 0.45, len(column))


def contradicting() -> FemDataset:
    return spoiled(
        actuation=lambda p: put(20, p[8])(p),
        angle_rad=lambda u: put(20, u[8])(u),
        moment_n_m=lambda m: put(20, m[8] + 0.01)(m),
    )


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (fem_like(2, 2), "needs at least 6 states to fit besides those that score it, and there are 4"),
        (fem_like(2, 2).select("fit"), "and there are 4"),
        (spoiled(moment_n_m=put(4, np.nan)), "moment_n_m is nan in state 5"),
        (spoiled(actuation=put(0, np.inf)), "pressure_pa is inf in state 1"),
        (contradicting(), "states 9 and 21 contradict each other: at pressure_pa = "),
        (
            spoiled(actuation=lambda p: 0 * p + 5e3, angle_rad=spread),
            "all 42 states have the same pressure_pa .5000.",
        ),
        (
            spoiled(moment_n_m=lambda m: 0 * m),
            "all 42 states have the moment 0 N·m: add states with an external",
        ),
        (
            spoiled(angle_rad=lambda u: 1e-5 * np.arange(len(u)), actuation=lambda p: np.arange(len(p))),
            "on one line",
        ),
        (
            spoiled(status=lambda s: np.full(len(s), "self_contact")),
            "82 with status 'self_contact' are not trusted",
        ),
    ],
    ids=[
        "few",
        "few, no check",
        "nan",
        "inf",
        "contradiction",
        "one pressure",
        "no moments",
        "line",
        "untrusted",
    ],
)
def test_bad_data_get_one_sentence(data: FemDataset, sentence: str) -> None:
    with pytest.raises(UserError, match=sentence):
        fit(data)


def test_the_study_form_says_when_the_states_do_not_determine_it() -> None:
    with pytest.raises(UserError, match="four coefficients and the 34 states determine only"):
        fit(spoiled(actuation=spread, angle_rad=spread), form="study")


# -- config ----------------------------------------------------------------------------------------

LAW = {"k_n": 1.637e-6, "m_a": -1.704e-6, "b_a": 0.0, "m_e": 0.1012, "b_e": 0.0245}


@pytest.mark.parametrize(
    ("config", "names"),
    [
        ({"coefficients": LAW}, "coefficients"),
        ({"odd": True}, "odd"),
        ({"procedure": "finite_differences"}, "procedure"),
        ({"form": "study", "procedure": "finite_differences", "coefficients": LAW}, "procedure"),
        ({"form": "study", "domain": {"actuation": [0, 1]}}, "domain"),
        ({"form": "study", "coefficients": LAW, "data": "a.csv"}, "data"),
        ({"form": "study", "coefficients": LAW, "domain": {"deformation": [0.2, 0.1]}}, "domain.deformation"),
        ({"form": "study", "coefficients": LAW, "domain": {"actuation": ["1 mm", 2]}}, "1 mm"),
        ({"form": "study", "coefficients": {"k_n": 1e-6}}, "coefficients.m_a"),
        ({"axes": {"y": {}}}, "axes.x"),
        ({"axes": {"x": {}, "y": {}, "z": {}, "w": {}}}, "axes.w"),
        ({"axes": {"x": {}, "y": {}, "z": {}}, "data": "y.csv"}, "'data' is given together with 'axes'"),
        ({"axes": {"x": {"coefficients": LAW}, "y": {}, "z": {}}}, "axes.x"),
        ({"joint": "prismatic"}, "prismatic"),
        (
            {"joint": "prismatic", "form": "study", "coefficients": LAW, "domain": {"deformation": [0, 1]}},
            "extension",
        ),
        (
            {"form": "study", "coefficients": LAW, "domain": {"extension": ["0 mm", "5 mm"]}},
            "joint: prismatic",
        ),
        ({"form": "study", "coefficients": LAW, "domain": {"deformation": ["0 mm", "5 mm"]}}, "5 mm"),
    ],
)
def test_contradictory_configs_are_refused_by_the_key_name(config: dict, names: str) -> None:
    with pytest.raises(ValidationError) as caught:
        PolynomialConfig.model_validate(config)
    text = " ".join(f"{'.'.join(map(str, e['loc']))} {e['msg']}" for e in caught.value.errors())
    assert names in text


def test_a_stated_law_has_its_stated_domain_in_any_unit_and_a_fitted_one_is_not_stated() -> None:
    def law(**config):
        return Polynomial(PolynomialConfig(form="study", odd=True, coefficients=LAW, **config)).stated()

    pressed = law(domain={"actuation": ["0 kPa", "15 kPa"], "deformation": ["-10 deg", 0.6]})
    np.testing.assert_allclose(pressed.domain.actuation, [0, 15e3])
    np.testing.assert_allclose(pressed.domain.deformation, [[-np.pi / 18, 0.6]])
    assert pressed.domain.excess(np.array([16e3]), np.array([[0.0]]))[0, 0] == pytest.approx(1e3)
    pulled = law(actuation_name="tendon_force_n", domain={"actuation": ["0 N", "8 N"]})
    assert pulled.actuation_name == "tendon_force_n"
    np.testing.assert_array_equal(pulled.domain.actuation, [0, 8])
    assert not np.isfinite(pulled.domain.deformation).any()
    assert Polynomial(PolynomialConfig()).stated() is None


# -- the published data ----------------------------------------------------------------------------


def published(name: str, forward_only: bool = False, unseen: bool = False) -> FemDataset:
    """Return published states. Unless `unseen`, all are fitted and scored, as for the figures quoted."""
    path = REFERENCE / name
    if not path.exists():
        pytest.skip(f"the study's data are not here: {path.resolve()}")
    table = np.genfromtxt(path, delimiter=",", names=True)
    p, u, moment = table["pressure_pa"], 2 * table["half_angle_rad"], table["moment_n_m"]
    keep = u >= 0 if forward_only else np.isfinite(u)
    p, u, moment = p[keep], u[keep], moment[keep]
    if unseen:
        return states(p, u, moment)
    both = np.repeat([False, True], len(p))
    return states(np.tile(p, 2), np.tile(u, 2), np.tile(moment, 2), check=both)


@pytest.mark.parametrize(
    ("name", "forward_only", "odd", "rms", "worst"),
    [
        ("bellow_bending_fem.csv", True, False, 0.0037, 0.0125),
        ("helical_y_fem_R5.66_l4.72.csv", False, False, 0.0033, 0.0207),
        ("helical_y_fem_R5.66_l4.72.csv", False, True, 0.0225, 0.1174),
    ],
    ids=["bending", "helical", "helical odd"],
)
def test_the_study_form_reaches_the_known_accuracy(name, forward_only, odd, rms, worst) -> None:
    report = fit(published(name, forward_only), form="study", odd=odd).report
    assert report.rmse / report.effort_range == pytest.approx(rms, rel=0.02)
    assert report.worst_of_range == pytest.approx(worst, rel=0.02)


@pytest.mark.parametrize(
    ("name", "worst"), [("bellow_bending_fem.csv", 1e-3), ("helical_y_fem_R5.66_l4.72.csv", 3e-4)]
)
def test_the_adaptive_form_goes_below_half_a_percent_on_states_not_seen(name: str, worst: float) -> None:
    report = fit(published(name, unseen=True)).report
    assert report.worst_of_range < worst
    assert report.details["stable"]
    assert report.worst_of_range < report.details["study_form"]["worst_of_range"] / 5
