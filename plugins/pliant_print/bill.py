"""The bill of a robot: mass and volume of each material, what to mix, and the pressures of the first test."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pliant.config.study import Study

STEPS = (0.25, 0.5, 0.75, 1.0)  # of the largest pressure, for the first test
HEAD = ("item", "material", "volume_mm3", "density_kg_m3", "mass_g", "pressure_kpa", "note")
DRIVES = ("pressure_pa", "pressure_max_pa")


@dataclass(frozen=True)
class BillRow:
    """A line of the bill; what does not apply is None."""

    item: str
    material: str = ""
    volume_m3: float | None = None
    density_kg_m3: float | None = None
    pressure_pa: float | None = None
    note: str = ""

    @property
    def mass_kg(self) -> float | None:
        if self.volume_m3 is None or self.density_kg_m3 is None:
            return None
        return self.volume_m3 * self.density_kg_m3


def largest_pressure_pa(study: Study) -> float | None:
    """Return the largest pressure that the study's FEM solves or its task applies; None without one."""
    blocks = (study.block("fem"), study.block("task"))
    values = [getattr(block, name, None) for block in blocks if block is not None for name in DRIVES]
    numbers = [float(value) for value in values if isinstance(value, int | float) and value > 0]
    return max(numbers, default=None)


def pressure_rows(study: Study) -> list[BillRow]:
    """Return the steps of a leak test: from a quarter of the largest solved pressure to all of it."""
    largest = largest_pressure_pa(study)
    if largest is None:
        return []
    return [
        BillRow("test", pressure_pa=share * largest, note="hold one minute under water: no bubbles")
        for share in STEPS
    ]


def write_bill(rows: Sequence[BillRow], path: Path) -> None:
    """Write the bill as CSV."""
    with path.open("w", newline="", encoding="utf-8") as file:
        lines = csv.writer(file)
        lines.writerow(HEAD)
        for row in rows:
            lines.writerow(
                [
                    row.item,
                    row.material,
                    _cell(row.volume_m3, 1e9),
                    _cell(row.density_kg_m3, 1.0),
                    _cell(row.mass_kg, 1e3),
                    _cell(row.pressure_pa, 1e-3),
                    row.note,
                ]
            )


def as_json(row: BillRow) -> dict[str, Any]:
    """Return the row in SI."""
    return {
        "item": row.item,
        "material": row.material,
        "volume_m3": row.volume_m3,
        "density_kg_m3": row.density_kg_m3,
        "mass_kg": row.mass_kg,
        "pressure_pa": row.pressure_pa,
        "note": row.note,
    }


def _cell(value: float | None, factor: float) -> str:
    return "" if value is None else f"{factor * value:.6g}"
