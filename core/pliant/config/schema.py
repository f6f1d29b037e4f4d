"""JSON schema of a study, with one alternative per installed kind, for editors and forms."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pydantic import create_model
from pydantic.json_schema import GenerateJsonSchema, models_json_schema

from pliant import __version__
from pliant.config.study import Study, optional_field
from pliant.registry.block import blocks
from pliant.registry.component import Component
from pliant.registry.discovery import Registry


def study_schema(registry: Registry) -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a study file under the installed plugins.

    Plugins that `without_schema` names are left out.
    """
    every = blocks()
    registry = registry.for_model("")
    named = dict.fromkeys(block.interface for block in every.values() if block.interface)
    components = [c for i in named for c in registry.by_interface(i) if _usable(c)]
    registry = replace(registry, components=tuple(components))
    added: dict[str, Any] = {
        key: optional_field(block) for key, block in every.items() if key not in Study.model_fields
    }
    study = create_model(Study.__name__, __base__=Study, **added) if added else Study
    models: list[Any] = [study, *(c.config_model() for c in components)]
    references, top = models_json_schema(
        [(model, "validation") for model in models],
        schema_generator=GenerateJsonSchema,
        ref_template="#/$defs/{model}",
    )
    schema: dict[str, Any] = dict(top["$defs"].pop(Study.__name__))
    by_interface: dict[str, list[Any]] = {}
    for component, model in zip(components, models[1:], strict=True):
        by_interface.setdefault(component.interface, []).append(references[model, "validation"])
    properties = schema["properties"]
    for key, block in every.items():
        if block.interface:
            # An effect of one name may be of several kinds of models.
            which = "anyOf" if block.interface == "effect" else "oneOf"
            one = {which: _alternatives(by_interface, registry, block.interface)}
            properties[key] = {"type": "array", "items": one} if block.many else one
    if "RegionMaterials" in top["$defs"]:
        top["$defs"]["RegionMaterials"] |= {
            "additionalProperties": {"oneOf": by_interface.get("material", [])},
        }
    properties["extends"] = {
        "description": "another study to start from; values_sha256 tells whether it has changed since",
        "oneOf": [
            {"type": "string"},
            {
                "type": "object",
                "properties": {"file": {"type": "string"}, "values_sha256": {"type": "string"}},
                "required": ["file"],
                "additionalProperties": False,
            },
        ],
    }
    schema |= {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"Pliant study (Pliant {__version__})",
        "$defs": top["$defs"],
    }
    # A study that extends another may leave out anything.
    schema.pop("required", None)
    return schema


def without_schema(registry: Registry) -> list[str]:
    """Return the names, as in messages, of the plugins whose config has no JSON schema."""
    return [component.origin for component in registry.components if not _usable(component)]


def _usable(component: Component) -> bool:
    """Return whether a JSON schema can be made of the config; a broken plugin must not prevent the schema."""
    if component.shipped:
        return True
    try:
        component.config_model().model_json_schema()
    except Exception:  # an error of pydantic, or of the plugin's own schema
        return False
    return True


def _alternatives(by_interface: dict[str, list[Any]], registry: Registry, interface: str) -> list[Any]:
    kinds = list(dict.fromkeys(registry.kinds(interface)))
    short = (
        [{"enum": kinds, "description": "the kind alone, everything else at its default"}] if kinds else []
    )
    return [*by_interface.get(interface, []), *short] or [{"type": "object"}]
