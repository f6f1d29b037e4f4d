"""Reference pages of what plugins are made with: records, meshing helpers, units, the fields of a component."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, get_args

from pliant import units
from pliant.registry.component import Component

# By page, which modules it shows and what they hold.
RECORDS = {
    "fem": "what a family hands to an FEM backend, and what comes back",
    "design": "a design, masses of a module",
    "law": "the joint law",
    "shape": "what of a module collides and is drawn",
    "structure": "a body of several modules",
    "chain": "a chain of modules",
    "term": "what effects add to a law",
    "rollout": "inputs and results of an engine",
    "scene": "objects beside a chain",
}
MESHING = ("grids", "hexahedra", "tetrahedra", "cells", "raising", "piece", "stacking", "masses", "surfaces")
PUBLIC = (
    "Public in the sense of [the plugin contract](../plugin_contract.md#what-is-public). "
    "Frozen: `dataclasses.replace` makes a changed one."
)


def pages(folder: Path, markdown: Callable[[str], str]) -> dict[Path, str]:
    """Path → text of each page; `markdown` turns a docstring into it."""
    return {
        folder / "records.md": _records(markdown),
        folder / "meshing.md": _meshing(markdown),
        folder / "plugin_basics.md": _basics(markdown),
    }


def _records(markdown: Callable[[str], str]) -> str:
    lines = ["# Records for plugins", "", f"What stages and plugins hand to each other. {PUBLIC}", ""]
    for name, what in RECORDS.items():
        module = importlib.import_module(f"pliant.records.{name}")
        lines += [f"## `pliant.records.{name}`: {what}", ""]
        for cls in _own(module, inspect.isclass):
            if dataclasses.is_dataclass(cls):
                lines += [
                    f"### {cls.__name__}",
                    "",
                    markdown(inspect.getdoc(cls) or ""),
                    "",
                    *_fields(cls),
                    "",
                ]
    return "\n".join(lines).rstrip() + "\n"


def _meshing(markdown: Callable[[str], str]) -> str:
    lines = [
        "# Families and their meshes",
        "",
        "What a family may be made with: the inequalities of its designs and a base for modules of which a quarter is "
        "solved (`pliant.families`); blocks of hexahedra from lattice lines (`grids`), holes in them, boundary faces, "
        "other cells, masses and skins of the result. Families that ship are the examples: "
        "[write a plugin](../write_a_plugin.md).",
        "",
    ]
    for name in ("families", *(f"meshing.{room}" for room in MESHING)):
        module = importlib.import_module(f"pliant.{name}")
        lines += [f"## `pliant.{name}`", "", markdown(inspect.getdoc(module) or ""), ""]
        for cls in _own(module, inspect.isclass) if name == "families" else ():
            lines += [f"### {cls.__name__}", "", markdown(inspect.getdoc(cls) or ""), ""]
        for function in _own(module, inspect.isfunction):
            signature = str(inspect.signature(function)).replace("'", "")
            lines += [
                f"### `{function.__name__}{signature}`",
                "",
                markdown(inspect.getdoc(function) or ""),
                "",
            ]
    return "\n".join(lines).rstrip() + "\n"


def _basics(markdown: Callable[[str], str]) -> str:
    lines = [
        "# Units, fields of a component",
        "",
        "## Units of a config's fields",
        "",
        "A field of `pliant.units` takes a number in SI or a text with a unit, and holds SI. Its name ends in the "
        "unit; users write it without: `wall_m: Length` is the key `wall`, `wall: 1.5 mm`. A pure number has no "
        "ending.",
        "",
        "| type | SI unit | a name ends in | example |",
        "|---|---|---|---|",
    ]
    suffix_of = {unit: suffix for suffix, unit in units.UNIT_SUFFIXES.items()}
    for name, kind in vars(units).items():
        found = [part for part in get_args(kind) if isinstance(part, units.Quantity)]
        if found and not name.startswith("_"):
            unit = found[0].unit
            ending = f"`{suffix_of[unit]}`" if unit in suffix_of else ""
            lines.append(f"| `{name}` | {unit} | {ending} | `{units.EXAMPLES.get(unit, '1 ' + unit)}` |")
    endings = ", ".join(f"`{suffix}` ({unit})" for suffix, unit in units.UNIT_SUFFIXES.items())
    lines += ["", f"All endings: {endings}.", "", "## Component", ""]
    lines += [
        "A manifest's entry, `pliant.registry.component.Component`; the hook `pliant_components` returns a list.",
        "",
    ]
    lines += [markdown(inspect.getdoc(Component) or ""), "", *_fields(Component), ""]
    return "\n".join(lines).rstrip() + "\n"


def _own(module: ModuleType, wanted: Callable[[Any], bool]) -> Iterator[Any]:
    """Public classes or functions that a module defines, in its order."""
    for name, value in vars(module).items():
        if wanted(value) and value.__module__ == module.__name__ and not name.startswith("_"):
            yield value


def _fields(cls: type[Any]) -> list[str]:
    """A table of a dataclass's fields: type and default."""
    rows = ["| field | type | default |", "|---|---|---|"]
    for one in dataclasses.fields(cls):
        kind = str(one.type).replace("|", "\\|")
        rows.append(f"| `{one.name}` | {kind} | {_default(one)} |")
    return rows


def _default(one: dataclasses.Field[Any]) -> str:
    if one.default is not dataclasses.MISSING:
        return f"`{one.default!r}`" if not re.search(r"[|<]", repr(one.default)) else "given"
    return "required" if one.default_factory is dataclasses.MISSING else "empty"
