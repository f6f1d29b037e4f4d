"""The units and headings of the file that was read, for display in the terminal, on pages and in files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pliant.config.measurements import MeasurementNotes
from pliant.errors import UserError
from pliant.formatting import DISPLAY, Unit
from pliant.measurements.columns import MEASUREMENT, column_si_unit, with_zero
from pliant.records.measurement import Measurement
from pliant.units import split_unit
from pliant_tables.units import conversion, fits, unit_at_the_end, unit_in

SYMBOLS = {
    "deg": "°",
    "degC": "°C",
    "m^-1": "1/m",
    "mm^-1": "1/mm",
    "um": "µm",
    "us": "µs",
    "percent": "%",
    "dimensionless": "",
    "strain": "",
}


def units_as_written(measurement: Measurement) -> Mapping[str, Unit]:
    """Return the display units of a measurement: names of columns, and SI units, → the unit in its file.

    A column counts if its unit is not the SI one, or its heading states the unit. One with Pliant's own name as heading
    ("pressure_pa") keeps the default display (in kPa), and so do units with another zero (K for °C).
    """
    found: dict[str, Unit] = {}
    for name, text in measurement.written.items():
        if (
            name.startswith("sigma_")
            or not (si := column_si_unit(name))
            or not _said(measurement, name, text, si)
        ):
            continue
        if not fits(text, si) or text[:1].isdigit():  # a clock of dates or frames; steps of a motor
            continue
        scale, shift = conversion(text, si, f"column '{name}'")
        if shift or not scale > 0:
            continue
        symbol = SYMBOLS.get(text, text.replace("*", "·"))
        usual = DISPLAY.get(si)
        unit = usual if usual is not None and usual.symbol == symbol else Unit(symbol, 1 / scale)
        found[name] = unit
        if si != "dimensionless":  # a strain in percent does not change other dimensionless numbers
            found.setdefault(si, unit)
    return found


def _said(measurement: Measurement, name: str, text: str, si: str) -> bool:
    heading = measurement.headed.get(name, name)
    return heading != name and (text != si or bool(unit_in(heading) or unit_at_the_end(heading)))


def column_as_written(
    name: str, measurement: Measurement | None, notes: MeasurementNotes
) -> tuple[str, float, float]:
    """Return the heading of a column in a file for the laboratory, and scale and shift from its unit to SI.

    This is the heading of the file that was read, or Pliant's stem with the unit that the file uses for such quantities
    ("moment [mN*m]"); Pliant's own name if the reader would not recognise the other one.

    Args:
        name: Pliant's name of the column.
        measurement: what was read; its headings and units.
        notes: the study's renames and units, by which the file will be read.
    """
    renamed = [written for written, kept in notes.rename.items() if kept == name]
    headings = list(renamed)
    if measurement is not None:
        si = column_si_unit(name)
        same = [text for other, text in measurement.written.items() if si and column_si_unit(other) == si]
        text = measurement.written.get(name) or next(iter(same), "")
        if name in measurement.headed:
            headings.insert(0, measurement.headed[name])
        if text and text != si:
            headings.append(f"{split_unit(name)[0]} [{text}]")
    for heading in (*headings, name):
        try:
            column = MEASUREMENT.matched(Path(), [heading], notes).get(name)
        except UserError:
            continue
        if column is not None:
            column = with_zero(column, notes, "the study")
            return heading, column.scale, column.shift
    return name, 1.0, 0.0
