"""Forms of an equation against the closed forms that they have; the plain form is the neutral one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.diagnosis.quick import REGISTRY, effect, joint

from pliant.interfaces.effect import EffectConfig, Model
from pliant.mechanics.full_scale import full_scale
from pliant.records.history import History
from pliant.records.term import LawTerm
from pliant_plugins.effects.factors import DEPTH_RAD, TYPICAL_RAD, TYPICAL_RAD_S

CHAIN = joint()
FULL = full_scale(CHAIN)


def applied(kind: str, **values: Any) -> Model:
    component = REGISTRY.get("effect", kind)
    return component.implementation_class()(effect(kind, **values)).apply(Model(CHAIN))


def term(kind: str, **values: Any) -> LawTerm:
    return applied(kind, **values).chain.terms[-1]


def value(
    of: LawTerm, angle: float = 0.0, rate: float = 0.0, dt: float = 1.0, warm: float = 0.0, old: Any = ()
) -> float:
    memory = np.array(old or np.zeros(of.n_states), float)
    new = np.zeros(of.n_states)
    return of.function(angle, rate, dt, 0.0, 22.0 + warm, memory, new, np.array(of.numbers(0)))


FORMED = [
    kind
    for kind in REGISTRY.kinds("effect")
    if (model := REGISTRY.get("effect", kind).config_model())
    and issubclass(model, EffectConfig)
    and model.form_parameters()
]


def test_forms_are_declared_and_held_at_the_plain_one() -> None:
    assert len(FORMED) >= 18
    for kind in FORMED:
        model = REGISTRY.get("effect", kind).config_model()
        for form in model.form_parameters():
            assert getattr(model(kind=kind), form.name) == form.neutral
        assert not {one.name for one in model.form_parameters()} & {
            one.name for one in model.fit_parameters()
        }


@pytest.mark.parametrize("power", [0.6, 1.0, 1.7])
def test_power_laws_meet_the_plain_one_at_the_stated_size(power: float) -> None:
    def ratio(size: float, at: float) -> float:
        return (size / at) ** power / (size / at)

    for rate in (0.5 * TYPICAL_RAD_S, 4.0 * TYPICAL_RAD_S):
        plain, bent = (
            value(term("viscous_damping", time_s=0.2, rate_power=n), rate=rate) for n in (1.0, power)
        )
        assert bent == pytest.approx(plain * ratio(rate, TYPICAL_RAD_S), rel=2e-3)
    for angle in (0.5 * TYPICAL_RAD, 2.0 * TYPICAL_RAD):
        plain, bent = (value(term("permanent_set", share=0.1, power=n), angle) for n in (1.0, power))
        assert bent == pytest.approx(plain * ratio(angle, TYPICAL_RAD))
    if power >= 1.0:
        for depth in (0.3 * DEPTH_RAD, 2.0 * DEPTH_RAD):
            given = {"stiffening": 2.0, "contact_rad": 0.2}
            plain, bent = (value(term("self_contact", **given, power=n), 0.2 + depth) for n in (1.0, power))
            assert bent == pytest.approx(plain * ratio(depth, DEPTH_RAD))


def test_a_stiffness_that_changes_with_the_angle() -> None:
    for angle in (0.25 * TYPICAL_RAD, -3.0 * TYPICAL_RAD):
        found = value(term("stiffness", factor=1.3, angle_power=0.5), angle)
        assert found == pytest.approx(1.0 + 0.3 * math.sqrt(abs(angle) / TYPICAL_RAD))


def test_several_relaxation_times_are_three_branches() -> None:
    """After an instantaneous jump of the angle the excess decays as the mean of three exponentials."""
    branch = term("viscoelastic", share=0.3, time_s=10.0, spread=4.0)
    memory = [1.0, 1.0, 1.0]
    stiffness = -value(term("viscoelastic", share=0.3, time_s=10.0), dt=1e-9, old=memory)
    for t in (1.0, 10.0, 60.0):
        faded = np.mean([math.exp(-t / one) for one in (2.5, 10.0, 40.0)])
        assert value(branch, dt=t, old=memory) == pytest.approx(-stiffness * faded)


def test_friction_with_several_surfaces_has_the_plain_limit_and_grows_with_the_rate() -> None:
    given = {"half_width_rad": 0.03, "break_away_rad": 0.01}
    plain, spread = term("friction_hysteresis", **given), term("friction_hysteresis", **given, spread=0.5)
    assert value(spread, 1.0) == pytest.approx(value(plain, 1.0))  # all elements have slipped
    assert abs(value(spread, 0.01)) < abs(value(plain, 0.01))  # δ/2 and δ slip, 2.5 δ does not
    assert value(spread, 0.01) == pytest.approx(value(plain, 1.0) * (1.0 + 1.0 + 1.0 / 2.5) / 3.0)
    fast = value(term("friction_hysteresis", **given, rate_power=0.2), 1.0, rate=8.0 * TYPICAL_RAD_S)
    assert fast == pytest.approx(value(plain, 1.0) * 8.0**0.2, rel=1e-3)


def test_softening_and_temperature_with_a_curvature() -> None:
    given = {"softening": 0.3, "scale_rad": 0.4}
    below = (0.3**2 - 0.1**2) / 0.4**2
    for power in (0.5, 1.0, 1.5):
        found = value(term("mullins", **given, power=power), 0.1, old=[0.3])
        assert found == pytest.approx(1.0 - 0.3 * math.erf(below**power))
    warm = value(term("thermal_softening", loss_per_k=0.01, curvature_per_k=0.005), warm=20.0)
    assert warm == pytest.approx(1.0 - 0.01 * 20.0 * (1.0 - 0.005 * 20.0))


def pressed(
    kind: str, pressure: np.ndarray, clock: np.ndarray | None = None, valve: Any = None, **values: Any
) -> np.ndarray:
    history = History.from_arrays({"pressure_pa": pressure}, clock, valve_open=valve)
    return applied(kind, **values).commanded(history).actuation["pressure_pa"]


def test_changes_that_fade_with_the_pressure_and_a_rounded_threshold() -> None:
    p = np.linspace(0.0, 0.8 * FULL, 9)
    assert np.allclose(
        pressed("actuation_gain", p, gain=1.2, fading=0.3), p * (1.0 + 0.2 * (1.0 - 0.3 * p / FULL))
    )
    offset = pressed("pressure_offset", p, offset_pa=500.0, fading=-0.4)
    assert np.allclose(offset, p + 500.0 * (1.0 + 0.4 * p / FULL))
    rounded = pressed("dead_zone", p, threshold_pa=1e3, rounding=0.3)
    sharp = pressed("dead_zone", p, threshold_pa=1e3)
    assert rounded[0] == 0.0 and np.all(np.diff(rounded) > 0.0)
    assert np.abs(rounded - sharp).max() <= 0.3 * 1e3 * math.log(2.0)
    assert np.allclose(pressed("dead_zone", p, threshold_pa=1e3, rounding=1e-4), sharp, atol=0.1)


def test_an_orifice_empties_along_a_parabola() -> None:
    """With n = 1/2 the root of the difference falls linearly, and the pressure is reached after 2 T."""
    time_s = np.concatenate([[0.0, 1e-9], np.linspace(0.01, 1.5, 150)])
    step = np.where(time_s > 0.0, FULL, 0.0)
    left = 1.0 - pressed("supply_lag", step, time_s, time_s=0.5, second_ratio=0.01, power=0.5) / FULL
    exact = np.clip(1.0 - 0.5 * time_s / 0.5, 0.0, None) ** 2
    assert np.abs(left - exact)[5:].max() < 0.02  # the hose behind it takes 5 ms


def test_a_delay_moves_what_arrives() -> None:
    time_s = 0.1 * np.arange(200)
    wave = 0.5 * FULL * (1.0 - np.cos(time_s))
    plain, late = (pressed("supply_lag", wave, time_s, time_s=0.2, delay_s=d) for d in (0.0, 0.3))
    assert np.abs(late[30:] - plain[27:-3]).max() < 2e-3 * FULL


def test_a_leak_through_an_orifice_loses_its_root_in_a_straight_line() -> None:
    time_s = 0.05 * np.arange(200)
    shut = (time_s < 0.01).astype(float)
    left = pressed("leak", np.full(200, FULL), time_s, shut, rate_1_s=0.1, power=0.5, filling_time_s=1e-5)
    assert np.allclose(np.sqrt(left / FULL), 1.0 - 0.05 * time_s, atol=2e-3)


def read(kind: str, angle: np.ndarray, clock: np.ndarray | None = None, **values: Any) -> np.ndarray:
    when = {} if clock is None else {"time_s": clock}
    return np.asarray(applied(kind, **values).reported({"angle_rad": angle, **when})["angle_rad"])


def test_sensor_forms() -> None:
    u = np.linspace(-0.5, 0.5, 11)
    assert np.allclose(
        read("sensor_scale", u, excess=0.1, curvature_per_rad=0.6), u * (1.0 + 0.1 * (1.0 + 0.6 * np.abs(u)))
    )
    time_s = 0.05 * np.arange(400)
    step = (time_s > 2.0).astype(float)
    two = read("sensor_lag", step, time_s, time_s=0.4, second_ratio=0.5)
    t = np.clip(time_s - 2.0, 0.0, None)
    exact = 1.0 - (0.4 * np.exp(-t / 0.4) - 0.2 * np.exp(-t / 0.2)) / 0.2
    assert np.abs(two - exact).max() < 0.08  # the record rises within one sample
    swing = np.concatenate([np.linspace(0.0, 1.0, 50), np.linspace(1.0, 0.0, 50)])
    plain, parts = (read("backlash", swing, time_s[:100], play_rad=0.2, spread=s) for s in (0.0, 0.5))
    assert (
        parts[49] == pytest.approx(plain[49]) and parts[55] < plain[55]
    )  # one of the elements has slipped already
