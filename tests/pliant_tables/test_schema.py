"""A typed schema per use, and the parts of a new kind of table: a schema, a reader, and checks of its numbers."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from pliant_tables.errors import UserError
from pliant_tables.opening import open_sheet
from pliant_tables.schema import Known, Schema, read_columns

THERMAL = Schema(
    (
        Known("temperature", "_c", "degC", "input"),
        Known("shear_modulus", "_pa", "Pa", "output"),
        Known("specimen", "", "", "text"),
    ),
    "temperature_c,shear_modulus_pa",
)


@dataclass(frozen=True, eq=False)
class ThermalCurve:
    """Shear modulus (n,) in Pa over temperature (n,) in °C, as a thermal effect would need it."""

    temperature_c: np.ndarray
    shear_modulus_pa: np.ndarray


def read_thermal_curve(path: Path) -> ThermalCurve:
    with open_sheet(path, THERMAL.example) as sheet:
        columns = THERMAL.matched(path, sheet.header)
        if missing := [name for name in THERMAL.example.split(",") if name not in columns]:
            raise UserError(f"{path}, line {sheet.header_line}: column '{missing[0]}' is missing.")
        rows = read_columns(sheet, columns)
    for line in rows.lines[~(rows.numbers["shear_modulus_pa"] > 0)].tolist():
        sheet.problems.add(line, "column shear_modulus_pa: it must be above 0")
    sheet.problems.raise_if_any()
    return ThermalCurve(rows.numbers["temperature_c"], rows.numbers["shear_modulus_pa"])


def test_a_new_table_kind_reads_units_separators_and_shifts(tmp_path):
    path = tmp_path / "rubber.csv"
    path.write_text("specimen;temperature (K);shear_modulus_kpa\nA;293,15;240\nA;313,15;221,5\n", "utf-16")
    found = read_thermal_curve(path)
    assert np.allclose(found.temperature_c, [20, 40]) and np.allclose(
        found.shear_modulus_pa, [240e3, 221.5e3]
    )


@pytest.mark.parametrize(
    ("content", "places"),
    [
        ("temperature_c,modulus\n20,1\n", ("line 1", "shear_modulus_pa")),
        ("temperature_c,shear_modulus_pa\n20,240000\n30,-1\n", ("line 3", "shear_modulus_pa")),
        ("temperature_c,shear_modulus_pa\n20,x\n", ("line 2", "shear_modulus_pa")),
        ("temperature_c,temperature_k,shear_modulus_pa\n20,1,1\n", ("temperature_k",)),
        ("temperature_c [bar],shear_modulus_pa\n20,1\n", ("temperature_c [bar]",)),
    ],
)
def test_its_mistakes_are_told_with_file_row_and_column(tmp_path, content, places):
    path = tmp_path / "rubber.csv"
    path.write_text(content)
    with pytest.raises(UserError) as caught:
        read_thermal_curve(path)
    assert all(place in str(caught.value) for place in places)
