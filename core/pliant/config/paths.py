"""Paths inside a study: they are relative to the file that states them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

PATH_KEYS = (
    ("surrogate", "data"),
    ("meta_model", "data"),
    ("measurements", "file"),
    ("task", "mesh"),
    ("task", "points"),
    ("task", "path"),
    ("task", "backbone"),
    ("task", "file"),
    ("sweep", "designs"),
    ("family", "visual"),
    ("family", "file"),
    ("chain", "file"),
)


def change_paths(study: dict[str, Any], change: Callable[[str], str]) -> None:
    """Put something else in the place of every path of a study."""
    for block, key in PATH_KEYS:
        _change(study.get(block), key, change)
    chain = study.get("chain")
    segments = chain.get("segments") if isinstance(chain, dict) else None
    for segment in segments if isinstance(segments, list) else []:
        if isinstance(segment, dict):
            _change(segment.get("surrogate"), "data", change)
            for key in ("visual", "file"):
                _change(segment.get("family"), key, change)
    _change_in_search(study.get("search"), change)
    if isinstance(study.get("plugins"), list):
        study["plugins"] = [change(f) if isinstance(f, str) else f for f in study["plugins"]]


def _change_in_search(search: Any, change: Callable[[str], str]) -> None:
    """Paths that a search sets: `task.target.points: a.csv` in a condition or a check, choices of a variable."""

    def settle(key: Any, value: Any) -> Any:
        parts = str(key).split(".")
        if isinstance(value, list):
            return [settle(key, item) for item in value]
        if (parts[0], parts[-1]) in PATH_KEYS and isinstance(value, str):
            return change(value)
        for block, name in PATH_KEYS:
            if block == parts[0]:
                _change(value, name, change)
        return value

    def inside(block: Any, *names: str) -> dict[str, Any]:
        for name in names:
            block = block.get(name) if isinstance(block, dict) else None
        return block if isinstance(block, dict) else {}

    settings = [inside(block) for block in inside(search, "conditions").values()]
    for block in (*settings, inside(search, "verify", "change")):
        block.update({key: settle(key, value) for key, value in block.items()})
    for name, variable in inside(search, "variables").items():
        if isinstance(variable, dict) and "choices" in variable:
            key = variable.get("key") or name
            variable["choices"] = settle(key[0] if isinstance(key, list) else key, variable["choices"])


def _change(block: Any, key: str, change: Callable[[str], str]) -> None:
    """Change a block's path, and those of blocks inside it, such as the axes of a law."""
    for name, value in block.items() if isinstance(block, dict) else ():
        if name == key and isinstance(value, str):
            block[name] = change(value)
        elif name == key and isinstance(value, list):
            block[name] = [change(item) if isinstance(item, str) else item for item in value]
        else:
            _change(value, key, change)
