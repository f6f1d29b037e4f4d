"""A form that describes a robot: its fields are those of the installed kinds, including plugins."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from pliant.config.chain import ChainConfig
from pliant.config.study import nested_model, written_name
from pliant.config.writing import study_name_from_path
from pliant.errors import UserError
from pliant.formatting import display_unit
from pliant.interfaces.base import FrozenModel
from pliant.registry.discovery import Registry
from pliant.units import config_field_unit

WAYS = {
    "family": "one module's shape and material: its law is solved by FEM, which takes minutes",
    "law": "a joint law that is known: its coefficients",
    "data": "a table of states of one module: its law is fitted",
}
# Keys of the form besides those of a kind: the module's actuation, and the chain's keys.
DRIVES = ("pressure_max_pa", "tendon_force_max_n")
OF_CHAIN = ("modules", "module_length_m", "module_mass_kg", "payload_kg")
LEFT_OUT = ("kind", "visual", "visual_scale")
LONGEST = 200


def form(registry: Registry) -> dict[str, Any]:
    """Return the form: for each way to describe a robot its blocks, with the kinds of each and their fields."""
    families, materials = (_kinds(registry, interface) for interface in ("family", "material"))
    laws = []
    for kind in registry.kinds("surrogate"):
        model = registry.get("surrogate", kind).config_model()
        stated = "coefficients" in model.model_fields
        inner = nested_model(model.model_fields["coefficients"].annotation) if stated else None
        if inner is not None:
            laws.append(
                {
                    "kind": kind,
                    "summary": "τ = k_n p + m_a p u − b_e u − m_e u² / 2",
                    "fields": _fields(inner),
                }
            )
    fits = [
        {"kind": kind, "summary": registry.get("surrogate", kind).summary, "fields": []}
        for kind in registry.kinds("surrogate")
        if "data" in registry.get("surrogate", kind).config_model().model_fields
    ]
    solver = registry.get("fem", "skfem").config_model()
    drives = [_field(solver, name) for name in DRIVES if name in solver.model_fields]
    chain = [_field(ChainConfig, name) for name in OF_CHAIN]
    return {
        "ways": [
            {"way": "family", "words": WAYS["family"], "blocks": {"family": families, "material": materials}},
            {"way": "law", "words": WAYS["law"], "blocks": {"surrogate": laws}},
            {"way": "data", "words": WAYS["data"], "blocks": {"surrogate": fits}},
        ],
        "drives": drives,
        "chain": chain,
    }


def described(values: Mapping[str, Any], tables: Sequence[str]) -> str:
    """Return the study of a filled-in form as text; kinds and keys are checked when it is read.

    Args:
        values: `way`, `name`, `weight`, `table`, and blocks of texts by key.
        tables: names of the dropped files.

    Raises:
        UserError: an unknown way or table, or a text that is not a value.
    """
    way = str(values.get("way", ""))
    if way not in WAYS:
        raise UserError(f"a robot is described by one of {', '.join(WAYS)}, not by '{way[:LONGEST]}'.")
    blocks = {key: _block(values.get(key, {})) for key in ("family", "material", "surrogate", "fem", "chain")}
    name = study_name_from_path(Path(str(values.get("name", ""))[:LONGEST])) or "robot"
    study: dict[str, Any] = {"pliant": 1, "name": name}
    if way == "family":
        study |= {"family": blocks["family"], "material": blocks["material"]}
        study |= {"fem": {"kind": "skfem", **blocks["fem"]}, "surrogate": {"kind": "polynomial"}}
    elif way == "law":
        kind = {"kind": blocks["surrogate"].pop("kind", "polynomial")}
        study["surrogate"] = {**kind, "form": "study", "odd": True, "coefficients": blocks["surrogate"]}
    else:
        table = str(values.get("table", ""))
        if table not in tables:
            raise UserError("drop the table of the module's states first, then choose it.")
        study["surrogate"] = {"kind": blocks["surrogate"].get("kind", "polynomial"), "data": table}
    weight = {} if values.get("weight", True) else {"gravity": [0, 0, 0]}
    study |= {"chain": {**blocks["chain"], **weight}, "physics": "quasistatic"}
    lines = [f"{key}: {json.dumps(value, ensure_ascii=False)}" for key, value in study.items()]
    return "\n".join(["# Described on the evidence page.", *lines, ""])


def _block(texts: Any) -> dict[str, Any]:
    """Return the values of a block: numbers as such, everything else as text; empty values are omitted."""
    if not isinstance(texts, Mapping):
        raise UserError("a block of the form is a list of names and texts.")
    found: dict[str, Any] = {}
    for key, text in texts.items():
        said = str(text).strip()
        if len(said) > LONGEST:
            raise UserError(f"'{str(key)[:40]}' is longer than {LONGEST} characters.")
        if said:
            found[str(key)] = _number(said)
    return found


def _number(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _kinds(registry: Registry, interface: str) -> list[dict[str, Any]]:
    """Return the kinds that a form can describe, those with the fewest fields first."""
    found = [one for kind in registry.kinds(interface) if (one := _kind(registry, interface, kind))]
    return sorted(found, key=lambda one: (len(one["fields"]), one["kind"]))


def _kind(registry: Registry, interface: str, kind: str) -> dict[str, Any] | None:
    """Return a kind with its fields; None where a form cannot state what it needs, such as a file."""
    component = registry.get(interface, kind)
    model = component.config_model()
    fields = _fields(model)
    asked = {one["name"] for one in fields}
    needed = {written_name(model, name) for name, info in model.model_fields.items() if info.is_required()}
    if needed - asked - {"kind"}:
        return None
    return {"kind": kind, "summary": component.summary, "fields": fields}


def _fields(model: type[FrozenModel]) -> list[dict[str, Any]]:
    named = [name for name, info in model.model_fields.items() if name not in LEFT_OUT and _plain(info)]
    return [_field(model, name) for name in named]


def _plain(info: FieldInfo) -> bool:
    """Return whether a field is a number, a text or a choice."""
    kinds = [one for one in _parts(info.annotation) if one is not type(None)]
    return all(one in (int, float, str, bool) or get_origin(one) is Literal for one in kinds)


def _parts(annotation: Any) -> list[Any]:
    """Return the members of a union, without their annotations."""
    if get_origin(annotation) is Literal or not get_args(annotation):
        return [annotation]
    if hasattr(annotation, "__metadata__"):
        return _parts(annotation.__origin__)
    if get_origin(annotation) in (tuple, dict, list):
        return [annotation]
    return [part for one in get_args(annotation) for part in _parts(one)]


def _field(model: type[FrozenModel], name: str) -> dict[str, Any]:
    """Return one field: its key in a study, its words, its unit as an example, its default and its choices."""
    info = model.model_fields[name]
    si = config_field_unit(model, name)
    unit = display_unit(si) if si else None
    choices = [str(c) for one in _parts(info.annotation) if get_origin(one) is Literal for c in get_args(one)]
    default = None if info.is_required() else info.default
    shown = "" if default is None or not isinstance(default, int | float | str) else str(default)
    if unit is not None and isinstance(default, int | float) and not isinstance(default, bool):
        shown = f"{default * unit.factor:g} {unit.symbol}"
    return {
        "name": written_name(model, name),
        "words": info.description or "",
        "unit": "" if unit is None else unit.symbol,
        "default": shown,
        "required": info.is_required(),
        "choices": choices,
    }
