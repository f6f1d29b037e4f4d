"""Quantities at the boundary."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from pliant import units
from pliant.interfaces.base import FrozenModel
from pliant.units import COMMON, EXAMPLES, Length, Pressure, UnitError, parse_quantity, strip_unit_suffix

FACTORS = {
    ("mm", "m"): 1e-3,
    ("cm", "m"): 1e-2,
    ("m", "m"): 1.0,
    ("kPa", "Pa"): 1e3,
    ("MPa", "Pa"): 1e6,
    ("bar", "Pa"): 1e5,
    ("g", "kg"): 1e-3,
    ("deg", "rad"): math.pi / 180,
    ("mN*m", "N*m"): 1e-3,
    ("%", "dimensionless"): 1e-2,
    ("kg/m^3", "kg/m^3"): 1.0,
    ("g/cm^3", "kg/m^3"): 1e3,
    ("m/s^2", "m/s^2"): 1.0,
}


class Part(FrozenModel):
    wall_m: Length
    pressure_max_pa: Pressure = 0.0


@given(
    number=st.floats(-1e6, 1e6, allow_nan=False),
    units=st.sampled_from(sorted(FACTORS)),
    space=st.sampled_from(["", " ", "  "]),
)
def test_number_and_unit_give_the_number_times_the_factor(number, units, space):
    written, unit = units
    value = parse_quantity(f"{number!r}{space}{written}", unit)
    assert value == pytest.approx(number * FACTORS[units], rel=1e-12, abs=1e-300)


@pytest.mark.parametrize("unit", COMMON)
@given(number=st.floats(-1e6, 1e6, allow_nan=False))
def test_common_units_are_to_the_last_bit_those_of_pint(unit, number):
    registry = units._pint()
    for name in COMMON[unit]:
        written = registry.parse_units(name.replace("%", "percent"))
        assert parse_quantity(f"{number!r} {name}", unit) == registry.Quantity(number, written).to(unit).m


def test_common_units_of_another_kind_are_refused_as_pint_refuses_them(monkeypatch):
    texts = [f"2 {name}" for names in COMMON.values() for name in names if name != "%"]

    def answer(text, unit):
        try:
            return parse_quantity(text, unit)
        except UnitError as error:
            return str(error)

    quick = {(text, unit): answer(text, unit) for text in texts for unit in COMMON}
    monkeypatch.setattr(units, "COMMON", {})
    assert quick == {(text, unit): answer(text, unit) for text, unit in quick}
    assert "is a length" in quick["2 mm", "Pa"]


@given(text=st.text(max_size=20), unit=st.sampled_from(sorted(EXAMPLES)))
def test_any_text_is_a_number_or_a_sentence(text, unit):
    try:
        assert isinstance(parse_quantity(text, unit), float)
    except UnitError as error:
        assert EXAMPLES[unit] in str(error)


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


@pytest.mark.parametrize(
    ("text", "unit", "words"),
    [
        ("35 kPa", "m", "is a pressure or modulus; it needs a length such as '1.5 mm'"),
        ("3 blorps", "m", "unknown unit 'blorps'"),
        *((text, "m", "is not a quantity") for text in ("mm", "", "__import__('os')", "1 (2")),
    ],
)
def test_wrong_texts_say_what_is_needed(text, unit, words):
    with pytest.raises(UnitError, match=words):
        parse_quantity(text, unit)


def test_a_suffix_names_a_unit():
    names = "wall_m shear_modulus_pa density_kg_m3 kind gravity_m_s2 angles payload_kg"
    bare = [strip_unit_suffix(name) for name in names.split()]
    assert bare == ["wall", "shear_modulus", "density", "kind", "gravity", "angles", "payload"]
