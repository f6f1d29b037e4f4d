"""Written quantities: numbers with a unit."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pliant_tables import quantities
from pliant_tables.quantities import COMMON, EXAMPLES, UnitError, parse_quantity

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
def test_common_units_equal_those_in_pint_to_the_last_bit(unit, number):
    registry = quantities._pint()
    for name in COMMON[unit]:
        written = registry.parse_units(name.replace("%", "percent"))
        assert parse_quantity(f"{number!r} {name}", unit) == registry.Quantity(number, written).to(unit).m


def test_common_units_with_another_kind_are_refused_as_pint_refuses_them(monkeypatch):
    texts = [f"2 {name}" for names in COMMON.values() for name in names if name != "%"]

    def answer(text, unit):
        try:
            return parse_quantity(text, unit)
        except UnitError as error:
            return str(error)

    quick = {(text, unit): answer(text, unit) for text in texts for unit in COMMON}
    monkeypatch.setattr(quantities, "COMMON", {})
    assert quick == {(text, unit): answer(text, unit) for text, unit in quick}
    assert "is a length" in quick["2 mm", "Pa"]


@given(text=st.text(max_size=20), unit=st.sampled_from(sorted(EXAMPLES)))
def test_any_text_is_a_number_or_a_sentence(text, unit):
    try:
        assert isinstance(parse_quantity(text, unit), float)
    except UnitError as error:
        assert EXAMPLES[unit] in str(error)


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
