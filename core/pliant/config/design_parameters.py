"""Parameters of a design on which a law depends: those of the family, and constants of the material as `material.…`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pliant.config.study import written_name
from pliant.formatting import quantity
from pliant.interfaces.family import FamilyConfig
from pliant.interfaces.material import MaterialConfig
from pliant.units import si_unit, strip_unit_suffix

MATERIAL = "material."
# The density does not change a law.
NO_PART_IN_THE_LAW = ("kind", "density_kg_m3")


def material_parameters(material: MaterialConfig) -> dict[str, Any]:
    """Return the kind of a material and its constants on which a law depends, SI, as `material.…`."""
    constants = {
        f"{MATERIAL}{name}": value
        for name, value in material.canonical().items()
        if name not in NO_PART_IN_THE_LAW and value is not None
    }
    return {f"{MATERIAL}kind": material.kind, **constants}


# Relative; two values of a parameter that differ by less are equal.
SAME = 1e-6


def design_parameters(family: FamilyConfig, material: MaterialConfig | None = None) -> dict[str, Any]:
    """Return the parameters of a design on which a law depends, SI; constants of the material as `material.…`."""
    own = {name: value for name, value in family.canonical().items() if name != "kind"}
    return own if material is None else {**own, **material_parameters(material)}


def is_number(value: Any) -> bool:
    """Return whether a parameter is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))


def same_value(one: Any, other: Any) -> bool:
    """Return whether two values of a parameter are equal up to the rounding of tables."""
    if is_number(one) and is_number(other):
        return bool(np.isclose(float(one), float(other), rtol=SAME, atol=0.0))
    return bool(one == other)


def study_key(name: str, family: FamilyConfig, material: MaterialConfig | None) -> str:
    """Return the key of a parameter in a study: `family.average_radius`, `material.shear_modulus`."""
    field, model = name.removeprefix(MATERIAL), type(material if name.startswith(MATERIAL) else family)
    return f"{'material' if name.startswith(MATERIAL) else 'family'}.{written_name(model, field)}"  # type: ignore[arg-type]


def shown(name: str, value: Any) -> str:
    """Return a value with its display unit: 7.5 mm."""
    return quantity(value, si_unit(name), 6) if is_number(value) else str(value)


def spoken(parameters: Mapping[str, Any]) -> str:
    """Return parameters as text: average radius 7.5 mm, wall 1.5 mm."""
    bare = {name: strip_unit_suffix(name).replace("_", " ") for name in parameters}
    return ", ".join(f"{bare[name]} {shown(name, value)}" for name, value in parameters.items())
