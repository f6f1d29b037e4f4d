"""Reference pages of the building blocks of plugins: records, meshing helpers, units, the fields of a component."""

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

# The modules of each page and their contents.
RECORDS = {
    "fem": "what a family hands to an FEM backend, and what comes back",
    "design": "a design, masses of a module",
    "law": "the joint law",
    "error_bar": "how far off a law is",
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


MECHANICS = {
    "kinematics": "a chain's geometry and poses",
    "rotations": "rotation vectors, matrices, quaternions",
    "efforts": "what the laws and terms of a chain give",
    "terms": "law terms in plain Python",
    "statics": "loads, residual and stiffness of a chain",
    "relaxation": "from anywhere to an equilibrium",
    "inertia": "masses, the mass matrix, the longest step",
    "law_wrapper": "a law around another one",
    "scalar_form": "the scalar form of a law against the law",
}


def pages(
    folder: Path, markdown: Callable[[str], str], class_text: Callable[[type[Any]], list[str]]
) -> dict[Path, str]:
    """Return path → text of each page; `markdown` converts a docstring, `class_text` a class with its methods."""
    return {
        folder / "records.md": _records(markdown, class_text),
        folder / "mechanics.md": _mechanics(markdown, class_text),
        folder / "meshing.md": _meshing(markdown),
        folder / "plugin_basics.md": _basics(markdown),
    }


def _records(markdown: Callable[[str], str], class_text: Callable[[type[Any]], list[str]]) -> str:
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
                    *fields(cls),
                    "",
                ]
            else:
                lines += [f"### {cls.__name__}", "", *_below(class_text(cls)), ""]
    return "\n".join(lines).rstrip() + "\n"


def _mechanics(markdown: Callable[[str], str], class_text: Callable[[type[Any]], list[str]]) -> str:
    lines = [
        "# Mechanics of chains",
        "",
        "What an engine may be made with, in plain numpy; the engines that ship use the same.",
        "",
    ]
    for name, what in MECHANICS.items():
        module = importlib.import_module(f"pliant.mechanics.{name}")
        lines += [f"## `pliant.mechanics.{name}`: {what}", ""]
        for cls in _own(module, inspect.isclass):
            lines += [f"### {cls.__name__}", "", *_below(class_text(cls)), ""]
        lines += _functions(module, markdown)
    return "\n".join(lines).rstrip() + "\n"


def _functions(module: Any, markdown: Callable[[str], str]) -> list[str]:
    """Return the public functions of a module with their signatures and docstrings."""
    lines = []
    for function in _own(module, inspect.isfunction):
        signature = str(inspect.signature(function)).replace("'", "")
        lines += [f"### `{function.__name__}{signature}`", "", markdown(inspect.getdoc(function) or ""), ""]
    return lines


def _below(lines: list[str]) -> list[str]:
    """Return the lines with headings one level lower."""
    return [f"#{line}" if line.startswith("### ") else line for line in lines]


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
        lines += _functions(module, markdown)
    return "\n".join(lines).rstrip() + "\n"


def _basics(markdown: Callable[[str], str]) -> str:
    lines = [
        "# Units, fields of a component",
        "",
        "## Units of a config's fields",
        "",
        "A field of `pliant.units` takes a number in SI or a text with a unit, and holds SI. Its name ends in the "
        "unit; users write it without: `wall_m: Length` is the key `wall`, `wall: 1.5 mm`. A pure number has no "
        "ending. The ending stays in the key of a plain float (`rate_per_s`), and of fields that would share a key "
        "without it (`size_m` and `size_n`).",
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
    lines += [markdown(inspect.getdoc(Component) or ""), "", *fields(Component), ""]
    return "\n".join(lines).rstrip() + "\n"


def _own(module: ModuleType, wanted: Callable[[Any], bool]) -> Iterator[Any]:
    """Return public classes or functions that a module defines, in its order."""
    for name, value in vars(module).items():
        if wanted(value) and value.__module__ == module.__name__ and not name.startswith("_"):
            yield value


def fields(cls: type[Any]) -> list[str]:
    """Return a table of a dataclass's fields: type and default."""
    rows = ["| field | type | default |", "|---|---|---|"]
    for one in dataclasses.fields(cls):
        kind = str(one.type).replace("|", "\\|")
        rows.append(f"| `{one.name}` | {kind} | {_default(one)} |")
    return rows


def _default(one: dataclasses.Field[Any]) -> str:
    if one.default is not dataclasses.MISSING:
        return f"`{one.default!r}`" if not re.search(r"[|<]", repr(one.default)) else "given"
    return "required" if one.default_factory is dataclasses.MISSING else "empty"
