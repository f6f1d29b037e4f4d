"""Changes of a study: "key=value" texts with dotted keys, how they are merged, and how Python's keywords become them.

At a prompt they are ``pressure="20 kPa"``, ``physics="mujoco"``, ``chain={"modules": 10}``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ruamel.yaml.error import YAMLError

from pliant.config.paths import PATH_KEYS
from pliant.config.study import BLOCKS, Study, allowed_keys
from pliant.config.yaml_file import DEEPEST, KeyPath, Plain, bounded_yaml
from pliant.errors import UserError, closest
from pliant.units import strip_unit_suffix


def merge(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Deep merge; changing a block's `kind` clears the block, lists are replaced."""
    result = dict(base)
    for key, value in changes.items():
        old = result.get(key)
        if isinstance(old, str) and key in BLOCKS:
            old = {"kind": old}
        if isinstance(value, str) and key in BLOCKS:
            value = {"kind": value}
        if isinstance(old, Mapping) and isinstance(value, Mapping):
            same = value.get("kind", old.get("kind")) == old.get("kind")
            result[key] = merge(old, value) if same else dict(value)
        else:
            result[key] = value
    return result


def overridden(raw: dict[str, Any], text: str, places: dict[KeyPath, str]) -> dict[str, Any]:
    """The values with one "a.b=value" applied; `places` learns where that key was written."""
    key, equals, written = text.partition("=")
    parts = key.strip().split(".")
    if not equals or not all(parts):
        raise UserError(f"'{text}' is not an override; write key=value, for example physics.kind=mujoco.")
    if len(parts) > DEEPEST:
        raise UserError(f"override '{text}': its key has {len(parts)} parts; {DEEPEST} are the most.")
    try:
        value = Plain(Path("override")).values(bounded_yaml(Path("override")).load(written))
    except (YAMLError, ValueError, LookupError, TypeError, AttributeError, AssertionError, RecursionError):
        value = written
    if (parts[0], parts[-1]) in PATH_KEYS and isinstance(value, str):
        value = str(Path(value).absolute())
    elif parts[0] == "plugins" and isinstance(value, list):
        value = [str(Path(f).absolute()) if isinstance(f, str) else f for f in value]
    path: KeyPath = tuple(int(p) if p.isascii() and p.isdigit() else p for p in parts)
    places[path] = f"override {text}"
    return merge(raw, _nested(raw, path, value, text))


def _nested(raw: Any, path: KeyPath, value: Any, text: str) -> Any:
    """The override as a mapping to merge; list items are set in a copy of the list."""
    if not path:
        return value
    head, rest = path[0], path[1:]
    if isinstance(head, int):
        items = list(raw) if isinstance(raw, list) else []
        if head >= len(items):
            raise UserError(f"override '{text}': there is no item {head}; the list has {len(items)}.")
        inner = _nested(items[head], rest, value, text)
        both = isinstance(inner, Mapping) and isinstance(items[head], Mapping)
        items[head] = merge({"": items[head]}, {"": inner})[""] if both else inner
        return items
    below = raw.get(head) if isinstance(raw, Mapping) else None
    return {head: _nested(below, rest, value, text)}


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
