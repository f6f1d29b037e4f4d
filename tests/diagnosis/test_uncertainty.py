"""Uncertainty against closed forms, and how often intervals hold the truth."""

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.diagnosis.formula import candidate, fitter, measured, parameter

from pliant.diagnosis.noise import noise_view
from pliant.diagnosis.uncertainty import Estimate, rounded, uncertainty
from pliant.formatting import rounded_to_sd
from pliant.measurements.repeats import repeat_groups

CLOCK = np.arange(0.0, 20.0, 0.5)


def line(t, a, b):
    return a + b * t


def line_data(seed=0, a=1.5, b=-0.2, sigma=0.3):
    rng = np.random.default_rng(seed)
    return measured([line(CLOCK, a, b) + rng.normal(0, sigma, CLOCK.size)], [CLOCK])


@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_a_line_has_the_textbook_covariance(scale):
    data = line_data()
    work = fitter(line, data, scale)
    fit = work.fit(candidate(parameter("a"), parameter("b")))
    found = uncertainty(work, fit, n_effective=CLOCK.size)
    design = np.stack([np.ones_like(CLOCK), CLOCK], axis=1)
    best, residual, *_ = np.linalg.lstsq(design, data.runs[0].outputs["angle_rad"], rcond=None)
    covariance = residual[0] / (CLOCK.size - 2) * np.linalg.inv(design.T @ design)
    sd = np.sqrt(np.diag(covariance))
    assert [e.value for e in found.estimates] == pytest.approx(best, rel=1e-4)
    assert [e.sd for e in found.estimates] == pytest.approx(sd, rel=1e-4)
    assert found.correlation[0, 1] == pytest.approx(covariance[0, 1] / sd[0] / sd[1], rel=1e-4)


def test_the_profile_of_a_linear_model_is_1_645_standard_deviations():
    work = fitter(line, line_data())
    fit = work.fit(candidate(parameter("a"), parameter("b")))
    for e in uncertainty(work, fit, n_effective=CLOCK.size).estimates:
        assert e.value - e.low == pytest.approx(1.6449 * e.sd, rel=0.03)
        assert e.high - e.value == pytest.approx(1.6449 * e.sd, rel=0.03)
        assert not (e.open_low or e.open_high or e.at_limit)


def test_a_quarter_of_the_readings_doubles_the_uncertainty():
    work = fitter(line, line_data())
    fit = work.fit(candidate(parameter("a"), parameter("b")))
    many, few = (uncertainty(work, fit, n, profiles=False).of("formula.a").sd for n in (42, 12))
    assert few / many == pytest.approx(2.0, rel=1e-6)  # √((42 − 2) / (12 − 2))


def test_a_parameter_that_nothing_depends_on_is_open_and_infinitely_unsure():
    work = fitter(lambda t, a, b: a + 0.0 * b * t, line_data(b=0.0))
    fit = work.fit(candidate(parameter("a"), parameter("b", role="shape")))
    found = uncertainty(work, fit, n_effective=CLOCK.size)
    blind = found.of("formula.b")
    assert np.isinf(blind.sd)
    assert blind.open_low and blind.open_high
    assert (blind.low, blind.high) == (-100.0, 100.0)
    assert np.isfinite(found.of("formula.a").sd)


def test_two_parameters_that_do_the_same_are_unsure_up_to_their_bounds():
    work = fitter(lambda t, a, b: (a + b) * t, line_data(a=0.0, b=0.5))
    fit = work.fit(candidate(parameter("a"), parameter("b")))
    for e in uncertainty(work, fit, n_effective=CLOCK.size).estimates:
        assert np.isinf(e.sd)
        assert e.open_high and e.high == 100.0
        assert e.low == pytest.approx(0.5 - 100.0, abs=2.0)  # where the other one meets its own bound


def test_a_strength_at_its_bound_is_open_there_and_holds_neutral():
    data = line_data(a=-0.05, b=0.0, sigma=0.2)
    work = fitter(lambda t, a, b: a + 0 * t, data)
    fit = work.fit(candidate(parameter("a", bounds=(0.0, 5.0), plausible=(0.1, 1.0))))
    found = uncertainty(work, fit, n_effective=CLOCK.size)
    estimate = found.of("formula.a")
    assert estimate.at_limit and estimate.open_low and not estimate.open_high
    assert estimate.low == 0.0
    assert 0.0 < estimate.high < 0.2
    assert estimate.includes_neutral and found.absent("formula")
    assert "no effect" in estimate.words


def test_a_bent_profile_is_not_symmetric():
    rng = np.random.default_rng(3)
    data = measured([1.0 - np.exp(-CLOCK / 30.0) + rng.normal(0, 0.05, CLOCK.size)], [CLOCK])
    work = fitter(relaxing, data)
    found = uncertainty(work, work.fit(relaxation()), n_effective=CLOCK.size).of("formula.b")
    assert found.high - found.value > 1.3 * (found.value - found.low)
    assert found.low < 30.0 < found.high


def test_values_outside_the_plausible_range_are_named():
    one = Estimate(
        "m.e",
        parameter("e", 1150.0, (0.0, 1e4), (1000.0, 1300.0)),
        6471.0,
        20.0,
        6440,
        6500,
        False,
        False,
        False,
    )
    assert not one.plausible
    assert any(doubt.startswith("implausible") for doubt in one.doubts)


@pytest.mark.parametrize(
    ("value", "sd", "text", "rounded_value"),
    [
        (0.21234, 0.0123, "0.212", 0.212),
        (6471.3, 123.0, "6470", 6470.0),
        (-1.0, 0.5, "−1.00", -1.0),
        (0.5, np.inf, "0.5000", 0.5),
        (0.0, np.inf, "0", 0.0),
    ],
)
def test_values_stop_at_the_second_digit_of_their_uncertainty(value, sd, text, rounded_value):
    assert rounded(value, sd) == rounded_value
    assert rounded_to_sd(value, sd) == text


def relaxing(t, a, b):
    return a * (1.0 - np.exp(-t / b))


def relaxation():
    return candidate(
        parameter("a", bounds=(0.0, 20.0), plausible=(0.2, 3.0)),
        parameter("b", 5.0, (0.2, 500.0), (1.0, 40.0), role="shape", prior="log_normal"),
    )


def test_intervals_hold_the_truth_nine_times_in_ten():
    """Coloured noise, repeats, a linear and a bent parameter: 120 sets, 240 intervals."""
    a, b, held = 1.0, 4.0, 0
    clocks = [np.arange(0.0, 40.0, 0.4)] * 6
    for seed in range(120):
        rng = np.random.default_rng(seed)
        noise = [lfilter([1.0], [1.0, -0.7], rng.normal(0, 0.15, 300))[-100:] for _ in clocks]
        data = measured(
            [relaxing(t, a, b) + e for t, e in zip(clocks, noise, strict=True)], clocks, (1, 1, 2, 2, 3, 3)
        )
        work = fitter(relaxing, data, 0.2)
        fit = work.fit(relaxation())
        groups = repeat_groups(data)
        n = noise_view(data, work.readings.unpack(fit.residual), work.readings.scales, groups).n_effective
        found = uncertainty(work, fit, n)
        held += found.of("formula.a").low <= a <= found.of("formula.a").high
        held += found.of("formula.b").low <= b <= found.of("formula.b").high
    assert 0.80 <= held / 240 <= 0.97
