"""A user's own effect files, named by a study and watched so that the page shows their present contents."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pliant.registry.discovery import Registry
from pliant.registry.files import FILE_MODULE

Stamp = tuple[int, int]


class Watch:
    """A watch on files that reports those changed since the last query."""

    def __init__(self, files: Sequence[Path] = ()) -> None:
        self._stamps = {file: _stamp(file) for file in files}

    def changed(self) -> list[Path]:
        """Return the files that changed since the last query, in order; a deleted file counts as changed."""
        now = {file: _stamp(file) for file in self._stamps}
        found = [file for file, stamp in now.items() if stamp != self._stamps[file]]
        self._stamps = now
        return found


def _stamp(file: Path) -> Stamp | None:
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size


def own_code(registry: Registry) -> list[str]:
    """Return names of the code that the registry loaded from files; they change with the contents of the files."""
    found = (component.implementation for component in registry.components)
    return sorted(name for name in found if name.startswith(FILE_MODULE))


def defining_file(registry: Registry, kind: str) -> str:
    """Return the file that defines an effect; empty for an installed one."""
    component = registry.get("effect", kind)
    return component.package if component.implementation.startswith(FILE_MODULE) else ""
