"""What a study holds at a path, read fast: for studies that are known to have it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pliant.config.study import Study, varied
from pliant.errors import UserError
from pliant.search.keys import KeyPath, written_path
from pliant.units import strip_unit_suffix


def number_at(study: Study, path: KeyPath) -> float:
    """The number at a path; of a segment's `family`, that of the family that it comes to.

    Raises:
        UserError: there is none.
    """
    found: Any = study
    for place, part in enumerate(path):
        found = _inside(found, part)
        if path[:2] == ("chain", "segments") and place == 3 and part == "family" and study.family is not None:
            found = varied(study.family, found or {})
    if isinstance(found, bool) or not isinstance(found, int | float):
        raise UserError(f"'{written_path(path)}' holds no number that could be varied; give it a value.")
    return float(found)


def overridden(study: Study, path: KeyPath) -> tuple[KeyPath, ...]:
    """The same key of `family` in the segments that give it a value of their own."""
    if len(path) != 2 or path[0] != "family" or study.chain is None:
        return ()
    name = strip_unit_suffix(str(path[1]))
    return tuple(
        ("chain", "segments", number, "family", path[1])
        for number, segment in enumerate(study.chain.segments)
        if name in {strip_unit_suffix(key) for key in segment.family}
    )


def _inside(value: Any, part: str | int) -> Any:
    if isinstance(part, int):
        return value[part] if isinstance(value, list | tuple) and part < len(value) else None
    if isinstance(value, Mapping):
        named = {strip_unit_suffix(key): held for key, held in value.items()}
        return named.get(strip_unit_suffix(part))
    return getattr(value, part, None)
