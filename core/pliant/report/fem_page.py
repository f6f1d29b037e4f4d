"""The page of `pliant fem`: the data set alone, self-contained."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant import __version__
from pliant.formatting import actuation_unit, deformation_unit, fixed, percent, units_of_page
from pliant.records.fem import ModuleData
from pliant.report.document import Picture, Section
from pliant.report.facts import input_table, provenance_table
from pliant.report.fem_reading import axis_record
from pliant.report.fem_section import Solved, data_sections, shape_section
from pliant.report.folder import FinishedRun
from pliant.report.template import page_template
from pliant.report.words import data_warnings


def render_fem(
    study: Mapping[str, Any], designs: Sequence[Solved], provenance: Sequence[Mapping[str, Any]]
) -> str:
    """The page as HTML with its pictures inside. The same data give the same bytes."""
    named = [(d.name, d.data.axis(d.data.main_axis)) for d in designs]
    hero, *rest = data_sections(designs)
    first, *others = hero.pictures
    shapes = shape_section(named)
    sections = [*([shapes] if shapes else []), _without(hero, others), *rest]
    page = FinishedRun({}, study, (), (), tuple(provenance))
    sections.append(Section("Inputs", tables=(input_table(page),)))
    if provenance:
        sections.append(Section("Provenance", tables=(provenance_table(page),)))
    several = len(designs) > 1
    warned = [w for d in designs for w in data_warnings(d.data, f"{d.name}: " if several else "")]
    text: str = page_template().render(
        title=str(study.get("name", "Pliant FEM data")),
        kind="Pliant FEM data",
        sentence=" ".join(_sentence(d, several) for d in designs[:3]),
        hero=Picture(first.name, first.caption, first.png),
        warnings=warned,
        sections=sections,
        version=provenance[0].get("pliant", __version__) if provenance else __version__,
        footer=units_of_page(pressures="Pa", forces="N", moments="N*m", angles="rad", extensions="m"),
    )
    return text


def free_reach(data: ModuleData) -> str:
    """How far the free branch goes, e.g. ``bends 23.1° at 15 kPa``; empty without one."""
    main = data.axis(data.main_axis)
    free = main.branch == "free"
    if not free.any():
        return ""
    last = int(np.argmax(np.where(free, main.actuation, -np.inf)))
    unit, given = deformation_unit(data), actuation_unit(data.actuation_name)
    verb = "extends by" if data.joint == "prismatic" else "bends"
    u = fixed(float(main.angle_rad[last]) * unit.factor, 2)
    return f"{verb} {unit.attached(u)} at {given.text(float(main.actuation[last]))}"


def _sentence(design: Solved, named: bool) -> str:
    """Free deformation, number of states, whether the stated error was reached."""
    data = design.data
    record = axis_record(data, data.main_axis)
    parts = [f"the free module {free_reach(data)}", f"{len(data)} states"]
    if record.get("stated_error") is not None:
        word = (
            "reached" if record.get("reached") else f"NOT reached (wanted {percent(float(record['error']))})"
        )
        parts.append(f"stated error {percent(float(record['stated_error']))} of the effort's range, {word}")
    text = "; ".join(parts) + "."
    return f"{design.name}: {text}" if named else text[0].upper() + text[1:]


def _without(section: Section, pictures: Sequence[Picture]) -> Section:
    return Section(section.title, tuple(pictures), section.tables, section.note, section.text)
