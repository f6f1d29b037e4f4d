"""Uncertainty against closed forms, the coverage of intervals, and the calls that a fit makes to the engine."""

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.diagnosis.formula import candidate, fitter, measured, parameter

from pliant.diagnosis.noise import noise_view
from pliant.diagnosis.uncertainty import Estimate, rounded, uncertainty
from pliant.formatting import rounded_to_sd
from pliant.measurements.repeats import repeat_groups

CLOCK = np.arange(0.0, 20.0, 0.5)
N = CLOCK.size


def line(t, a, b):
    return a + b * t


def relaxing(t, a, b):
    return a * (1.0 - np.exp(-t / b))


def line_data(seed=0, a=1.5, b=-0.2, sigma=0.3):
    noise = np.random.default_rng(seed).normal(0, sigma, N)
    return measured([line(CLOCK, a, b) + noise], [CLOCK])


def two(**more):
    return candidate(parameter("a"), parameter("b", **more))


def relaxation():
    return candidate(
        parameter("a", bounds=(0.0, 20.0), plausible=(0.2, 3.0)),
        parameter("b", 5.0, (0.2, 500.0), (1.0, 40.0), role="shape", prior="log_normal"),
    )


def unsure(function, data, of, scale=1.0):
    work = fitter(function, data, scale)
    return uncertainty(work, work.fit(of), n_effective=N)


@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_a_line_has_the_textbook_covariance_and_profile(scale):
    data = line_data()
    found = unsure(line, data, two(), scale)
    design = np.stack([np.ones_like(CLOCK), CLOCK], axis=1)
    best, residual, *_ = np.linalg.lstsq(design, data.runs[0].outputs["angle_rad"], rcond=None)
    covariance = residual[0] / (N - 2) * np.linalg.inv(design.T @ design)
    sd = np.sqrt(np.diag(covariance))
    assert [e.value for e in found.estimates] == pytest.approx(best, rel=1e-4)
    assert [e.sd for e in found.estimates] == pytest.approx(sd, rel=1e-4)
    assert found.correlation[0, 1] == pytest.approx(covariance[0, 1] / sd[0] / sd[1], rel=1e-4)
    for e in found.estimates:
        assert [e.value - e.low, e.high - e.value] == pytest.approx([1.6449 * e.sd] * 2, rel=0.03)
        assert not (e.open_low or e.open_high or e.at_limit)


def test_a_quarter_as_many_readings_double_the_uncertainty():
    work = fitter(line, line_data())
    fit = work.fit(two())
    many, few = (uncertainty(work, fit, n, profiles=False).estimate("formula.a").sd for n in (42, 12))
    assert few / many == pytest.approx(2.0, rel=1e-6)  # √((42 − 2) / (12 − 2))


def test_a_parameter_that_nothing_depends_on_is_open_and_infinitely_unsure():
    found = unsure(lambda t, a, b: a + 0.0 * b * t, line_data(b=0.0), two(role="shape"))
    blind = found.estimate("formula.b")
    assert np.isinf(blind.sd) and blind.open_low and blind.open_high
    assert (blind.low, blind.high) == (-100.0, 100.0)
    assert np.isfinite(found.estimate("formula.a").sd)


def test_two_parameters_that_do_the_same_are_unsure_up_to_their_bounds():
    for e in unsure(lambda t, a, b: (a + b) * t, line_data(a=0.0, b=0.5), two()).estimates:
        assert np.isinf(e.sd) and e.open_high and e.high == 100.0
        assert e.low == pytest.approx(0.5 - 100.0, abs=2.0)  # where the other one meets its own bound


def test_a_strength_at_its_bound_is_open_there_and_holds_neutral():
    of = candidate(parameter("a", bounds=(0.0, 5.0), plausible=(0.1, 1.0)))
    found = unsure(lambda t, a, b: a + 0 * t, line_data(a=-0.05, b=0.0, sigma=0.2), of)
    estimate = found.estimate("formula.a")
    assert estimate.at_limit and estimate.open_low and not estimate.open_high
    assert estimate.low == 0.0 < estimate.high < 0.2
    assert estimate.includes_neutral and found.absent("formula")


def test_a_bent_profile_is_not_symmetric():
    rng = np.random.default_rng(3)
    data = measured([1.0 - np.exp(-CLOCK / 30.0) + rng.normal(0, 0.05, N)], [CLOCK])
    found = unsure(relaxing, data, relaxation()).estimate("formula.b")
    assert found.high - found.value > 1.3 * (found.value - found.low)
    assert found.low < 30.0 < found.high


def test_values_outside_the_plausible_range_are_doubted():
    stiff = parameter("e", 1150.0, (0.0, 1e4), (1000.0, 1300.0))
    one = Estimate("m.e", stiff, 6471.0, 20.0, 6440, 6500, False, False, False)
    assert not one.plausible and len(one.doubts) == 1


SHAPE = parameter(
    "q",
    0.15,
    (0.01, 1.0),
    (0.05, 0.5),
    role="shape",
    prior="log_normal",
    simpler=((0.01, "one volume is enough"), (1.0, "both are as slow")),
)


