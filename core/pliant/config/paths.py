"""Paths inside a study: they are relative to the file that states them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

PATH_KEYS = (
    ("surrogate", "data"),
    ("meta_model", "data"),
    ("measurements", "file"),
    ("task", "mesh"),
    ("task", "points"),
    ("sweep", "designs"),
    ("family", "visual"),
)


def absolute_paths(study: dict[str, Any], folder: Path) -> None:
    """Make the paths of a study that was read from `folder` absolute, in place."""
    for block, key in PATH_KEYS:
        _absolute(study.get(block), key, folder)
    chain = study.get("chain")
    segments = chain.get("segments") if isinstance(chain, dict) else None
    for segment in segments if isinstance(segments, list) else []:
        if isinstance(segment, dict):
            _absolute(segment.get("surrogate"), "data", folder)
            _absolute(segment.get("family"), "visual", folder)
    _absolute_in_search(study.get("search"), folder)
    if isinstance(study.get("plugins"), list):
        study["plugins"] = [str(folder / f) if isinstance(f, str) else f for f in study["plugins"]]


def _absolute_in_search(search: Any, folder: Path) -> None:
    """Paths that a search sets: `task.target.points: a.csv` in a condition or a check, choices of a variable."""

    def settle(key: Any, value: Any) -> Any:
        parts = str(key).split(".")
        if isinstance(value, list):
            return [settle(key, item) for item in value]
        if (parts[0], parts[-1]) in PATH_KEYS and isinstance(value, str):
            return str(folder / value)
        for block, name in PATH_KEYS:
            if block == parts[0]:
                _absolute(value, name, folder)
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


def _absolute(block: Any, key: str, folder: Path) -> None:
    """Make a block's path absolute, and those of blocks inside it, such as the axes of a law."""
    for name, value in block.items() if isinstance(block, dict) else ():
        if name == key and isinstance(value, str):
            block[name] = str(folder / value)
        else:
            _absolute(value, key, folder)
