"""A portable copy of a study: one file without bases, together with the files that it reads."""

from __future__ import annotations

import io
import os
import re
import shutil
from pathlib import Path

from pliant.config.loading import StudyFile
from pliant.config.mjcf_files import referenced_files
from pliant.config.paths import change_paths
from pliant.config.writing import as_node, study_name_from_path, yaml_writer
from pliant.errors import UserError

PATTERN = re.compile(r"[*?\[]")


def write_portable(source: Path, folder: Path) -> Path:
    """Write a study with its files into an empty folder; every path in the copy is below that folder.

    Files of one folder stay together, each with its notes (`.yaml` of the same stem).

    Args:
        source: the study file.
        folder: for the study and its files.

    Returns the new study file. Raises `UserError` where a file that the study names cannot be read.
    """
    values = StudyFile.read(source).values
    places: dict[Path, str] = {}

    def carried(name: str) -> str:
        path = Path(name)
        place = places.setdefault(path.parent, f"files{len(places) + 1}")
        found = sorted(path.parent.glob(path.name)) if PATTERN.search(path.name) else [path]
        notes = [one.with_suffix(end) for one in found for end in (".yaml", ".yml")]
        (folder / place).mkdir(exist_ok=True)
        for one in (*found, *(note for note in notes if note.is_file())):
            _copy(one, folder / place / one.name)
        if path.suffix.lower() == ".xml":  # an arm: with its meshes, whose paths are relative to it
            for one in referenced_files(path)[1:]:
                beside = Path(os.path.relpath(one, path.parent))
                if ".." in beside.parts:
                    raise UserError(f"{path}: it reads {one}, which lies outside its folder; put it inside.")
                (folder / place / beside).parent.mkdir(parents=True, exist_ok=True)
                _copy(one, folder / place / beside)
        return f"{place}/{path.name}"

    change_paths(values, carried)
    target = folder / f"{study_name_from_path(source) or 'study'}.yaml"
    stream = io.StringIO()
    yaml_writer().dump(as_node(values), stream)
    target.write_text(stream.getvalue(), encoding="utf-8")
    return target


def _copy(source: Path, target: Path) -> None:
    try:
        shutil.copyfile(source, target)
    except (OSError, shutil.Error) as error:
        cause = getattr(error, "strerror", None) or error
        raise UserError(f"{source}: the study names this file, and it cannot be copied ({cause}).") from None
