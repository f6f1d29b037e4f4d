"""`learned`: values at knots, zero outside their range, the compiled result equal to sums, and refused configs."""

import numpy as np
import pytest
from pydantic import ValidationError
from tests.diagnosis.quick import P, blank, effect, joint, make_predictor, ramp

from pliant.mechanics.learned_curve import (
    MARGIN,
    CurveAxis,
    Signals,
    basis,
    learned_value,
    numbers,
    series,
)

ANGLE = {"name": "angle", "low": -0.1, "high": 0.5}
PUSHED = {"name": "actuation", "low": 0.0, "high": 0.5 * P}
BUMP = [0.0, 300.0, 600.0, 300.0, 0.0]


def test_a_curve_meets_its_values_and_a_straight_line_stays_straight():
    axis = CurveAxis("angle", -1.0, 3.0, 6)
    rng = np.random.default_rng(0)
    values = rng.normal(size=6)
    np.testing.assert_allclose(basis([axis], [axis.at]) @ values, values, atol=1e-14)
    x = np.linspace(-1.0, 3.0, 40)
    np.testing.assert_allclose(basis([axis], [x]) @ (2.0 + 0.5 * axis.at), 2.0 + 0.5 * x, atol=1e-14)


def test_a_curve_dies_out_smoothly_and_is_bounded_by_its_values():
    axis = CurveAxis("angle", 0.0, 1.0, 8)
    values = np.random.default_rng(1).normal(size=8)
    x = np.linspace(-0.5, 1.5, 2001)
    f = basis([axis], [x]) @ values
    assert np.all(f[(x < -MARGIN) | (x > 1.0 + MARGIN)] == 0.0)
    assert np.abs(np.diff(f)).max() < 0.05  # no jump where the data end
    assert np.abs(f).max() <= 1.25 * np.abs(values).max()


@pytest.mark.parametrize("second", [None, "angle_direction", "actuation_change"])
def test_compiled_code_and_sums_over_values_are_the_same(second):
    axes = [CurveAxis("angle", -0.1, 0.5, 7)]
    axes += [CurveAxis(second, -0.8, 0.9, 4, 0.05 if "angle" in second else 3.0)] if second else []
    values = np.random.default_rng(2).normal(size=tuple(axis.knots for axis in axes))
    rng = np.random.default_rng(3)
    run = Signals(rng.uniform(-0.2, 0.6, 60), rng.uniform(0, 1.0, 60), np.full(60, 22.0), 0.3 * np.arange(60))
    by_sums = basis(axes, [series(axis, run) for axis in axes]) @ values.ravel()
    c, old, found = np.array(numbers(axes, values, False)), np.zeros(2), []
    for k, angle in enumerate(run.angle):
        new, dt = np.zeros(2), 0.3 if k else np.inf
        found.append(learned_value(angle, 0.0, dt, run.actuation[k], 22.0, old, new, c))
        old = new
    np.testing.assert_allclose(found, by_sums, atol=1e-12)


def test_a_factor_never_turns_round():
    axes = [CurveAxis("angle", 0.0, 1.0, 2)]
    c = np.array(numbers(axes, np.array([-5.0, -5.0]), True))
    none = np.zeros(0)
    assert learned_value(0.5, 0.0, np.inf, 0.0, 22.0, none, none, c) == pytest.approx(0.05)
    assert learned_value(2.0, 0.0, np.inf, 0.0, 22.0, none, none, c) == 1.0


@pytest.mark.parametrize(
    "name, inside",
    [
        ("angle_direction", [0.0, 1.0, 1.0, 0.5, -1.0, -1.0]),
        ("largest_angle", [0.0, 0.2, 0.4, 0.4, 0.4, 0.4]),
    ],
)
def test_what_a_joint_remembers(name, inside):
    run = Signals(np.array([0.0, 0.2, 0.4, 0.35, 0.1, 0.0]), np.zeros(6), np.zeros(6), np.arange(6.0))
    np.testing.assert_allclose(series(CurveAxis(name, -1, 1, 2, 0.1), run), inside)


def test_a_recent_change_fades_with_its_time_and_travel_goes_on():
    level = np.array([0.0, 1.0, 1.0, 1.0])
    run = Signals(np.zeros(4), level, np.zeros(4), np.array([0.0, 1e-9, 2.0, 4.0]))
    change = series(CurveAxis("actuation_change", -1, 1, 2, 2.0), run)
    np.testing.assert_allclose(change, [0.0, 1.0, np.exp(-1), np.exp(-2)], atol=1e-8)
    axis, memory = CurveAxis("travel", 0, 1, 2, 1.0), np.zeros(2)
    assert series(axis, run, memory)[-1] == 0.5
    assert series(axis, run, memory)[-1] == 1.5  # down to the start of the next run, and up again


@pytest.mark.parametrize(
    "acts_on, over, value",
    [
        ("input", PUSHED, BUMP),
        ("reading", {**ANGLE, "low": -0.05, "high": 0.15}, [0.0, 0.01, 0.0]),
        ("moment", {**ANGLE, "low": -0.05, "high": 0.15}, [0.0, 4e-4, 0.0]),
        ("elastic", {**ANGLE, "low": -0.05, "high": 0.15}, [0.0, 0.1, 0.0]),
        ("actuation", PUSHED, [0.0, 0.1, 0.0]),
    ],
)
def test_it_acts_inside_its_range_and_nowhere_else(acts_on, over, value):
    chain = joint()
    learned = effect("learned", acts_on=acts_on, covariates=[over], value=value)
    runs = [ramp("up", 500.0, 0.5, (P,))]
    model = make_predictor(chain, blank(runs))
    (plain,), (changed,) = model.predict(), model.predict((learned,))
    apart = np.abs(changed["angle_rad"] - plain["angle_rad"])
    high = over["high"] + MARGIN * (over["high"] - over["low"])
    x = runs[0].actuation["pressure_pa"] if over is PUSHED else plain["angle_rad"]
    assert apart[x <= over["high"]].max() > 1e-3
    assert apart[x > 1.02 * high].max() < 1e-7  # the engine's tolerance


@pytest.mark.parametrize(
    "change, words",
    [
        ({"value": [1.0]}, "2 to 64 numbers"),
        ({"value": [[1.0, 2.0], [3.0, 4.0]]}, "2 to 64 numbers"),
        ({"sd": [1.0, 2.0, 3.0]}, "as many numbers"),
        ({"covariates": [{**ANGLE, "high": -0.2}]}, "'low' must be below 'high'"),
        ({"acts_on": "input"}, "has no covariate 'angle'"),
        (
            {
                "covariates": [
                    {"name": "travel", "low": 0, "high": 1},
                    {"name": "time", "low": 0, "high": 1},
                ],
                "value": [[0, 1], [2, 3]],
            },
            "cannot be combined",
        ),
        ({"covariates": [ANGLE, ANGLE], "value": [[0, 1], [2, 3]]}, "is stated twice"),
    ],
)
def test_a_block_that_makes_no_sense_is_refused(change, words):
    block = {"acts_on": "moment", "covariates": [ANGLE], "value": [0.0, 1e-4]}
    with pytest.raises(ValidationError, match=words):
        effect("learned", **{**block, **change})
