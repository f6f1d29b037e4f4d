"""Names and values of a design's parameters: those of its family, and constants of the material as `material.…`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.config.study import written_name
from pliant.errors import UserError
from pliant.formatting import quantity
from pliant.interfaces.family import FamilyConfig
from pliant.interfaces.material import MaterialConfig
from pliant.records.design import Array
from pliant.records.solved import Parameter
from pliant.units import si_unit, strip_unit_suffix

# Of the width of the range: a design on its border is inside, however its table was rounded.
ROUNDING = 1e-7
MATERIAL = "material."
# Density changes no law.
NO_PART_IN_THE_LAW = ("kind", "density_kg_m3")


def parameters_of(family: FamilyConfig) -> dict[str, Any]:
    """Parameters of a design, SI."""
    return {name: value for name, value in family.canonical().items() if name != "kind"}


def material_parameters(material: MaterialConfig) -> dict[str, Any]:
    """Constants of the material that a law depends on, SI, named `material.…`."""
    found = {
        f"{MATERIAL}{name}": value
        for name, value in material.canonical().items()
        if name not in NO_PART_IN_THE_LAW and value is not None
    }
    return {f"{MATERIAL}kind": material.kind, **found}


def is_number(value: Any) -> bool:
    """Whether a parameter is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))


def values_of(
    names: Sequence[str],
    box: Array,
    fixed: Mapping[str, Parameter],
    family: FamilyConfig,
    material: MaterialConfig | None,
    extrapolate: bool,
) -> Array:
    """(d,) values of one design for a meta-model.

    Args:
        names: its parameters.
        box: (d, 2) their range.
        fixed: what all solved designs share.
        family, material: of the design.
        extrapolate: whether it may lie outside.

    Raises:
        UserError: the design lacks a parameter, lies outside the range, or differs in a fixed one.
    """
    known = {**parameters_of(family), **(material_parameters(material) if material is not None else {})}
    for name in names:
        if not is_number(known.get(name)):
            raise UserError(
                f"the meta-model's designs differ in '{name}', and family '{family.kind}' of this study has no such "
                "number; were they of another family?"
                if not name.startswith(MATERIAL)
                else f"the meta-model's designs differ in '{name}'; give the study a 'material' block that has it."
            )
    for name, value in fixed.items():
        if name in known and not _equal(known[name], value):
            owner = "material" if name.startswith(MATERIAL) else "family"
            raise UserError(
                f"{_key(name, family, material)} is {shown(name, known[name])}, and all solved designs of the "
                f"meta-model have {shown(name, value)}; use that, or sweep '{name.removeprefix(f'{owner}.')}' too."
            )
    values = np.array([float(known[name]) for name in names])
    if not extrapolate:
        for name, value, (low, high) in zip(names, values, box, strict=True):
            slack = ROUNDING * (high - low)
            if not low - slack <= value <= high + slack:
                raise UserError(
                    f"{_key(name, family, material)} is {shown(name, value)}, outside the meta-model's range "
                    f"{shown(name, low)} to {shown(name, high)}; solve designs there, or set "
                    "meta_model.extrapolate: true to use the law all the same."
                )
    return values


def _equal(one: Any, other: Any) -> bool:
    if is_number(one) and is_number(other):
        return bool(np.isclose(float(one), float(other), rtol=1e-6, atol=0.0))
    return bool(one == other)


def _key(name: str, family: FamilyConfig, material: MaterialConfig | None) -> str:
    """A parameter as the study writes it: `family.average_radius`."""
    if name.startswith(MATERIAL):
        field = name.removeprefix(MATERIAL)
        model: Any = type(material)
        return f"material.{written_name(model, field) if field in model.model_fields else field}"
    return f"family.{written_name(type(family), name)}"


def shown(name: str, value: Any) -> str:
    """A value with its unit, as people write it: 7.5 mm."""
    return quantity(value, si_unit(name), 6) if is_number(value) else str(value)


def spoken(parameters: Mapping[str, Any]) -> str:
    """Parameters in words: average radius 7.5 mm, wall 1.5 mm."""
    return ", ".join(
        f"{strip_unit_suffix(name).replace('_', ' ')} {shown(name, value)}"
        for name, value in parameters.items()
    )
