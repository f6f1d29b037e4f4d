"""Law terms along prescribed motions, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.effects.bench import effect

from pliant.interfaces.effect import Effect, Model
from pliant.records.chain import Actuator, ChainModel
from pliant.records.design import Array
from pliant.testing.histories import HeldMotion, drive, triangles
from pliant.testing.samples import linear_law, sample_chain, softening_law
from pliant_plugins.effects.scale import rest_stiffness

K = 0.04  # N·m/rad, of the linear sample law
GAIN = 8e-7  # N·m/Pa
LINEAR = sample_chain(linear_law(GAIN, K), modules=1)
FRICTION = effect("friction_hysteresis", half_width_rad=0.05, break_away_rad=0.01)
SLIP = 0.05 * K
unequal_steps = st.lists(st.floats(1e-4, 40.0), min_size=1, max_size=15)


def with_effects(chain: ChainModel, *effects: Effect) -> ChainModel:
    model = Model(chain)
    for one in effects:
        model = one.apply(model)
    return model.chain


def added(one: Effect, motion: HeldMotion, chain: ChainModel = LINEAR) -> Array:
    """Return the effort that the effect adds along a motion."""
    return drive(with_effects(chain, one), motion).effort - drive(chain, motion).effort


# -- viscoelastic and viscous ----------------------------------------------------------------------


@given(unequal_steps, st.floats(1.0, 1000.0), st.floats(0.01, 5.0))
def test_a_held_angle_relaxes_as_its_exponential_at_any_step(
    steps: list[float], time_s: float, share: float
) -> None:
    t = np.cumsum([0.0, 1e-9, *steps])
    angle = np.where(t > 0, 0.3, 0.0)
    moment = added(effect("viscoelastic", share=share, time_s=time_s), HeldMotion.from_angles(t, angle))
    wanted = -share * K * 0.3 * np.exp(-(t[1:] - t[1]) / time_s)
    np.testing.assert_allclose(moment[1:], wanted, rtol=1e-6, atol=1e-14)


@given(unequal_steps)
def test_a_steady_motion_tends_to_a_dashpot_exactly(steps: list[float]) -> None:
    """h = T r (1 − exp(−t/T)) for the rate r, for any step length."""
    t = np.cumsum([0.0, *steps])
    moment = added(effect("viscoelastic", share=0.5, time_s=20.0), HeldMotion.from_angles(t, 1e-3 * t))
    np.testing.assert_allclose(
        moment, -0.5 * K * 1e-3 * 20.0 * (1 - np.exp(-t / 20.0)), rtol=1e-6, atol=1e-14
    )


def test_branches_add_up_to_a_prony_series() -> None:
    t = np.linspace(0, 60, 61)
    angle = np.where(t > 0, 0.2, 0.0)
    fast, slow = (effect("viscoelastic", share=0.2, time_s=time) for time in (2.0, 50.0))
    both = drive(with_effects(LINEAR, fast, slow), HeldMotion.from_angles(t, angle)).effort
    plain = drive(LINEAR, HeldMotion.from_angles(t, angle)).effort
    np.testing.assert_allclose(
        both - plain,
        added(fast, HeldMotion.from_angles(t, angle)) + added(slow, HeldMotion.from_angles(t, angle)),
        atol=1e-15,
    )


def test_a_state_that_is_reached_slowly_has_relaxed() -> None:
    motion = HeldMotion.from_angles(np.array([0.0, np.inf]), np.array([0.3, 0.5]))
    for one in (
        effect("viscoelastic", share=1.0, time_s=5.0),
        effect("viscous_damping", time_s=1.0),
    ):
        assert added(one, motion).tolist() == [0.0, 0.0]


def test_a_dashpot_opposes_the_rate_and_nothing_else() -> None:
    time_s, angle = triangles((0.4, 0.0), 0.2, 0.05, holds_s=1.0)
    moment = added(effect("viscous_damping", time_s=0.5), HeldMotion.from_angles(time_s, angle))
    rate = np.append(0.0, np.diff(angle) / 0.05)
    np.testing.assert_allclose(moment, -0.5 * K * rate, atol=1e-15)
    assert set(np.round(rate, 9)) == {0.0, 0.2, -0.2}


# -- friction --------------------------------------------------------------------------------------


def loop_area(one: Effect, amplitude: float, rate: float) -> float:
    """Return −∮ M du of the last of three cycles ±amplitude, sampled at the corners of the loop."""
    cycle = round(2 * amplitude / 0.002)
    time_s, angle = triangles((amplitude, -amplitude) * 3, rate, 0.002 / rate)
    moment = added(one, HeldMotion.from_angles(time_s, angle))
    last = slice(-2 * cycle - 1, None)
    return -float(np.trapezoid(moment[last], angle[last]))


@pytest.mark.parametrize("amplitude", [0.02, 0.1, 0.2])
@pytest.mark.parametrize("rate", [0.01, 1.0])
def test_the_friction_loop_area(amplitude: float, rate: float) -> None:
    assert loop_area(FRICTION, amplitude, rate) == pytest.approx(4 * SLIP * (amplitude - 0.01), rel=1e-6)


def test_a_loop_below_break_away_is_a_spring() -> None:
    assert loop_area(FRICTION, 0.008, 1.0) == pytest.approx(0.0, abs=1e-12)
    _, angle = triangles((0.008,), 1.0, 1e-4)
    moment = added(FRICTION, HeldMotion.from_angles(np.arange(len(angle)) * 1.0, angle))
    np.testing.assert_allclose(moment, -SLIP * angle / 0.01, atol=1e-15)


def test_friction_needs_no_clock() -> None:
    """Steps of any duration, infinite ones too, give the same moments."""
    angles = np.array([0.0, 0.1, 0.2, 0.1, 0.0])
    wanted = [0, -SLIP, -SLIP, SLIP, SLIP]
    for time_s in (np.arange(5.0), np.array([0.0, 1e-6, 1.0, 1e5, np.inf])):
        np.testing.assert_allclose(
            added(FRICTION, HeldMotion.from_angles(time_s, angles)), wanted, atol=1e-15
        )


# -- damage ----------------------------------------------------------------------------------------

MULLINS = effect("mullins", softening=0.3, scale_rad=0.2)


def elastic(chain: ChainModel, angle: Array) -> Array:
    return chain.laws[0].evaluate(np.zeros(len(angle)), angle[:, None]).tau[:, 0]


def test_the_virgin_curve_is_the_model_s_and_the_next_lies_below_it() -> None:
    chain = sample_chain(softening_law(), modules=1)
    time_s, angle = triangles((0.3, 0.0, 0.3, 0.5, 0.0), 0.1, 0.1)
    factor = np.ones(len(angle))
    moved = np.abs(angle) > 1e-12
    effort = drive(with_effects(chain, MULLINS), HeldMotion.from_angles(time_s, angle)).effort
    factor[moved] = effort[moved] / elastic(chain, angle)[moved]
    largest = np.maximum.accumulate(angle)
    wanted = 1 - 0.3 * np.array([math.erf(x) for x in (largest**2 - angle**2) / 0.2**2])
    np.testing.assert_allclose(factor[moved], wanted[moved], rtol=1e-9)
    first, second = slice(0, 31), slice(60, 91)
    np.testing.assert_allclose(factor[first], 1.0)
    assert np.all(factor[second][1:-1] < 1.0)
    assert np.all(np.abs(effort[second][1:-1]) < np.abs(effort[first][1:-1]))
    np.testing.assert_allclose(factor[91:111], 1.0)  # beyond the past maximum as stiff as new


def test_softening_counts_either_way() -> None:
    time_s, angle = triangles((-0.4, 0.2), 0.1, 0.1)
    effort = drive(with_effects(LINEAR, MULLINS), HeldMotion.from_angles(time_s, angle)).effort
    assert effort[-1] / elastic(LINEAR, angle)[-1] == pytest.approx(1 - 0.3 * math.erf(0.12 / 0.04))


def test_the_unloaded_angle_follows_the_largest_past_angles() -> None:
    chain = with_effects(LINEAR, effect("permanent_set", share=0.1))
    time_s, angle = triangles((0.4, 0.0, 0.2, 0.0, -0.3, 0.0, 0.5), 0.1, 0.1, holds_s=3.0)
    driven = drive(chain, HeldMotion.from_angles(time_s, angle))
    rest = angle + driven.effort / K  # E(u − u₀) = −K (u − u₀)
    highest, lowest = np.maximum.accumulate(angle), np.minimum.accumulate(angle)
    np.testing.assert_allclose(rest, 0.1 * (highest + lowest), atol=1e-12)
    assert rest[-1] == pytest.approx(0.1 * (0.5 - 0.3))


# -- without memory --------------------------------------------------------------------------------


def test_contact_is_a_kink() -> None:
    contact = effect("self_contact", stiffening=3.0, contact_rad=0.25)
    angle = np.linspace(-0.5, 0.5, 101)
    motion = HeldMotion.from_angles(np.arange(101.0), angle)
    np.testing.assert_allclose(added(contact, motion), -3 * K * np.maximum(angle - 0.25, 0), atol=1e-15)
    slope = drive(with_effects(LINEAR, contact), motion).slope
    np.testing.assert_allclose(slope[angle < 0.249], -K, rtol=1e-6)
    np.testing.assert_allclose(slope[angle > 0.251], -4 * K, rtol=1e-6)


@pytest.mark.parametrize(("temperature_c", "factor"), [(22.0, 1.0), (42.0, 0.9), (2.0, 1.1), (400.0, 0.05)])
def test_the_warmer_the_softer(temperature_c: float, factor: float) -> None:
    thermal = effect("thermal_softening", loss_per_k=0.005)
    motion = HeldMotion.from_angles(np.arange(3.0), np.array([-0.2, 0.1, 0.4]), 9e3, temperature_c)
    np.testing.assert_allclose(added(thermal, motion), -(factor - 1) * K * motion.angle_rad, atol=1e-15)


def test_stiffness_scales_the_elastic_part_and_leaves_actuation() -> None:
    chain = sample_chain(softening_law(), modules=1)
    motion = HeldMotion.from_angles(np.arange(4.0), np.array([-0.3, 0.1, 0.2, 0.5]), 9e3)
    np.testing.assert_allclose(
        added(effect("stiffness", factor=1.3), motion, chain),
        0.3 * elastic(chain, motion.angle_rad),
        rtol=1e-12,
    )


def test_factors_multiply_moments_add_and_their_order_does_not_matter() -> None:
    effects: list[Effect] = [
        effect("stiffness", factor=1.5),
        effect("thermal_softening", loss_per_k=0.01),
        FRICTION,
        effect("viscous_damping", time_s=0.2),
    ]
    time_s, angle = triangles((0.4, -0.1), 0.2, 0.05)
    motion = HeldMotion.from_angles(time_s, angle, 5e3, 32.0)
    there = drive(with_effects(LINEAR, *effects), motion).effort
    back = drive(with_effects(LINEAR, *effects[::-1]), motion).effort
    np.testing.assert_allclose(there, back, rtol=1e-12, atol=1e-16)
    moments = added(effects[2], motion) + added(effects[3], motion)
    np.testing.assert_allclose(there, GAIN * 5e3 - 1.5 * 0.9 * K * angle + moments, atol=1e-15)


# -- scale -----------------------------------------------------------------------------------------


def test_moments_are_stated_in_the_joint_s_own_stiffness() -> None:
    """A joint a hundred times as stiff under a hundred times the gain moves equally."""
    time_s, angle = triangles((0.4, -0.1), 0.2, 0.05, holds_s=1.0)
    large = sample_chain(linear_law(100 * GAIN, 100 * K), modules=1)
    for one in (
        FRICTION,
        effect("viscoelastic", share=0.3, time_s=10.0),
        effect("viscous_damping", time_s=0.3),
        effect("self_contact", stiffening=2.0, contact_rad=0.2),
    ):
        motion = HeldMotion.from_angles(time_s, angle, 3e3)
        np.testing.assert_allclose(added(one, motion, large), 100 * added(one, motion), rtol=1e-9, atol=1e-12)


def test_opposed_chambers_are_two_springs() -> None:
    pair = LINEAR.with_(actuators=(Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -1.0)))
    assert rest_stiffness(LINEAR) == pytest.approx(K)
    assert rest_stiffness(pair) == pytest.approx(2 * K)
