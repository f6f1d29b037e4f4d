"""A found design as a study of its own: the searched one with the design's values, without its search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pliant.config.study import OF_OPTIMIZE, Study
from pliant.config.writing import StudyDraft
from pliant.registry.discovery import Registry
from pliant.units import parse_quantity, si_unit, strip_unit_suffix

# Units of a study's text, which are read again: not those of `pliant.formatting`.
WRITTEN = {"m": (1e3, "mm"), "Pa": (1e-3, "kPa"), "kg": (1e3, "g"), "N": (1.0, "N"), "s": (1.0, "s")}


def write_best(
    source: Path,
    target: Path,
    winner: Study,
    keys: Sequence[Sequence[str | int]],
    said: str,
    overrides: Sequence[str],
    registry: Registry,
    full: bool = False,
) -> None:
    """Write the study of a found design.

    Args:
        source: the searched study.
        target: the new file.
        winner: the study with the design in it.
        keys: what differs from `source`.
        said: where it comes from, for the first line.
        overrides: with which `source` was read.
        registry: as it was before the study's own plugin files were read.
        full: whether the file shall stand alone.

    Raises:
        UserError: it cannot be written.
    """
    meant = {**winner.canonical(), **dict.fromkeys(OF_OPTIMIZE)}
    draft = StudyDraft(source, overrides)
    for block in OF_OPTIMIZE:
        draft.drop(block)
    for key in keys:
        draft.set(tuple(key), _written(meant, key))
    draft.write(target, meant, registry, full, head=" ".join(said.split()))


def _written(canonical: Mapping[str, Any], path: Sequence[str | int]) -> Any:
    """The value at a path as people write it, exactly."""
    node: Any = canonical
    name = ""
    for key in path:
        if isinstance(node, list):
            node = node[int(key)]
            continue
        name = next(n for n in node if strip_unit_suffix(n) == strip_unit_suffix(str(key)))
        node = node[name]
    unit = si_unit(name)
    if not (isinstance(node, float) and unit in WRITTEN):
        return node
    factor, short = WRITTEN[unit]
    for text in (f"{float(f'{factor * node:.12g}')!r} {short}", f"{factor * node!r} {short}"):
        if parse_quantity(text, unit) == node:
            return text
    return f"{node!r} {unit}"
