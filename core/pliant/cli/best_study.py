"""A found design as a study of its own: the searched one with the design's values, without its search."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from pliant.cli.new_study import write_checked
from pliant.config.found_writing import study_with_changes
from pliant.config.loading import read_yaml
from pliant.config.study import OF_OPTIMIZE, Study
from pliant.config.text_edits import flow_text
from pliant.errors import PliantError, UserError
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
) -> None:
    """Write the study of a found design.

    Its text is the searched study's, comments included, where that stands in one file; else all its keys in SI.

    Args:
        source: the searched study.
        target: the new file.
        winner: the study with the design in it.
        keys: what differs from `source`.
        said: where it comes from, for the first line.
        overrides: with which `source` was read.
        registry: as it was before the study's own plugin files were read.

    Raises:
        UserError: it cannot be written.
    """
    meant = {**winner.canonical(), **dict.fromkeys(OF_OPTIMIZE)}
    head = f"# {' '.join(said.split())}\n"
    try:
        if "extends" in read_yaml(source):
            raise UserError("it stands in several files.")
        changes = {tuple(map(str, key)): _text(meant, key) for key in keys}
        text = study_with_changes(source, target, changes, OF_OPTIMIZE, overrides)
        write_checked(target, head + text, meant, registry)
    except (
        PliantError,
        ValueError,
        LookupError,
    ):  # anchors, one line, a key without a place: written out then
        write_checked(target, head + _dumped(winner), meant, registry)


def _text(canonical: Mapping[str, Any], path: Sequence[str | int]) -> str:
    """The value at a path as people write it, exactly."""
    value, name = canonical, ""
    node: Any = value
    for key in path:
        if isinstance(node, list):
            node = node[int(key)]
            continue
        name = next(n for n in node if strip_unit_suffix(n) == strip_unit_suffix(str(key)))
        node = node[name]
    unit = si_unit(name)
    if isinstance(node, float) and unit in WRITTEN:
        factor, short = WRITTEN[unit]
        text = f"{float(f'{factor * node:.12g}')!r} {short}"
        if parse_quantity(text, unit) == node:
            return text
        exact = f"{factor * node!r} {short}"
        if parse_quantity(exact, unit) == node:
            return exact
        return f"{node!r} {unit}"
    return flow_text(node)


def _dumped(study: Study) -> str:
    """What the study says, without its search, in SI."""
    plain = study.model_dump(mode="json", exclude_unset=True, exclude=set(OF_OPTIMIZE))
    first = {key: plain.pop(key) for key in ("pliant", "name") if key in plain}
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style, yaml.sort_base_mapping_type_on_output = None, False  # type: ignore[assignment]
    stream = io.StringIO()
    yaml.dump({**first, **plain}, stream)
    return stream.getvalue()
