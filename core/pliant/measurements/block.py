"""The `measurements` block that reads the same files again, with the lines that reports and errors ask for."""

from __future__ import annotations

import io
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from pliant.config.loading import with_override
from pliant.config.measurements import MeasurementNotes
from pliant.config.writing import as_node, yaml_writer
from pliant.errors import UserError
from pliant.measurements.header import ANOTHER

# A line of notes as sentences quote it: 'units: {angle_rad: deg}', 'restarts: new run', 'decimal: ","'.
QUOTED = re.compile(r"'(\w+: [^'\n]+)'")
TO_CHOOSE = "take the '# ' away before a line that is true"


def advised(sentences: Iterable[str]) -> list[dict[str, Any]]:
    """Return the lines of notes that the reader's sentences quote, each once and in their order."""
    found: list[dict[str, Any]] = []
    for text in (match[1] for sentence in sentences for match in QUOTED.finditer(sentence)):
        key = text.partition(":")[0]
        line = YAML(typ="safe").load(text) if key in MeasurementNotes.model_fields else None
        if line and line not in found:
            found.append(line)
    return found


def asked(error: UserError, block: Mapping[str, Any]) -> UserError:
    """Return the error with the block that reads the files after one of the lines that it quotes is chosen.

    It is unchanged if it quotes none, or already ends in notes to paste.
    """
    text = str(error)
    if any(line.removesuffix(":") in MeasurementNotes.model_fields for line in text.splitlines()):
        return error
    choices = advised([text])
    return (
        UserError(f"{text}\n\n{block_text(_without_joined(block, choices), choices)}") if choices else error
    )


def _without_joined(block: Mapping[str, Any], choices: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the block without files that a choice joins to another one."""
    said = [choice["join"] for choice in choices if "join" in choice]
    joined = {Path(one["file"] if isinstance(one, Mapping) else one).name for one in said}
    named = block.get("file", ())
    files = [named] if isinstance(named, str) else list(named)
    kept = [file for file in files if Path(file).name not in joined]
    if len(kept) == len(files):
        return dict(block)
    return {**block, "file": kept[0] if len(kept) == 1 else kept or ANOTHER}


def block_text(block: Mapping[str, Any], choices: Sequence[Mapping[str, Any]] = ()) -> str:
    """Return the block as YAML, with each choice as a comment that is activated by deleting its "# ".

    Args:
        block: keys of `measurements`, `file` first.
        choices: lines of notes that may apply, as `advised` returns them.
    """
    if not block and not choices:  # a frame without any notes
        return ""
    lines = ["measurements:", *(f"  {line}" for key in block for line in _lines(key, block, choices))]
    for key in dict.fromkeys(key for choice in choices for key in choice if key not in block):
        lines += [f"  # {line}" for line in _lines(key, {}, choices)]
    if choices:
        lines[0] += f"  # {TO_CHOOSE}"
    return "\n".join(lines) + "\n"


def _lines(key: str, block: Mapping[str, Any], choices: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return one key with the choices that concern it: as comments if the block has the key, else uncommented."""
    offered = [choice[key] for choice in choices if key in choice and choice[key] != block.get(key)]
    inner = [value for value in offered if isinstance(value, Mapping)]
    lines = _dumped({key: block[key]}) if key in block else [f"{key}:"] if inner else []
    comment = "# " if key in block else ""
    for value in inner:
        lines += [f"  {comment}{line}" for line in _dumped(value)]
    return lines + [
        f"{comment}{line}" for value in offered if value not in inner for line in _dumped({key: value})
    ]


def _dumped(values: Mapping[str, Any]) -> list[str]:
    stream = io.StringIO()
    yaml_writer().dump(as_node(values), stream)
    return stream.getvalue().splitlines()


def files_and_notes(arguments: Sequence[str]) -> tuple[list[str], dict[str, Any]]:
    """Split a command's arguments into files, and "key=value" texts as notes on them (``units.angle_rad=deg``).

    Raises `UserError` where no file is named.
    """
    keys = MeasurementNotes.model_fields
    stated = [one for one in arguments if re.split(r"[.=]", one)[0] in keys and "=" in one]
    files = [one for one in arguments if one not in stated]
    if not files:
        raise UserError("name the recording: pliant import bench.csv; several files are runs in their order.")
    study: dict[str, Any] = {}
    for one in stated:
        study = with_override(study, f"measurements.{one}")
    return files, study.get("measurements", {})


def with_files(block: Mapping[str, Any], folder: Path | None = None) -> dict[str, Any]:
    """Return the block with its files relative to a folder, or absolute; a single file is not put into a list."""
    files = [block["file"]] if isinstance(block["file"], str) else list(block["file"])
    paths = [
        os.path.relpath(file, folder).replace(os.sep, "/") if folder else str(Path(file).absolute())
        for file in files
    ]
    return {**block, "file": paths[0] if len(paths) == 1 else paths}
