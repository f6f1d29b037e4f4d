"""Properties of all effects, and effects at inputs, chain and outputs: changed and unchanged parts, composition."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.effects.bench import REGISTRY, chain_with, effect, followed, model_with, settled

from pliant.errors import UserError
from pliant.interfaces.effect import Effect, EffectConfig, Model, parameter
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import Actuator, ChainModel
from pliant.records.design import MassProperties
from pliant.records.history import History
from pliant.registry.component import Component
from pliant.testing.effect_bench import SIGHTS
from pliant.testing.samples import linear_law, linear_prismatic_law, sample_chain, softening_law
from pliant.units import Angle
from pliant_plugins.manifest import pliant_components

SHIPPED = [c for c in pliant_components() if c.interface == "effect"]
TENDON_LAW = replace(linear_law(), actuation_name="tendon_force_n")
ALL = pytest.mark.parametrize("component", SHIPPED, ids=[c.kind for c in SHIPPED])
# The kinds of docs/reference/effects.md, two that only chains show, and five mistakes of the record.
NAMES = """
    stiffness wall_thickness bimodulus actuation_gain pressure_offset dead_zone leak supply_lag viscous_damping
    viscoelastic friction_hysteresis mullins permanent_set tendon_friction backlash gravity_scale base_misalignment
    inter_module_compliance cross_axis self_contact thermal_softening sensor_bias sensor_scale sensor_lag inertia
    end_restraint link_stretch payload_error load_error clock_offset clock_drift
    gravity_error tendon_slack unequal_actuators learned
