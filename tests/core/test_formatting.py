"""Formatted numbers, quantities and display units come from one module and one table of units."""

import math
from types import SimpleNamespace

import pytest

from pliant import formatting
from pliant.formatting import (
    Unit,
    display_unit,
    listed,
    number,
    output_unit,
    percent,
    quantity,
    rounded_to_sd,
    unbroken,
    units_footer,
    whole_percent,
    with_sd,
)
from pliant.records.law import EXTENSION
from pliant.store.fingerprint import code_closure

NAN = math.nan


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (12.3456, 3, "12.3"),
        (1234.56, 3, "1235"),
        (-0.5, 4, "−0.5"),
        (0.0, 4, "0"),
        (1e-25, 4, "0"),
        (2.5e-7, 4, "2.5·10⁻⁷"),
        (3e9, 1, "3·10⁹"),
        (NAN, 4, "–"),
        (None, 4, "–"),
        (True, 4, "yes"),
        (1234567, 3, "1234567"),
    ],
)
def test_numbers_have_the_asked_digits_and_no_riddle(value, digits, text):
    assert number(value, digits) == text


@pytest.mark.parametrize(
    ("name", "axis", "shown"),
    [
        ("tip_x_m", "tip x (mm)", "250 mm"),
        ("angle_rad", "bend angle (°)", "14.3°"),
        ("joint_2_angle_rad", "joint 2 angle (°)", "14.3°"),
        ("moment_n_m", "moment (mN·m)", "250 mN·m"),
        ("pressure_pa_s", "pressure (kPa/s)", "0.00025 kPa/s"),
        ("elongation_strain", "elongation (%)", "25 %"),
        ("tendon_travel_m", "tendon travel (mm)", "250 mm"),
        ("temperature_c", "temperature (°C)", "0.25 °C"),
        ("cycle", "cycle", "0.25"),
    ],
)
def test_a_columns_suffix_decides_its_display_unit(name, axis, shown):
    assert output_unit(name).axis == axis
    assert output_unit(name).text(0.25, 3) == shown


def test_quantities_keep_words_and_switches():
    assert [quantity(v, "m") for v in ("egg", True, None)] == ["egg", "True", "None"]
    assert (quantity(0.007, "m"), quantity(4, ""), quantity(9.81, "m/s^2")) == ("7 mm", "4", "9.81 m/s²")


def test_a_value_is_as_sure_as_its_standard_deviation():
    assert rounded_to_sd(0.2, 0.012) == "0.200"
    assert with_sd(212.3, 4.1, display_unit("Pa")) == "0.2123 ± 0.0041 kPa"
    assert with_sd(212.3, NAN, display_unit("Pa")) == "0.212 kPa"
    assert with_sd(3450.0, 120.0, Unit("")) == "3450 ± 120"
    assert with_sd(1e-9, 1.0, Unit("N")) == "1.0·10⁻⁹ ± 1 N"


def test_shares_and_lists():
    assert [percent(s) for s in (0.00173, 1e-7, 0.0)] == ["0.17 %", "less than 0.0001 %", "0 %"]
    assert [whole_percent(s) for s in (0.004, 0.5, 0.0)] == ["less than 1 %", "50 %", "0 %"]
    assert (listed(["a", "b", "c"]), listed(["a"]), listed([])) == ("a, b and c", "a", "")


def test_no_line_breaks_before_a_unit():
    assert unbroken("at 15 kPa and 3 mN·m of 2 gaps") == "at 15\u00a0kPa and 3\u00a0mN·m of 2 gaps"


def test_a_display_unit_changes_in_one_place(monkeypatch):
    """Quantities, columns, footers and line breaks follow it; pages and terminal: tests/cli/test_fit_table.py."""

    class Law:
        joint = "revolute"

    monkeypatch.setitem(formatting.DISPLAY, "N*m", Unit("N·cm", 100.0))
    assert output_unit("moment_n_m").text(0.25) == "25 N·cm"
    assert formatting.effort_unit(Law()).text(0.25) == "25 N·cm"
    assert quantity(0.25, "N*m") == "25 N·cm"
    assert display_unit("N*m/s").text(0.25) == "25 N·cm/s"
    assert units_footer(moments="N*m", angles="rad") == "Moments in N·cm, angles in degrees"
    assert unbroken("25 N·cm") == "25\u00a0N·cm"


def test_a_page_is_made_anew_when_the_formatting_changes_and_a_solved_state_is_not():
    assert "pliant.formatting" not in code_closure(["pliant.report.fit_page"])
    assert "pliant.formatting" in code_closure(["pliant.report.fit_page", "pliant.formatting"])


@pytest.mark.parametrize(
    ("joint", "axis", "units"),
    [
        ("revolute", "", ("°", "mN·m")),
        ("prismatic", "", ("mm", "N")),
        ("extensible", "y", ("°", "mN·m")),
        ("extensible", "e", ("mm", "N")),
    ],
)
def test_the_travel_in_a_joint_that_turns_has_separate_units(joint, axis, units):
    law = SimpleNamespace(joint=joint)
    found = formatting.deformation_unit(law, axis), formatting.effort_unit(law, axis)
    assert tuple(unit.symbol for unit in found) == units


def test_a_travel_axis_has_one_name():
    assert formatting.TRAVEL == EXTENSION
