"""Changes of a study as Python writes them: ``pressure="20 kPa"``, ``physics="mujoco"``, ``chain={"modules": 10}``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pliant.config.study import Study, allowed_keys
from pliant.errors import UserError, closest
from pliant.units import strip_unit_suffix


def as_overrides(study: Study, changes: Mapping[str, Any]) -> list[str]:
    """The "key=value" overrides of these changes.

    A key is a block or a value of the study (``physics``, ``effects``), a dotted key (``"chain.modules"``), or the
    name of a key that stands in one block alone (``pressure`` for ``task.pressure``), with or without its unit.

    Raises:
        UserError: a name that no block has, or that several have.
    """
    made: list[str] = []
    for key, value in changes.items():
        made += _assigned(key if "." in key or key in Study.model_fields else _only(study, key), value)
    return made


def _assigned(key: str, value: Any) -> list[str]:
    if isinstance(value, Mapping) and value:
        # the kind first: changing it clears the block
        inner = sorted(value.items(), key=lambda item: item[0] != "kind")
        return [line for name, one in inner for line in _assigned(f"{key}.{name}", one)]
    return [f"{key}={json.dumps(_plain(value), ensure_ascii=False)}"]


def _plain(value: Any) -> Any:
    """Numpy numbers, arrays and paths as JSON values."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(name): _plain(item) for name, item in value.items()}
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def _only(study: Study, name: str) -> str:
    """The dotted key of a name that one block alone has."""
    wanted, places, known = strip_unit_suffix(name), [], []
    for block in Study.model_fields:
        config = getattr(study, block)
        fields = getattr(type(config), "model_fields", None)
        if fields is None or block == "measurements":
            continue
        for key in allowed_keys(type(config)):
            known.append(strip_unit_suffix(key))
            if strip_unit_suffix(key) == wanted and key != "kind":
                places.append(f"{block}.{key}")
    if len(places) == 1:
        return places[0]
    if places:
        raise UserError(f"'{name}' stands in several blocks: {', '.join(places)}; write one of these.")
    raise UserError(
        f"no block of study '{study.name}' has a key '{name}'{closest(wanted, sorted({*known, *Study.model_fields}))}"
    )
