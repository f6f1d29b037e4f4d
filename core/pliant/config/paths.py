"""Paths inside a study, which are relative to the file that states them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pliant.registry.block import blocks

Change = Callable[[str], str]


def path_keys() -> list[tuple[str, str]]:
    """Return block and key of every path."""
    return [(block.key, name) for block in blocks().values() for name in block.paths]


def change_paths(study: dict[str, Any], change: Change) -> None:
    """Replace every path of a study."""
    for block, key in path_keys():
        _change(study.get(block), key, change)
    chain = study.get("chain")
    segments = chain.get("segments") if isinstance(chain, dict) else None
    for segment in segments if isinstance(segments, list) else []:
        if isinstance(segment, dict):
            _change(segment.get("surrogate"), "data", change)
            for key in ("visual", "file"):
                _change(segment.get("family"), key, change)
    for name, entry in blocks().items():
        if settings := entry.function("settings"):
            settings(study.get(name), change)
    if isinstance(study.get("plugins"), list):
        study["plugins"] = [change(f) if isinstance(f, str) else f for f in study["plugins"]]


def change_setting(key: Any, value: Any, change: Change) -> Any:
    """Return a value that a block sets for the dotted `key` of the study, its paths changed."""
    parts = str(key).split(".")
    if isinstance(value, list):
        return [change_setting(key, item, change) for item in value]
    if (parts[0], parts[-1]) in path_keys() and isinstance(value, str):
        return change(value)
    for block, name in path_keys():
        if block == parts[0]:
            _change(value, name, change)
    return value


def _change(block: Any, key: str, change: Change) -> None:
    """Change a block's path, and those of blocks inside it, such as the axes of a law."""
    for name, value in block.items() if isinstance(block, dict) else ():
        if name == key and isinstance(value, str):
            block[name] = change(value)
        elif name == key and isinstance(value, list):
            block[name] = [change(item) if isinstance(item, str) else item for item in value]
        else:
            _change(value, key, change)
