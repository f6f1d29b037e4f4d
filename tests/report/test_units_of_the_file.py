"""Documents show the units of the input file, on terminal and page alike; JSON keeps SI."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis.quick import REGISTRY, effect, joint, make_predictor, measured, poor
from tests.report.pages import words

from pliant.cli.session import plain
from pliant.diagnosis.diagnosis import diagnose
from pliant.evidence.comparison import compare
from pliant.formatting import Unit, display_unit, displayed_in, output_unit
from pliant.measurements.written_units import units_as_written
from pliant.report.comparison import comparison_document
from pliant.report.diagnosis import diagnosis_document
from pliant.report.document import Document
from pliant.report.render import page, terminal
from pliant.report.run import metric_lines

CHAIN = joint(gravity=(0, 0, 0))
SI = replace(measured(CHAIN, poor(3), effect("stiffness", factor=1.15)), source="old.csv")
PLAIN = ("time_s", "pressure_pa", "angle_rad")


def headed(*headings):
    """Return the measurement as if its file had these headings, each with its unit."""
    units = [re.search(r"[\[(](.*)[\])]", heading) for heading in headings]
    written = [found[1] if found else si for found, si in zip(units, ("s", "Pa", "rad"), strict=True)]
    return replace(
        SI,
        written=dict(zip(PLAIN, written, strict=True)),
        headed=dict(zip(PLAIN, headings, strict=True)),
    )


def documents(measurement):
    with displayed_in(units_as_written(measurement)):
        predictor = make_predictor(CHAIN, measurement)
        predicted = predictor.predict()
        found = diagnose(predictor, kinds=("stiffness", "backlash", "sensor_lag"))
        yield comparison_document("f", measurement, predicted, compare(measurement, predicted))
        yield diagnosis_document("f", measurement, found, REGISTRY)


def said(document):
    """Return all text for people: the terminal's lines and tables, and the page's words."""
    blocks = [block if isinstance(block, str) else [*block.columns] for block in terminal(document)]
    cells = [
        text
        for block in blocks
        for column in (block if isinstance(block, list) else ())
        for text in (column.header, *column.cells)
    ]
    return "\n".join([*(b for b in blocks if isinstance(b, str)), *cells, words(page(document).html)])


def numbers(value):
    """Return the numbers of a JSON value, in order."""
    if isinstance(value, dict):
        return [n for key in value if key != "wall_s" for n in numbers(value[key])]
    if isinstance(value, list):
        return [n for item in value for n in numbers(item)]
    return [value] if isinstance(value, float) else []


@pytest.fixture(scope="module")
def usual():
    return list(documents(headed("time_s", "pressure_pa", "angle_rad")))


def test_a_file_in_mbar_ms_and_radians_is_shown_in_them(usual):
    own = headed("Zeit [ms]", "Druck (mbar)", "Winkel [rad]")
    for document, before in zip(documents(own), usual, strict=True):
        text = said(document)
        assert not re.search(r"kPa|\dPa|°|\d s\b|\(s\)", text), document.kind
        assert "rad" in text and ("mbar" in text or "which effect" in document.kind)
        np.testing.assert_allclose(
            numbers(json.loads(json.dumps(plain(document.data)))),
            numbers(json.loads(json.dumps(plain(before.data)))),
            rtol=1e-9,
        )


@pytest.mark.slow
def test_a_file_with_pliant_names_is_shown_unchanged(usual):
    assert units_as_written(headed("time_s", "pressure_pa", "angle_rad")) == {}
    for document in usual:
        text = said(document)
        assert "°" in text and "mbar" not in text
        assert "kPa" in text or "which effect" in document.kind
        assert document.units == {}


def test_what_is_drawn_later_has_its_document_units():
    with displayed_in({"Pa": Unit("bar", 1e-5)}):
        document = Document("k", "t", "s.")
    assert "pressures in bar" in page(document).html
    assert display_unit("Pa").symbol == "kPa"  # no state remains


def test_a_name_goes_before_its_unit_and_rates_follow():
    with displayed_in({"angle_rad": Unit("rad"), "rad": Unit("mrad", 1e3), "Pa": Unit("mbar", 1e-2)}):
        assert output_unit("angle_rad").text(0.5) == "0.5 rad"
        assert output_unit("base_roll_rad").text(0.5) == "500 mrad"
        assert output_unit("pressure_pa_s").text(600.0) == "6 mbar/s"


@pytest.mark.parametrize(
    ("heading", "unit", "shown"),
    [("T [K]", "K", "°C"), ("temperature_c", "degC", "°C"), ("T [degF]", "degF", "°C")],
)
def test_units_with_another_zero_stay_in_the_usual_one(heading, unit, shown):
    measurement = replace(SI, written={"temperature_c": unit}, headed={"temperature_c": heading})
    with displayed_in(units_as_written(measurement)):
        assert output_unit("temperature_c").symbol == shown


def test_metrics_on_the_terminal_are_in_display_units():
    assert metric_lines({"bend_angle_rad": 2.59521, "loads_kg": [0.01, 0.02], "n": 3}) == [
        "  bend_angle               148.695°",
        "  loads                    10 g, 20 g",
        "  n                        3",
    ]
