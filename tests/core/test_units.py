"""Quantities at the boundary."""

import pytest
from pydantic import ValidationError

from pliant.config.study import nested_model
from pliant.interfaces.base import FrozenModel
from pliant.interfaces.effect import EffectConfig
from pliant.registry.discovery import discover
from pliant.units import (
    AngularDamping,
    Force,
    Length,
    Pressure,
    Rate,
    TemperatureDifference,
    config_field_unit,
    quantities_in,
    split_unit,
    strip_unit_suffix,
)


class Part(FrozenModel):
    wall_m: Length
    pressure_max_pa: Pressure = 0.0


@pytest.mark.parametrize(
    "written", [{"wall": "1.5 mm"}, {"wall": 0.0015}, {"wall_m": 0.0015}, {"wall_m": "1.5 mm"}]
)
def test_fields_may_be_written_with_or_without_their_unit(written):
    assert Part.model_validate(written).wall_m == pytest.approx(0.0015)


def test_canonical_form_is_si_under_full_names():
    part = Part.model_validate({"wall": "1.5 mm", "pressure_max": "15 kPa"})
    assert part.canonical() == {"wall_m": pytest.approx(0.0015), "pressure_max_pa": pytest.approx(15e3)}


@pytest.mark.parametrize("value", [True, float("nan"), float("inf"), [1], None])
def test_what_is_no_number_is_refused(value):
    with pytest.raises(ValidationError):
        Part.model_validate({"wall": value})


def test_a_suffix_names_a_unit():
    names = "wall_m shear_modulus_pa density_kg_m3 kind gravity_m_s2 angles payload_kg"
    bare = [strip_unit_suffix(name) for name in names.split()]
    assert bare == ["wall", "shear_modulus", "density", "kind", "gravity", "angles", "payload"]


class Motor(FrozenModel):
    joint_damping_n_m_s: AngularDamping = 1.0
    friction_n_m_s: float = 1.0
    rate_per_s: float = 1.0
    decay_1_per_s: Rate = 1.0
    warming_kelvin: TemperatureDifference = 1.0
    size_m: Length = 1.0
    size_n: Force = 1.0
    span: int = 1
    span_m: Length = 1.0


class SmallMotor(Motor):
    wall_m: Length = 1.0


@pytest.mark.parametrize("model", [Motor, SmallMotor])
@pytest.mark.parametrize(
    ("written", "field", "value"),
    [
        ({"joint_damping": "2 mN*m*s"}, "joint_damping_n_m_s", 2e-3),
        ({"decay": "30 1/min"}, "decay_1_per_s", 0.5),
        ({"warming": "5 K"}, "warming_kelvin", 5.0),
        ({"friction_n_m_s": 3}, "friction_n_m_s", 3.0),
        ({"rate_per_s": 3}, "rate_per_s", 3.0),
        ({"size_m": "3 mm"}, "size_m", 3e-3),
        ({"size_n": "3 mN"}, "size_n", 3e-3),
        ({"span": 4}, "span", 4),
        ({"span_m": "4 mm"}, "span_m", 4e-3),
    ],
)
def test_a_key_without_its_unit_has_one_meaning(model, written, field, value):
    assert getattr(model.model_validate(written), field) == pytest.approx(value)


@pytest.mark.parametrize("key", ["friction_n_m", "friction", "joint_damping_n_m", "rate_per", "size"])
def test_a_key_that_could_mean_another_unit_is_none(key):
    with pytest.raises(ValidationError):
        Motor.model_validate({key: 1})


def test_a_wrong_new_unit_is_refused():
    with pytest.raises(ValidationError, match="a moment"):
        Motor.model_validate({"joint_damping": "2 N*m"})


@pytest.mark.parametrize(
    ("field", "stem", "unit"),
    [
        ("drag_1_s", "drag_1", "s^-1"),
        ("curvature_per_rad", "curvature_per", "rad^-1"),
        ("decay_1_per_s", "decay", "s^-1"),
        ("pressure_1_pa", "pressure_1", "Pa"),
        ("tendon_travel_1_m", "tendon_travel_1", "m"),
    ],
)
def test_a_field_that_is_per_unit_says_so(field, stem, unit):
    assert split_unit(field) == (stem, unit)


def test_every_config_has_its_type_unit():
    """The unit that a study may leave out is that of the field's type, or of the effect parameter's declaration."""
    registry, wrong = discover(), []
    for component in registry.components:
        model = component.config_model()
        effect = issubclass(model, EffectConfig)
        parameters = (*model.fit_parameters(), *model.form_parameters()) if effect else ()
        declared = {one.name: one.unit for one in parameters}
        for name, info in model.model_fields.items():
            stated = {one.unit for one in quantities_in(info.annotation, *info.metadata)}
            stated |= {declared[name]} if name in declared else set()
            stated -= {"dimensionless", "1"}
            found = config_field_unit(model, name)
            if found and len(stated) == 1 and stated != {found}:
                wrong.append((component.kind, name, found, stated))
    assert wrong == []
    mujoco = registry.get("physics", "mujoco").config_model()
    assert config_field_unit(mujoco, "drag_1_s") == "s^-1"
    coefficients = nested_model(
        registry.get("surrogate", "polynomial").config_model().model_fields["coefficients"].annotation
    )
    assert coefficients is not None and config_field_unit(coefficients, "k_n") == ""
