"""Changes of a study: "key=value" texts with dotted keys, their merging, and their conversion from Python keywords.

At a Python prompt they are ``pressure="20 kPa"``, ``physics="mujoco"``, ``chain={"modules": 10}``.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ruamel.yaml.error import YAMLError

from pliant.config.paths import path_keys
from pliant.config.study import Study, allowed_keys
from pliant.config.yaml_file import DEEPEST, KeyPath, Plain, bounded_yaml
from pliant.errors import UserError, closest
from pliant.registry.block import blocks, kind_blocks
from pliant.registry.discovery import Registry
from pliant.units import strip_unit_suffix


def fitted_blocks() -> list[str]:
    """Return the blocks of one component with a table `data`, which all its kinds share."""
    return [key for key, block in blocks().items() if block.interface and "data" in block.paths]


def merge(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Merge changes into a mapping deeply; changing a block's `kind` clears the block, lists are replaced."""
    result, kinds = dict(base), kind_blocks()
    for key, value in changes.items():
        old = result.get(key)
        if isinstance(old, str) and key in kinds:
            old = {"kind": old}
        if isinstance(value, str) and key in kinds:
            value = {"kind": value}
        if isinstance(old, Mapping) and isinstance(value, Mapping):
            same = value.get("kind", old.get("kind")) == old.get("kind")
            result[key] = merge(old, value) if same else dict(value)
        else:
            result[key] = value
    return result


def overridden(raw: dict[str, Any], text: str, places: dict[KeyPath, str]) -> dict[str, Any]:
    """Return the values with one "a.b=value" applied; `places` records where that key was written."""
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
    if (parts[0], parts[-1]) in path_keys() and isinstance(value, str):
        value = str(Path(value).absolute())
    elif parts[0] == "plugins" and isinstance(value, list):
        value = [str(Path(f).absolute()) if isinstance(f, str) else f for f in value]
    path: KeyPath = tuple(int(p) if p.isascii() and p.isdigit() else p for p in parts)
    places.update(dict.fromkeys(_paths(value, path), f"override {text}"))
    return _with_data(raw, merge(raw, _nested(raw, path, value, text)), path)


def with_payload(
    stated: Mapping[str, Any], raw: dict[str, Any], registry: Registry, note: Callable[[str], None]
) -> dict[str, Any]:
    """Return the values of a study with the payload of a task whose kind an override has changed.

    A payload is part of the robot's load, not of the kind of the task. A note says where the new kind has none.

    Args:
        stated: the values of the files, blocks as mappings.
        raw: the same with the overrides.
        registry: knows the kinds.
        note: receives the sentence.
    """
    old, new = stated.get("task"), raw.get("task")
    if not (isinstance(old, Mapping) and isinstance(new, Mapping)) or old.get("kind") == new.get("kind"):
        return raw
    loads = {name: value for name, value in old.items() if strip_unit_suffix(str(name)) == "payload"}
    if not loads or any(strip_unit_suffix(str(name)) == "payload" for name in new):
        return raw
    try:
        fields = registry.config_model("task", new).model_fields
    except UserError:
        return raw
    if "payload_kg" in fields:
        return {**raw, "task": {**new, **loads}}
    note(
        f"task.kind={new.get('kind')} has no payload, and the one of the study's task is left out; chain.payload hangs "
        "it on the chain."
    )
    return raw


def _with_data(raw: Mapping[str, Any], merged: dict[str, Any], path: KeyPath) -> dict[str, Any]:
    """Return the merged values with the data of blocks of which only the kind changed: all kinds use the same data."""
    block = path[0]
    if (
        block not in fitted_blocks()
        or path[1:] not in ((), ("kind",))
        or not isinstance(raw.get(block), Mapping)
    ):
        return merged
    old, new = raw[block], merged[block]
    if "data" in old and set(new) == {"kind"}:
        return {**merged, block: {**new, "data": old["data"]}}
    return merged


def _paths(value: Any, at: KeyPath) -> Iterator[KeyPath]:
    """Yield the paths of a value and of all values in it."""
    yield at
    inner = (
        value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, list) else ()
    )
    for key, item in inner:
        yield from _paths(item, (*at, key))


def _nested(raw: Any, path: KeyPath, value: Any, text: str) -> Any:
    """Return the override as a mapping to merge; list items are set in a copy of the list."""
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


def parse_block(texts: Sequence[str]) -> dict[str, Any]:
    """Return the keys of one block from "key=value" texts. Raises `UserError` for an invalid text."""
    block: dict[str, Any] = {}
    for text in texts:
        block = overridden(block, text, {})
    return block


def as_overrides(study: Study, changes: Mapping[str, Any]) -> list[str]:
    """Return the "key=value" overrides of these changes.

    A key is a block or a value of the study (``physics``, ``effects``), a dotted key (``"chain.modules"``), or the
    name of a key that occurs in one block only (``pressure`` for ``task.pressure``), with or without its unit.

    Raises:
        UserError: a name that no block has, or that several blocks have.
    """
    made: list[str] = []
    for key, value in changes.items():
        if key in fitted_blocks() and isinstance(value, Mapping) and "kind" in value and len(value) > 1:
            value = {"data": None, **value} if getattr(getattr(study, key), "data", None) else value
        made += _assigned(key if "." in key or key in type(study).model_fields else _only(study, key), value)
    return made


def _assigned(key: str, value: Any) -> list[str]:
    if isinstance(value, Mapping) and value:
        # the kind first: changing it clears the block
        inner = sorted(value.items(), key=lambda item: item[0] != "kind")
        return [line for name, one in inner for line in _assigned(f"{key}.{name}", one)]
    return [f"{key}={json.dumps(_plain(value), ensure_ascii=False)}"]


def _plain(value: Any) -> Any:
    """Return numpy numbers, arrays and paths as JSON values."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(name): _plain(item) for name, item in value.items()}
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def _only(study: Study, name: str) -> str:
    """Return the dotted key of a name that exactly one block has."""
    wanted, places, known = strip_unit_suffix(name), [], []
    for block in type(study).model_fields:
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
    near = closest(wanted, sorted({*known, *type(study).model_fields}))
    raise UserError(f"no block of study '{study.name}' has a key '{name}'{near}")