"""
KINDS = set(NAMES.split())


def example(component: Component) -> Effect:
    return effect(component.kind, **component.smallest_block())


def suited(component: Component, modules: int = 3) -> Model:
    """Return a chain that takes the input, or the three inputs, that the effect needs."""
    law = softening_law()
    needed = type(example(component)).actuation or law.actuation_name
    chain = sample_chain(replace(law, actuation_name=needed), modules=modules)
    if component.kind == "unequal_actuators":
        chain = chain.with_(
            actuators=(Actuator("pressure_1_pa"), Actuator("pressure_2_pa", -1.0), Actuator("pressure_3_pa"))
        )
    return Model(chain)


def model(*inputs: str) -> Model:
    chain = sample_chain(linear_law(), modules=2)
    actuators = tuple(Actuator(name) for name in inputs or ("pressure_pa",))
    return Model(chain.with_(actuators=actuators))


def test_the_kinds_in_the_contract_ship() -> None:
    assert {c.kind for c in SHIPPED} == KINDS
    assert {type(example(c)).notes.confounder for c in SHIPPED if type(example(c)).fitted} <= KINDS


@ALL
def test_each_effect_has_a_plain_name_and_a_thing_to_look_at_on_the_bench(component: Component) -> None:
    """The name describes the observation ("the supply answers late"), the inspection is one imperative sentence."""
    name, look = component.summary, type(example(component)).notes.inspection
    assert name[0].islower() and not name.endswith(".") and len(name) <= 60
    assert component.kind not in name and " " in name
    assert look[0].islower() and look[-1] in ".?" and 40 <= len(look) <= 170
    assert ". " not in look


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"plausible": (0.8, 0.2)}, "is not an ordered range"),
        ({"plausible": (0.2, 8.0)}, "is not an ordered range within the bounds"),
        ({"bounds": (2.0, 1.0)}, "are not ordered"),
        ({"neutral": 3.0}, "outside the bounds"),
        ({"role": "strenght"}, "is not one of strength, shape"),
        ({"prior": "uniform"}, "is not one of normal, log_normal"),
        ({"prior": "log_normal", "plausible": (0.0, 1.0)}, "has no room for 0"),
        ({"unit": ""}, "has no unit"),
        ({"simpler": {0.0: "gone"}}, "only a shape has simpler forms"),
        ({"role": "shape", "simpler": {3.0: "one is enough"}}, "outside the bounds"),
        ({"role": "shape", "simpler": {0.0: ""}}, "has no words"),
    ],
)
def test_a_parameter_that_cannot_be_is_refused_where_it_is_declared(
    changes: dict[str, Any], says: str
) -> None:
    given = {"unit": "s^-1", "neutral": 0.0, "bounds": (0.0, 2.0), "plausible": (0.2, 0.8), **changes}
    with pytest.raises(TypeError, match=f"Declared.value: .*{says}"):

        class Declared(EffectConfig):
            value: float = parameter(**given)


def test_a_parameter_has_its_type_unit() -> None:
    class DeclaredGap(EffectConfig):
        gap_rad: Angle = parameter(neutral=0.0, bounds=(0.0, 2.0), plausible=(0.2, 0.8), description="a gap")

    (one,) = DeclaredGap.fit_parameters()
    assert (one.name, one.unit) == ("gap_rad", "rad")
    assert DeclaredGap.model_validate({"kind": "any", "gap": "90 deg"}).gap_rad == pytest.approx(np.pi / 2)  # type: ignore[attr-defined]
    assert DeclaredGap.model_json_schema()["properties"]["gap"]["description"] == "a gap"
    with pytest.raises(TypeError, match="unit 's' is not that of its type, 'rad'"):

        class Other(EffectConfig):
            gap_rad: Angle = parameter(unit="s", neutral=0.0, bounds=(0.0, 2.0), plausible=(0.2, 0.8))


@ALL
def test_a_model_with_the_effect_travels_to_another_process(component: Component) -> None:
    changed = example(component).apply(suited(component))
    copy = pickle.loads(pickle.dumps(changed))
    for sight in SIGHTS.values():
        np.testing.assert_array_equal(sight(copy), sight(changed))


def test_no_two_effects_mistake_each_other_without_a_way_out() -> None:
    """Following the look-alikes never leads to a kind without notes."""
    notes = {c.kind: type(example(c)).notes for c in SHIPPED}
    fitted = [c.kind for c in SHIPPED if type(example(c)).fitted]
    assert all(notes[notes[kind].confounder].distinguishing_test for kind in fitted)


OPPOSED = (Actuator("tendon_force_1_n", 1.0), Actuator("tendon_force_2_n", -1.0))
HINGES, PULLED = sample_chain(linear_law(), modules=3), sample_chain(TENDON_LAW, modules=3)
WEIGHTLESS = HINGES.with_(
    bodies=tuple(MassProperties(0.0, body.com_m, np.zeros((3, 3))) for body in HINGES.bodies)
)
UNSTABLE = sample_chain(linear_law(stiffness=-0.04), modules=2)
SLIDES = sample_chain(linear_prismatic_law(), modules=3)
ONE = sample_chain(modules=1)
REFUSED = [
    ("pressure_offset", PULLED, "needs a pressure, and the chain is actuated by tendon_force_n"),
    ("dead_zone", PULLED, "needs a pressure, and the chain is actuated by tendon_force_n"),
    ("leak", PULLED, "'leak' needs a pressure, and the chain is actuated by tendon_force_n"),
    ("link_stretch", PULLED, "needs a pressure"),
    ("tendon_friction", HINGES, "law takes pressure_pa; families with tendons are 'tendon_joint'"),
    ("tendon_friction", PULLED.with_(actuators=OPPOSED), "tendons that pull one way.* has opposed ones"),
    ("inertia", WEIGHTLESS, "'inertia' needs masses, and the chain has none beyond its base"),
    ("inertia", UNSTABLE, "slope .* at rest"),
    ("friction_hysteresis", UNSTABLE, "slope .* at rest"),
    ("end_restraint", ONE, "two joints or more"),
    ("inter_module_compliance", ONE, "the chain has one module"),
    ("inter_module_compliance", SLIDES, "this chain only extends"),
    ("cross_axis", SLIDES, "this chain only extends"),
]


@pytest.mark.parametrize(("kind", "chain", "says"), REFUSED, ids=[f"{r[0]}-{r[2][:20]}" for r in REFUSED])
def test_a_chain_that_an_effect_is_not_for_is_refused(kind: str, chain: ChainModel, says: str) -> None:
    with pytest.raises(UserError, match=says):
        example(REGISTRY.get("effect", kind)).apply(Model(chain))


def test_a_payload_is_mass_enough_and_an_axis_that_is_not_turned_is_any_chain_s() -> None:
    effect("inertia", scale=1.0).apply(Model(WEIGHTLESS.with_(payload_kg=0.01)))
    untouched = model_with(HINGES, "cross_axis", turn_rad=0.0).chain.joints[0].rest_rotation
    assert untouched.tolist() == np.eye(3).tolist()


POSED = [
    ("base_misalignment", {"pitch_rad": 0.05, "roll_rad": -0.03}, {}),
    ("cross_axis", {"turn_rad": 0.2}, {"base": {"direction": [1.0, 0.0, 0.0]}}),
    ("inter_module_compliance", {"share": 0.3}, {}),
]


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
@pytest.mark.parametrize(("kind", "values", "posed"), POSED, ids=[p[0] for p in POSED])
def test_other_engines_stand_where_the_quasi_static_one_does(
    kind: str, values: dict[str, float], posed: dict[str, Any], engine: str
) -> None:
    plain = sample_chain(modules=3, payload=0.003, **posed)
    chain = model_with(plain, kind, **values).chain
    here, there = (settled(chain, name, 6e3, moment_n_m=1e-3) for name in ("quasistatic", engine))
    assert float(np.abs(there.markers_m - here.markers_m).max()) < 1e-5
    without = settled(plain, pressure=6e3, moment_n_m=1e-3)
    assert float(np.abs(here.tip_m - without.tip_m).max()) > 1e-4


# -- inputs ----------------------------------------------------------------------------------------

GAIN = effect("actuation_gain", gain=0.5)
OFFSET = effect("pressure_offset", offset="0.4 kPa")
DEAD = effect("dead_zone", threshold="1 kPa")


def acting(effects: list[Effect], time_s: Any = None, **commanded: Any) -> dict[str, list[float]]:
    changed = model(*commanded)
    for one in effects:
        changed = one.apply(changed)
    reached = changed.commanded(
        History.from_arrays(commanded, time_s, tip_force_n=[1.0, 0, 0], moment_n_m=0.25)
    )
    assert (reached.tip_force_n[0].tolist(), reached.moment_n_m[0]) == ([1.0, 0, 0], 0.25)
    return {name: values.tolist() for name, values in reached.actuation.items()}


def test_gain_scales_every_input_and_offset_shifts_pressures_only() -> None:
    assert acting([GAIN], pressure_1_pa=8e3, tendon_force_n=2.0) == {
        "pressure_1_pa": [4e3],
        "tendon_force_n": [1.0],
    }
    assert acting([OFFSET], pressure_1_pa=8e3, tendon_force_n=2.0) == {
        "pressure_1_pa": [8400.0],
        "tendon_force_n": [2.0],
    }
    assert acting([OFFSET], pressure_pa=0.0) == {"pressure_pa": [400.0]}


def test_a_dead_zone_swallows_the_threshold_on_either_side() -> None:
    pressures = np.array([-3e3, -1e3, -500.0, 0.0, 500.0, 1e3, 3e3])
    assert acting([DEAD], pressure_pa=pressures)["pressure_pa"] == [-2e3, 0, 0, 0, 0, 0, 2e3]


def test_effects_act_in_study_order() -> None:
    assert acting([GAIN, OFFSET], pressure_pa=8e3) == {"pressure_pa": [4400.0]}
    assert acting([OFFSET, GAIN], pressure_pa=8e3) == {"pressure_pa": [4200.0]}
    assert acting([DEAD, GAIN], pressure_pa=8e3) == {"pressure_pa": [3500.0]}
    assert acting([GAIN, DEAD], pressure_pa=8e3) == {"pressure_pa": [3000.0]}


def lag(time_s: float, second_ratio: float = 1.0) -> Effect:
    """Return a supply lag; with the ratio 1 it has two equal stages in series, whose closed forms are short."""
    return effect("supply_lag", time_s=time_s, second_ratio=second_ratio)


@given(
    st.lists(st.floats(1e-6, 30.0), min_size=1, max_size=20),
    st.floats(1e-3, 60.0),
    st.floats(0.01, 0.99),
    st.floats(-1e5, 1e5),
)
def test_after_a_change_the_rest_decays_as_its_exponentials_at_any_step(
    steps: list[float], first_s: float, ratio: float, level: float
) -> None:
    """p_c: 0 → level at once, then constant: 1 − (T e^(−t/T) − T₂ e^(−t/T₂)) / (T − T₂)."""
    t = np.cumsum([0.0, 0.0, *steps])
    pressure = np.where(np.arange(len(t)) > 0, level, 0.0)
    reached = np.array(acting([lag(first_s, ratio)], t, pressure_pa=pressure)["pressure_pa"])
    left = (np.exp(-t / first_s) - ratio * np.exp(-t / (ratio * first_s))) / (1 - ratio)
    np.testing.assert_allclose(reached, level * (1 - left), rtol=0, atol=1e-12 * abs(level) + 1e-12)


def test_a_run_starts_in_balance_and_data_without_times_have_no_lag() -> None:
    t = np.array([5.0, 5.1, 9.0])
    assert acting([lag(2.0)], t, pressure_pa=np.full(3, 7e3))["pressure_pa"] == [7e3] * 3
    levels = np.array([0.0, 9e3, 3e3])
    assert acting([lag(2.0)], None, pressure_pa=levels)["pressure_pa"] == levels.tolist()
    assert acting([lag(0.0)], t, pressure_pa=levels)["pressure_pa"] == levels.tolist()


def test_lag_acts_on_tendons_and_each_chamber_alone() -> None:
    t = np.array([0.0, 1.0])
    reached = acting(
        [lag(1.0)], t, tendon_force_1_n=np.array([0.0, 2.0]), tendon_force_2_n=np.array([3.0, 3.0])
    )
    assert reached["tendon_force_2_n"] == [3.0, 3.0]
    assert reached["tendon_force_1_n"][1] == pytest.approx(2.0 * (3.0 * np.exp(-1.0) - 1.0))


# -- chain and output ------------------------------------------------------------------------------


def test_gravity_is_scaled_with_its_direction() -> None:
    tilted = model().with_(chain=model().chain.with_(gravity_m_s2=np.array([1.0, 0.0, -9.0])))
    after = model_with(tilted, "gravity_scale", factor=1.5)
    np.testing.assert_allclose(after.chain.gravity_m_s2, [1.5, 0.0, -13.5])


SENSED = {
    "angle_rad": 0.3,
    "tip_angle_rad": np.array([0.1, 0.2]),
    "joint_2_angle_rad": -0.1,
    "bend_angle_rad": 0.4,
    "joint_angles_rad": [[0.1], [0.2]],
}
UNSENSED = {
    "time_s": np.array([0.0, 1.0]),
    "max_joint_angle_rad": 0.2,
    "angle_error_rad": 0.5,
    "elongation_strain": 0.1,
    "tip_x_m": 0.05,
}


@pytest.mark.parametrize(
    ("kind", "values", "shift", "factor"),
    [("sensor_bias", {"bias": "2 deg"}, np.pi / 90, 1.0), ("sensor_scale", {"excess": 0.06}, 0.0, 1.06)],
)
def test_a_sensor_changes_each_reported_angle_once_and_no_position(
    kind: str, values: dict[str, Any], shift: float, factor: float
) -> None:
    sensor = model_with(model(), kind, **values)
    after = sensor.reported({**SENSED, **UNSENSED})
    assert list(after) == [*SENSED, *UNSENSED]
    for name, angle in SENSED.items():
        assert isinstance(after[name], type(angle))
        np.testing.assert_allclose(after[name], factor * np.asarray(angle) + shift, rtol=1e-14)
    assert all(after[name] is value for name, value in UNSENSED.items())
    assert SENSED["joint_angles_rad"] == [[0.1], [0.2]]
    assert sensor.reported({"tip_x_m": 0.05}) == {"tip_x_m": 0.05}


def test_scale_and_bias_act_in_study_order() -> None:
    bias, scale = effect("sensor_bias", bias_rad=0.1), effect("sensor_scale", excess=0.5)
    assert scale.apply(bias.apply(model())).reported({"angle_rad": 0.2})["angle_rad"] == pytest.approx(0.45)
    assert bias.apply(scale.apply(model())).reported({"angle_rad": 0.2})["angle_rad"] == pytest.approx(0.4)


# -- eccentric weights ---------------------------------------------------------------------------------

ASIDE = 0.02


def hanging(pitch_rad: float, **values: float) -> np.ndarray:
    chain = chain_with(sample_chain(modules=1), "gravity_scale", **values)
    history = History.from_arrays({"pressure_pa": 0.0}, base_angles_rad=[[0.0, pitch_rad, 0.0]])
    return followed(chain, history)[0][:, 0]


def moment(u: float) -> float:
    """Return the effort of the joint's law at an angle."""
    law = sample_chain(modules=1).laws[0]
    return float(law.evaluate(np.zeros(1), np.array([[u]])).tau[0, 0])


