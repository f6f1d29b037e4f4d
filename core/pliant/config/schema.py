"""JSON schema of a study, with one alternative per installed kind, for editors and forms."""

from __future__ import annotations

from typing import Any

from pydantic.json_schema import GenerateJsonSchema, models_json_schema

from pliant import __version__
from pliant.config.study import BLOCK_LISTS, BLOCKS, Study
from pliant.errors import ContractError
from pliant.registry.component import Component
from pliant.registry.discovery import Registry


def study_schema(registry: Registry) -> dict[str, Any]:
    """JSON schema (draft 2020-12) of a study file under the installed plugins."""
    interfaces = dict.fromkeys([*BLOCKS.values(), *BLOCK_LISTS.values()])
    components = [c for i in interfaces for c in registry.of(i) if _usable(c)]
    models: list[Any] = [Study, *(c.config_model() for c in components)]
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
    for key, interface in BLOCKS.items():
        properties[key] = {"oneOf": _alternatives(by_interface, registry, interface)}
    for key, interface in BLOCK_LISTS.items():
        properties[key] = {
            "type": "array",
            "items": {"oneOf": _alternatives(by_interface, registry, interface)},
        }
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


def _usable(component: Component) -> bool:
    """Whether the config model can be imported; a broken plugin must not take the schema with it."""
    try:
        component.config_model()
    except ContractError:
        return False
    return True


def _alternatives(by_interface: dict[str, list[Any]], registry: Registry, interface: str) -> list[Any]:
    kinds = registry.kinds(interface)
    short = (
        [{"enum": kinds, "description": "the kind alone, everything else at its default"}] if kinds else []
    )
    return [*by_interface.get(interface, []), *short] or [{"type": "object"}]
