"""Folders of results in manifests, whose page `pliant report` writes again."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from pliant.registry.manifests import registered
from pliant.registry.place import imported, is_place

NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")


@dataclass(frozen=True)
class ResultFolder:
    """A kind of folder that a command of a package writes.

    Attributes:
        name: of the kind, `search`.
        marker: a file that only such a folder has, relative to it.
        page: "module:function", called with the folder; it writes the page and returns its path.
        package: name and version of the distribution; filled by `registered`.
    """

    name: str
    marker: str
    page: str
    package: str = ""

    @property
    def label(self) -> str:
        """The name in messages."""
        return f"result folder '{self.name}'"

    def problem(self) -> str | None:
        """Return an error in this entry, or None, without importing anything."""
        if not (isinstance(self.name, str) and NAME.fullmatch(self.name)):
            return f"a result folder has name {self.name!r}; write lower-case words joined by '_'"
        path = PurePosixPath(self.marker) if isinstance(self.marker, str) else None
        if path is None or not path.name or path.is_absolute() or ".." in path.parts:
            return f"{self.label} has marker {self.marker!r}; write a file's path inside the folder"
        if not is_place(self.page):
            return f"{self.label} has page {self.page!r}; write it as 'package.module:function'"
        return None

    def function(self) -> Callable[[Path], Any]:
        """Import the function that writes the page."""
        write: Callable[[Path], Any] = imported(self.page)
        return write


def result_folders() -> Mapping[str, ResultFolder]:
    """Return the kinds of folders of all packages by name."""
    return registered("pliant_folders", ResultFolder)


def result_folder(folder: Path) -> ResultFolder | None:
    """Return the kind of a folder by its marker; None for a folder of `pliant run`, or an unknown one."""
    return next((kind for kind in result_folders().values() if (folder / kind.marker).is_file()), None)
