"""Exports of tensile testers: loads and extensions, converted to stress and stretch by the sizes of the strip.

Instron Bluehill ("Time,Extension,Load" above "(s),(mm),(N)"), Zwick testXpert ("Standardweg;Standardkraft"), MTS
("Crosshead mm", "Axial Force"), Shimadzu ("Stroke", "Force"): load in N or kN, extension in mm, and often a strain or
a stress that the tester computed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Protocol

from pliant_tables.cells import MISSING
from pliant_tables.errors import UserError
from pliant_tables.proposals import plain_words
from pliant_tables.schema import FileColumn, Role
from pliant_tables.sheet import Sheet
from pliant_tables.units import conversion, fits, unit_at_the_end, unit_in

LOAD = re.compile(r".*\b(load|force|kraft|last|standardkraft|prüfkraft)\b.*")
EXTENSION = re.compile(
    r".*\b(extension|displacement|travel|stroke|cross ?head|elongation|standardweg|weg|traversenweg|verlängerung|"
    r"längenänderung|dehnung|strain)\b.*"
)
# Quantities of a free curve or a recording of a robot, which a tester does not record.
ROBOT = re.compile(r".*\b(pressure|druck|tendon|cable|angle|winkel|tip|marker|payload)\b.*")


class StripSizes(Protocol):
    """Sizes of a strip at rest, SI; None where they are not known."""

    @property
    def gauge_length_m(self) -> float | None:
        """Return the length that the extension is of."""
        ...

    @property
    def section_m2(self) -> float | None:
        """Return the area of the section."""
        ...


def tester_columns(header: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the columns of loads and of extensions of a tester's export; empty for other tables."""
    named = [name for name in header if name]
    if any(ROBOT.fullmatch(plain_words(name)) for name in named):
        return [], []
    loads = [name for name in named if LOAD.fullmatch(plain_words(name)) and _in(name, "N")]
    extensions = [name for name in named if EXTENSION.fullmatch(plain_words(name)) and _in(name, "m")]
    return loads, extensions


def _in(name: str, unit: str) -> bool:
    written = unit_in(name) or unit_at_the_end(name)
    return written is not None and fits(written, unit)


def blank_columns(sheet: Sheet) -> set[str]:
    """Return the columns that are empty in the first rows: a tester exports those that it did not measure."""
    held: set[str] = set()
    for row in sheet.sample:
        cells = zip(sheet.header, row, strict=False)
        held |= {n for n, cell in cells if cell.lower() not in MISSING and cell not in sheet.marks.missing}
    return set(sheet.header) - held if sheet.sample else set()


def with_stretch_and_stress(
    sheet: Sheet,
    header: Sequence[str],
    columns: Mapping[str, FileColumn],
    notes: StripSizes,
    notes_name: str,
) -> dict[str, FileColumn]:
    """Return the columns of a tensile table, with a tester's extension as `stretch` and load as `nominal_stress_pa`.

    Raises `UserError` where a tester's export lacks the gauge length or the section, or has several such columns.
    """
    with_sizes = dict(columns)
    loads, extensions = tester_columns(header)
    strained, stressed = {"stretch", "strain"} & set(with_sizes), "nominal_stress_pa" in with_sizes
    if not loads or not (extensions or strained) or "tendon_force_n" in with_sizes:
        return with_sizes
    where = f"{sheet.path}, line {sheet.header_line}"
    needed = (
        [("gauge_length", "25 mm", "gauge length")] if not strained and notes.gauge_length_m is None else []
    )
    needed += (
        [("section", "12 mm^2", "area of its section")] if not stressed and notes.section_m2 is None else []
    )
    if needed:
        read = " and ".join(
            f"'{name}'" for name in [*(loads[:1] * (not stressed)), *(extensions[:1] * (not strained))]
        )
        sizes = " and ".join(size for _, _, size in needed)
        lines = "\n".join(
            f"{key}:   # <- of your strip at rest, e.g. {example}" for key, example, _ in needed
        )
        raise UserError(
            f"{where}: {read}: a tester's export. Stretch and stress follow by the {sizes}, which the file does not "
            f"say.\nWrite into {notes_name} beside it, with your numbers:\n{lines}"
        )
    for names, lacking, key in ((extensions, not strained, "extension"), (loads, not stressed, "load")):
        if lacking and len(names) > 1:
            raise UserError(
                f"{where}: '{names[0]}' and '{names[1]}' may both be the {key}; export one specimen a file, or "
                "delete a column."
            )
    if not strained and notes.gauge_length_m is not None:
        with_sizes.pop("extension_m", None)
        with_sizes["stretch"] = _scaled(extensions[0], "stretch", "m", notes.gauge_length_m, 1.0)
    if not stressed and notes.section_m2 is not None:
        with_sizes["nominal_stress_pa"] = _scaled(loads[0], "nominal_stress_pa", "N", notes.section_m2, 0.0)
    return with_sizes


def _scaled(written: str, name: str, unit: str, divisor: float, shift: float) -> FileColumn:
    """Return a column of the file divided by a size of the strip, as another quantity."""
    said = unit_in(written) or unit_at_the_end(written) or unit
    scale, _ = conversion(said, unit, f"column '{written}'")
    role: Role = "input" if name == "stretch" else "output"
    return FileColumn(
        written, name, role, "Pa" if unit == "N" else "dimensionless", scale / divisor, shift, said
    )


def sizes_said(notes: StripSizes) -> str:
    """Return a sentence on the conversion by the sizes of the strip."""
    parts = []
    if notes.gauge_length_m is not None:
        parts.append(f"stretch is 1 + extension over {1e3 * notes.gauge_length_m:g} mm")
    if notes.section_m2 is not None:
        parts.append(f"nominal stress is load over {1e6 * notes.section_m2:g} mm²")
    return f"By the strip's sizes: {', '.join(parts)}."
