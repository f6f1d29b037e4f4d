"""The five effects: what they change, what they leave alone, how they compose."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from pliant.errors import UserError
from pliant.interfaces.effect import Effect, Model
from pliant.records.chain import Actuator, ChainModel, Joint
from pliant.records.design import MassProperties
from pliant.records.law import Domain, JointLaw
from pliant.records.rollout import Equilibrium, Inputs, TaskResult
from pliant_plugins.effects.actuation_gain import ActuationGain, ActuationGainConfig
from pliant_plugins.effects.gravity_scale import GravityScale, GravityScaleConfig
from pliant_plugins.effects.pressure_offset import PressureOffset, PressureOffsetConfig
from pliant_plugins.effects.sensor_bias import SensorBias, SensorBiasConfig
from pliant_plugins.effects.stiffness import StiffenedLaw, Stiffness, StiffnessConfig
from pliant_plugins.surrogates.polynomial.config import StudyCoefficients
from pliant_plugins.surrogates.polynomial.study_form import study_law

COEFFICIENTS = StudyCoefficients(k_n=1.637e-6, m_a=-1.704e-6, b_a=0.0, m_e=0.1012, b_e=0.0245)
LAW = study_law(COEFFICIENTS, True, Domain(np.array([0.0, 15e3]), np.array([[-0.2, 0.5]])))
EFFECTS = [
    (Stiffness, StiffnessConfig, 1.3),
    (ActuationGain, ActuationGainConfig, 0.8),
    (PressureOffset, PressureOffsetConfig, 400.0),
    (GravityScale, GravityScaleConfig, 1.2),
    (SensorBias, SensorBiasConfig, 0.02),
]
ALL = pytest.mark.parametrize(("effect", "config", "value"), EFFECTS, ids=[e.__name__ for e, _, _ in EFFECTS])
STATES = (np.linspace(-2e3, 17e3, 60), np.linspace(-0.4, 0.7, 60)[::-1, None])


def model(*inputs: str) -> Model:
    joint = Joint(0, np.array([0.01, 0, 0]), np.eye(3))
    body = MassProperties(1e-3, np.zeros(3), 1e-8 * np.eye(3))
    actuators = tuple(Actuator(name) for name in inputs or ("pressure_pa",))
    return Model(
        ChainModel((joint,), (body, body), (LAW,), np.zeros(3), np.zeros(3), np.eye(3), actuators=actuators)
    )


def result(**metrics: object) -> TaskResult:
    settled = Equilibrium(np.array([[0.1], [0.2]]), np.zeros((4, 3)), 0.0, True, True, 3, 0.0)
    return TaskResult(
        settled, metrics or {"angle_rad": 0.3, "joint_angles_rad": [[0.1], [0.2]], "tip_x_m": 0.05}
    )


def observe(model: Model) -> dict[str, np.ndarray]:
    """All that an effect may change, as numbers."""
    inputs = Inputs({"pressure_pa": 9e3, "tendon_force_n": 2.0})
    for change in model.inputs:
        inputs = change(inputs)
    reported = result()
    for output in model.outputs:
        reported = output(reported)
    effort = model.chain.laws[0].evaluate(*STATES)
    return {
        "tau": effort.tau,
        "dtau_dp": effort.dtau_dp,
        "dtau_du": effort.dtau_du,
        "potential": model.chain.laws[0].potential(*STATES),
        "gravity": model.chain.gravity_m_s2,
        "actuation": np.array(list(inputs.actuation.values())),
        "angle": np.array(reported.metrics["angle_rad"]),
        "joints": np.array(reported.metrics["joint_angles_rad"]),
        "tip": np.array(reported.metrics["tip_x_m"]),
        "settled": reported.final.joint_angles,
    }


def changed(before: dict[str, np.ndarray], after: dict[str, np.ndarray]) -> set[str]:
    return {name for name in before if not np.array_equal(before[name], after[name])}


def with_value(effect: type[Effect], config: type, value: float) -> Effect:
    return effect(config(**{effect.parameters[0].name: value}))


@ALL
def test_the_neutral_value_is_the_identity(effect, config, value) -> None:
    neutral = with_value(effect, config, effect.parameters[0].neutral)
    assert changed(observe(model()), observe(neutral.apply(model()))) == set()


@ALL
def test_the_default_is_neutral_and_the_bounds_are_the_config_s(effect, config, value) -> None:
    parameter = effect.parameters[0]
    assert getattr(config(), parameter.name) == parameter.neutral
    low, high = parameter.bounds
    assert low <= parameter.plausible[0] <= parameter.neutral <= parameter.plausible[1] <= high
    for bound, beyond in ((low, low - 1e-3), (high, high + 1e-3)):
        assert getattr(config(**{parameter.name: bound}), parameter.name) == bound
        with pytest.raises(ValidationError):
            config(**{parameter.name: beyond})


@ALL
def test_an_effect_acts_at_its_place_and_nowhere_else(effect, config, value) -> None:
    after = observe(with_value(effect, config, value).apply(model()))
    expected = {
        "input": {"actuation"},
        "law": {"tau", "dtau_du", "potential"},
        "chain": {"gravity"},
        "output": {"angle", "joints"},
    }
    assert changed(observe(model()), after) == expected[effect.place]


@ALL
def test_nothing_is_changed_in_place(effect, config, value) -> None:
    original = model()
    before = observe(original)
    with_value(effect, config, value).apply(original)
    assert changed(before, observe(original)) == set()
    assert (original.inputs, original.outputs, original.chain.laws[0]) == ((), (), LAW)


@ALL
def test_a_model_with_the_effect_travels_to_another_process(effect, config, value) -> None:
    changed_model = with_value(effect, config, value).apply(model())
    copy = pickle.loads(pickle.dumps(changed_model))
    assert changed(observe(changed_model), observe(copy)) == set()


# -- stiffness -------------------------------------------------------------------------------------


def stiffened(factor: float) -> JointLaw:
    return Stiffness(StiffnessConfig(factor=factor)).apply(model()).chain.laws[0]


def test_stiffness_scales_the_elastic_coefficients_only() -> None:
    stiff = study_law(
        COEFFICIENTS.model_copy(update={"m_e": 1.3 * 0.1012, "b_e": 1.3 * 0.0245}), True, Domain.unbounded(1)
    )
    p, u = np.linspace(0, 15e3, 30), np.linspace(-0.2, 0.5, 30)[:, None]
    expected, effort = stiff.evaluate(p, u), stiffened(1.3).evaluate(p, u)
    for name in ("tau", "dtau_dp", "dtau_du"):
        np.testing.assert_allclose(getattr(effort, name), getattr(expected, name), rtol=1e-12, atol=1e-17)
    np.testing.assert_allclose(stiffened(1.3).potential(p, u), stiff.potential(p, u), rtol=1e-12, atol=1e-17)


def test_the_stiffened_law_is_still_the_derivative_of_its_potential() -> None:
    law, step = stiffened(0.7), 1e-6
    p, u = STATES
    slope = (law.potential(p, u + step) - law.potential(p, u - step)) / (2 * step)
    np.testing.assert_allclose(-slope, law.evaluate(p, u).tau[:, 0], rtol=1e-6, atol=1e-10)
    rate = (law.evaluate(p, u + step).tau - law.evaluate(p, u - step).tau) / (2 * step)
    np.testing.assert_allclose(law.evaluate(p, u).dtau_du[:, 0], rate, rtol=1e-5, atol=1e-9)


def test_wrapping_keeps_the_axes_the_domain_and_the_inner_record() -> None:
    law = stiffened(1.3)
    assert isinstance(law, StiffenedLaw)
    assert (law.axes, law.joint, law.actuation_name) == (LAW.axes, LAW.joint, LAW.actuation_name)
    assert law.domain is LAW.domain
    record = law.record()
    assert (record.kind, record.values["factor"]) == ("effect:stiffness", 1.3)
    assert record.values["inner"]["kind"] == "polynomial"
    np.testing.assert_array_equal(record.arrays["coefficients"], LAW.coefficients)


def test_two_stiffnesses_multiply() -> None:
    twice = Stiffness(StiffnessConfig(factor=1.5)).apply(
        Stiffness(StiffnessConfig(factor=0.8)).apply(model())
    )
    np.testing.assert_allclose(
        twice.chain.laws[0].evaluate(*STATES).tau,
        stiffened(1.2).evaluate(*STATES).tau,
        rtol=1e-12,
        atol=1e-17,
    )


# -- inputs ----------------------------------------------------------------------------------------


def acting(effects: list[Effect], **commanded: float) -> dict[str, float]:
    changed_model = model(*commanded)
    for effect in effects:
        changed_model = effect.apply(changed_model)
    inputs = Inputs(commanded, np.array([1.0, 0, 0]), 0.25)
    for change in changed_model.inputs:
        inputs = change(inputs)
    assert (inputs.tip_force_n.tolist(), inputs.moment_n_m) == ([1.0, 0, 0], 0.25)
    return dict(inputs.actuation)


GAIN = ActuationGain(ActuationGainConfig(gain=0.5))
OFFSET = PressureOffset(PressureOffsetConfig(offset="0.4 kPa"))


def test_gain_scales_every_input_and_offset_shifts_pressures_only() -> None:
    assert acting([GAIN], pressure_1_pa=8e3, tendon_force_n=2.0) == {
        "pressure_1_pa": 4e3,
        "tendon_force_n": 1.0,
    }
    assert acting([OFFSET], pressure_1_pa=8e3, tendon_force_n=2.0) == {
        "pressure_1_pa": 8400.0,
        "tendon_force_n": 2.0,
    }
    assert acting([OFFSET], pressure_pa=0.0) == {"pressure_pa": 400.0}


def test_effects_act_in_the_order_of_the_study() -> None:
    assert acting([GAIN, OFFSET], pressure_pa=8e3) == {"pressure_pa": 4400.0}
    assert acting([OFFSET, GAIN], pressure_pa=8e3) == {"pressure_pa": 4200.0}


def test_an_offset_of_pressure_needs_a_pressure() -> None:
    with pytest.raises(UserError, match="needs a pressure, and the chain is actuated by tendon_force_n"):
        OFFSET.apply(model("tendon_force_n"))


# -- chain and output ------------------------------------------------------------------------------


def test_gravity_is_scaled_with_its_direction() -> None:
    tilted = model().with_(chain=model().chain.with_(gravity_m_s2=np.array([1.0, 0.0, -9.0])))
    after = GravityScale(GravityScaleConfig(factor=1.5)).apply(tilted)
    np.testing.assert_allclose(after.chain.gravity_m_s2, [1.5, 0.0, -13.5])


def test_bias_shifts_each_reported_angle_and_no_position() -> None:
    biased = SensorBias(SensorBiasConfig(bias="2 deg")).apply(model()).outputs[0]
    b = np.pi / 90
    metrics = {
        "angle_rad": 0.3,
        "tip_angle_rad": np.array([0.1, 0.2]),
        "joint_2_angle_rad": -0.1,
        "bend_angle_rad": 0.4,
        "max_joint_angle_rad": 0.2,
        "joint_angles_rad": [[0.1], [0.2]],
        "angle_error_rad": 0.5,
        "tip_x_m": 0.05,
    }
    after = biased(result(**metrics)).metrics
    assert after["angle_rad"] == pytest.approx(0.3 + b)
    np.testing.assert_allclose(after["tip_angle_rad"], [0.1 + b, 0.2 + b])
    assert after["joint_2_angle_rad"] == pytest.approx(b - 0.1)
    np.testing.assert_allclose(after["joint_angles_rad"], [[0.1 + b], [0.2 + b]])
    assert after["bend_angle_rad"] == pytest.approx(0.4 + b)
    assert (after["angle_error_rad"], after["tip_x_m"], after["max_joint_angle_rad"]) == (0.5, 0.05, 0.2)
    assert list(after) == list(metrics)
    assert metrics["joint_angles_rad"] == [[0.1], [0.2]]


def test_bias_without_an_angle_to_shift_is_said() -> None:
    biased = SensorBias(SensorBiasConfig(bias=0.1)).apply(model()).outputs[0]
    with pytest.raises(UserError, match="the task reports only tip_x_m"):
        biased(replace(result(), metrics={"tip_x_m": 0.05}))