@pytest.mark.parametrize(
    ("value", "ends", "opened", "at_limit", "says"),
    [
        (0.01, (0.01, 0.05), (True, False), True, "one volume is enough"),
        (0.02, (0.01, 0.05), (True, False), False, "one volume is enough"),
        (1.0, (0.6, 1.0), (False, True), True, "both are as slow"),
        (0.02, (0.015, 0.03), (False, False), False, ""),  # needed, and implausible
        (0.2, (0.01, 1.0), (True, True), False, ""),  # without effect on the readings
        (0.01, (0.01, 1.0), (True, True), True, "one volume is enough"),
    ],
)
def test_a_shape_whose_simpler_form_is_enough_says_so_and_is_no_alarm(value, ends, opened, at_limit, says):
    one = Estimate("lag.q", SHAPE, value, 0.001, *ends, *opened, at_limit)
    assert one.simpler == says
    assert bool(one.doubts) is (not says and not one.plausible)
    assert says in one.words and one.remarks[-1:] == ((says,) if says else one.doubts)


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
def test_values_stop_at_the_second_digit_in_their_uncertainty(value, sd, text, rounded_value):
    assert rounded(value, sd) == rounded_value
    assert rounded_to_sd(value, sd) == text


def test_intervals_hold_the_truth_nine_times_in_ten():
    """Coloured noise, repeats, a linear and a nonlinear parameter: 80 sets, 160 intervals."""
    a, b, held, sets = 1.0, 4.0, 0, 80
    clocks = [np.arange(0.0, 40.0, 0.4)] * 6
    for seed in range(sets):
        rng = np.random.default_rng(seed)
        noise = [lfilter([1.0], [1.0, -0.7], rng.normal(0, 0.15, 300))[-100:] for _ in clocks]
        readings = [relaxing(t, a, b) + e for t, e in zip(clocks, noise, strict=True)]
        data = measured(readings, clocks, (1, 1, 2, 2, 3, 3))
        work = fitter(relaxing, data, 0.2)
        fit = work.fit(relaxation())
        residuals = work.readings.unpack(fit.residual)
        n = noise_view(data, residuals, work.readings.scales, repeat_groups(data)).n_effective
        found = uncertainty(work, fit, n)
        held += sum(one.low <= truth <= one.high for one, truth in zip(found.estimates, (a, b), strict=True))
    assert 0.80 <= held / (2 * sets) <= 0.97


# -- calls to the engine: no point twice, no slope of a fixed parameter, no idle step --

T = np.linspace(0.0, 3.0, 40)


def bent(t, a, b):
    return a * np.exp(0.3 * b * t)


def made(function):
    noise = 0.05 * np.random.default_rng(4).normal(size=(3, len(T)))
    return fitter(function, measured([function(T, 1.0, 0.5) + row for row in noise], [T] * 3), 0.05)


@pytest.fixture
def counted(monkeypatch):
    """Return a fitter of a line, and the number of changes that its engine computed at each call."""
    found, asked = made(line), []
    vary = found.predictor.vary

    def counting(configs, towards):
        asked.append(len(towards))
        return vary(configs, towards)

    monkeypatch.setattr(found.predictor, "vary", counting)
    return found, asked


def test_a_point_that_was_looked_at_is_not_asked_for_again(counted):
    found, asked = counted
    x = two().starts()[0]
    looked = found.evaluate(two(), x)
    again = found.evaluate(two(), x.copy())
    assert asked == [2]
    np.testing.assert_array_equal(looked.slopes, again.slopes)
    fit = found.fit(two())
    np.testing.assert_array_equal(fit.x, made(line).fit(two()).x)
    # A line is solved in damped steps; the last one, which removes the remaining damping, needs no engine.
    assert fit.converged and len(asked) <= 1 + 2


@pytest.mark.parametrize(("of", "slopes"), [(two(), 1), (candidate(parameter("a")), 0)])
def test_slopes_by_a_held_parameter_are_not_requested(counted, of, slopes):
    found, asked = counted
    fit = found.fit(of)
    asked.clear()
    uncertainty(found, fit, 100.0)
    assert asked and set(asked) == {slopes}
    assert slopes or len(asked) == 2  # alone it takes one call for each height of its profile


def test_a_bent_valley_is_followed_to_both_ends_along_its_profile():
    found = made(bent)
    fit = found.fit(two())
    best, scale = found.weights @ fit.residual**2, fit.mean_square() * len(fit.residual) / 98.0
    for k, one in enumerate(uncertainty(found, fit, 100.0).estimates):
        for end in (one.low, one.high):
            held, other = fit.candidate.parameters[k], fit.candidate.parameters[1 - k]
            costs = []
            for x in np.linspace(-0.02, 0.02, 2001) + fit.x[1 - k]:
                a, b = (held.value(held.x(end)), other.value(x))[:: -1 if k else 1]
                costs.append(np.sum((found.readings.values - np.tile(bent(T, a, b), 3) / 0.05) ** 2))
            assert np.sqrt((min(costs) - best) / scale) == pytest.approx(1.6449, rel=0.03)