def test_a_weight_beside_the_axis_turns_a_hanging_joint_by_its_moment() -> None:
    chain = sample_chain(modules=1)
    body = chain.bodies[1]
    u = float(hanging(0.0, aside=ASIDE)[0])
    weight, side, arm = body.mass_kg * 9.81, ASIDE * chain.length_m, float(body.com_m[0])
    # the piece, hanging straight down, turns until its law carries side and arm
    carried = weight * abs(side * np.cos(u) - arm * abs(np.sin(u)))
    assert abs(moment(u)) == pytest.approx(carried, abs=2e-9)  # the solver's tolerance is 1e-9 N·m
    assert float(hanging(0.0)[0]) == pytest.approx(0.0, abs=1e-9)
    assert float(hanging(0.0, aside=-ASIDE)[0]) == pytest.approx(-u, abs=1e-9)


def test_held_level_a_weight_beside_the_axis_hardly_matters_and_the_factor_does() -> None:
    level = np.pi / 2
    plain, scaled = float(hanging(level)[0]), float(hanging(level, factor=2.0)[0])
    beside = float(hanging(level, aside=ASIDE)[0])
    assert abs(scaled) > 1.8 * abs(plain) > 0
    assert abs(beside - plain) < 0.2 * abs(float(hanging(0.0, aside=ASIDE)[0]))


