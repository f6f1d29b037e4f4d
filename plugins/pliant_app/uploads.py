"""Files that are dropped on the page: limited in size, stored under safe names, read as data and never executed."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

from pliant.config.loading import load_notes
from pliant.config.measurements import MeasurementNotes
from pliant.config.paths import change_paths
from pliant.config.study import Study
from pliant.config.yaml_file import read_yaml
from pliant.errors import UserError
from pliant.registry.block import blocks

MOST_BYTES = 256 * 1024**2
LONGEST_NAME = 80
TABLES = (".csv", ".tsv", ".txt", ".dat", ".xlsx", ".mat", ".parquet")
STUDIES = (".yaml", ".yml")
HARMLESS = re.compile(r"[^\w .+()=-]", re.ASCII)
RESERVED = {"con", "prn", "aux", "nul"}


def safe_name(name: str) -> str:
    """Return the file's name without folders, control characters or other unsafe characters.

    Raises `UserError` for a kind of file that is neither a table nor a study.
    """
    last = re.split(r"[/\\]", name)[-1]
    cleaned = HARMLESS.sub("_", last).strip(" .")
    stem, dot, suffix = cleaned.rpartition(".")
    ending = f".{suffix.lower()}"
    if not (stem and dot) or ending not in (*TABLES, *STUDIES):
        raise UserError(
            f"'{cleaned[:LONGEST_NAME]}' is neither a recording ({', '.join(TABLES)}) nor a study "
            f"({', '.join(STUDIES)}); nothing else is taken."
        )
    stem = stem.strip(" .")[: LONGEST_NAME - len(ending)] or "file"
    return f"{'_' if stem.lower() in RESERVED else ''}{stem}{ending}"


def too_large() -> UserError:
    """Return the error for a file above the limit."""
    return UserError(
        f"the file is larger than {MOST_BYTES // 1024**2} MB, the most that the page takes; read it by "
        "'pliant app STUDY.yaml FILE', which has no limit."
    )


async def receive(chunks: AsyncIterator[bytes], declared: int | None, target: Path) -> None:
    """Write a body to a file, completely or not at all; stops at the limit, whatever length was declared.

    Raises:
        UserError: the file is too large or empty.
    """
    if declared is not None and declared > MOST_BYTES:
        raise too_large()
    partial = target.with_name(f".{target.name}.part")
    size = 0
    try:
        with partial.open("wb") as out:
            async for chunk in chunks:
                size += len(chunk)
                if size > MOST_BYTES:
                    raise too_large()
                out.write(chunk)
        if not size:
            raise UserError(f"{target.name} is empty.")
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)


def holds_notes(path: Path) -> bool:
    """Return whether a dropped YAML contains notes on a recording and is no study.

    Raises:
        UserError: it has unknown keys, or it joins a file outside the session's folder.
    """
    tree = read_yaml(path)
    if set(tree) & ({*Study.model_fields, *blocks()} - {"measurements"}):
        return False
    notes = load_notes(path, MeasurementNotes)
    if notes is not None and notes.join is not None:
        _inside(path, notes.join.file)
    return notes is not None


def checked_study(path: Path) -> None:
    """Raise for a dropped study that would run code or read files outside the session's folder.

    Raises:
        UserError: it names plugins or a base, or a path that leaves its folder.
    """
    study: dict[str, Any] = _plain(read_yaml(path))
    for key, why in (("plugins", "runs code"), ("extends", "reads another file")):
        if key in study:
            raise UserError(
                f"{path.name}: a dropped study may not have '{key}', because that {why}; open it by "
                f"'pliant app {path.name}' instead."
            )

    change_paths(study, lambda named: _inside(path, named))


def _inside(path: Path, named: str) -> str:
    """Return a file's name; raises `UserError` where it leaves the session's folder."""
    if Path(named).name != named or named.startswith(("~", ".")):
        raise UserError(
            f"{path.name}: the path '{named[:LONGEST_NAME]}' leaves the session's folder; drop that file too and "
            "name it without folders."
        )
    return named


def _plain(node: Any) -> Any:
    if isinstance(node, dict):
        return {str(key): _plain(value) for key, value in node.items()}
    return [_plain(one) for one in node] if isinstance(node, list) else node
