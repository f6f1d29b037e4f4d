"""Paths in a `search` block: values that its conditions, its check and its choices set for keys that are paths."""

from __future__ import annotations

from typing import Any

from pliant.config.paths import Change, change_setting


def change_search_paths(search: Any, change: Change) -> None:
    """Change the paths in `task.target.points: a.csv` of a condition or a check, and in choices of a variable."""
    settings = [_inside(block) for block in _inside(search, "conditions").values()]
    for block in (*settings, _inside(search, "verify", "change")):
        block.update({key: change_setting(key, value, change) for key, value in block.items()})
    for name, variable in _inside(search, "variables").items():
        if isinstance(variable, dict) and "choices" in variable:
            key = variable.get("key") or name
            first = key[0] if isinstance(key, list) else key
            variable["choices"] = change_setting(first, variable["choices"], change)


def _inside(block: Any, *names: str) -> dict[str, Any]:
    for name in names:
        block = block.get(name) if isinstance(block, dict) else None
    return block if isinstance(block, dict) else {}
