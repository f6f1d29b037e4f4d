"""A search's space as JSON values, for the state of an optimizer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from pliant.interfaces.optimizer import Context, Space, Variable


def space_as_json(space: Space) -> dict[str, Any]:
    """The space as dicts, lists, numbers and texts."""
    return {
        "variables": [{**asdict(v), "choices": list(v.choices)} for v in space.variables],
        "objectives": space.objectives,
        "contexts": [{"name": c.name, "features": list(c.features)} for c in space.contexts],
        "start": dict(space.start),
    }


def space_from_json(values: Mapping[str, Any]) -> Space:
    """The space that `space_as_json` wrote."""
    return Space(
        variables=tuple(Variable(**{**v, "choices": tuple(v["choices"])}) for v in values["variables"]),
        objectives=int(values["objectives"]),
        contexts=tuple(Context(c["name"], tuple(c["features"])) for c in values["contexts"]),
        start=dict(values["start"]),
    )