# -- pieces that pressure lengthens --------------------------------------------------------------

BENT_RAD = np.array([[0.3], [-0.1], [0.2]])
BASE = np.array([0.1, -0.2, 0.4])
MOVED = sample_chain(modules=3).with_(base_position_m=BASE)


def stretched(per_mpa: float, pressure_pa: float) -> dict[str, float]:
    tip = ChainGeometry.from_chain(MOVED).markers(BENT_RAD)[-1]
    readings = {f"tip_{axis}_m": float(tip[k]) for k, axis in enumerate("xyz")}
    readings |= {"angle_rad": 0.4, "actuation": pressure_pa}
    return dict(model_with(MOVED, "link_stretch", strain_per_mpa=per_mpa).reported(readings))


def test_positions_equal_a_chain_with_longer_pieces() -> None:
    strain = 2.0 * 15e3 / 1e6
    longer = MOVED.with_(
        joints=tuple(
            type(joint)(joint.law, (1 + strain) * joint.offset_m, joint.rest_rotation)
            for joint in MOVED.joints
        ),
        tip_offset_m=(1 + strain) * MOVED.tip_offset_m,
    )
    tip = ChainGeometry.from_chain(longer).markers(BENT_RAD)[-1]
    found = stretched(2.0, 15e3)
    np.testing.assert_allclose([found[f"tip_{axis}_m"] for axis in "xyz"], tip, rtol=1e-12)
    assert found["angle_rad"] == 0.4


def test_without_pressure_or_without_knowing_it_nothing_moves() -> None:
    assert stretched(2.0, 0.0) == stretched(0.0, 15e3) | {"actuation": 0.0}
    model = model_with(MOVED, "link_stretch", strain_per_mpa=2.0)
    assert model.reported({"tip_x_m": 0.05}) == {"tip_x_m": 0.05}
