"""Check of constants of a study's family and material on which its laws do not depend.

A law that was fitted to a table, or that a study states, is that of one module and rubber. Constants in the table's
columns are compared with the study and refused if they differ; other constants only affect lengths and weights.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pliant.config.design_parameters import MATERIAL, design_parameters, same_value, shown, study_key
from pliant.errors import PliantError, UserError
from pliant.fem_tables.reading import read_labelled_designs
from pliant.interfaces.family import FamilyConfig
from pliant.interfaces.material import MaterialConfig
from pliant.interfaces.surrogate import Surrogate


def unread_by_law(surrogate: Surrogate, family: FamilyConfig, material: MaterialConfig | None) -> str:
    """Return a sentence about constants on which a law without FEM does not depend; "" if all are checked.

    Raises:
        UserError: a table and the study state different values.
    """
    tables = list(dict.fromkeys(surrogate.tables().values()))
    if not tables:
        names = [name for name in design_parameters(family, material) if name != f"{MATERIAL}kind"]
        return unread_sentence(names, family, material, "")
    stated: dict[str, Any] = {}
    for path in tables:
        stated |= (columns := _read_design_constants(path))
        _refuse_others(columns, path, family, material)
    unread = [name for name in design_parameters(family, material) if name not in stated]
    return unread_sentence(unread, family, material, tables[0].name)


def _read_design_constants(path: Path) -> dict[str, Any]:
    """Return the constants that a table of one design states; empty if it cannot be read as such."""
    try:
        found = read_labelled_designs(path)
    except PliantError:
        return {}
    return dict(found[0][1].design.parameters) if len(found) == 1 else {}


def _refuse_others(
    stated: Mapping[str, Any], path: Path, family: FamilyConfig, material: MaterialConfig | None
) -> None:
    own = design_parameters(family, material)
    for name, value in stated.items():
        if own.get(name) is None or same_value(own[name], value):
            continue
        raise UserError(
            f"{study_key(name, family, material)} is {shown(name, own[name])}, and the module of {path} has "
            f"{shown(name, value)}: its law is that of another module. Use that value, or solve FEM of this one."
        )


def unread_sentence(
    names: list[str], family: FamilyConfig, material: MaterialConfig | None, source: str
) -> str:
    """Return a sentence about constants that no column of `source` states; "" for none."""
    keys = [study_key(name, family, material) for name in names if name not in (f"{MATERIAL}kind",)]
    if not keys:
        return ""
    listed = ", ".join(keys)
    if not source:
        return f"The law is stated by the study and does not depend on {listed}: these change lengths and weight alone."
    columns = ", ".join(name for name in names if name != f"{MATERIAL}kind")
    return (
        f"The law does not depend on {listed}: {source} has no column for them, and holds what it was solved with. "
        f"Add the column{'s' if ',' in columns else ''} {columns} to have them compared."
    )
