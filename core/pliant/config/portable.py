"""A study that can be taken elsewhere: one file without bases, and beside it the files that it reads."""

from __future__ import annotations

import io
import os
import re
import shutil
from pathlib import Path

from pliant.config.loading import StudyFile
from pliant.config.mjcf_files import files_of
from pliant.config.paths import change_paths
from pliant.config.writing import as_node, name_of_file, yaml_writer
from pliant.errors import UserError

PATTERN = re.compile(r"[*?\[]")


def write_portable(source: Path, folder: Path) -> Path:
    """Write a study with its files into an empty folder; every path in it is below that folder then.

    Files of one folder stay together, each with the notes (`.yaml` of the same stem) that lie beside it.

    Args:
        source: the study file.
        folder: where the study and its files come to lie.

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
        if path.suffix.lower() == ".xml":  # an arm: with its meshes, which are found from there
            for one in files_of(path)[1:]:
                beside = Path(os.path.relpath(one, path.parent))
                if ".." in beside.parts:
                    raise UserError(f"{path}: it reads {one}, which lies outside its folder; put it inside.")
                (folder / place / beside).parent.mkdir(parents=True, exist_ok=True)
                _copy(one, folder / place / beside)
        return f"{place}/{path.name}"

    change_paths(values, carried)
    target = folder / f"{name_of_file(source) or 'study'}.yaml"
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
