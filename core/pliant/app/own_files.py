"""A user's own effect files: those that a study names, watched so that the page shows what they say now."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pliant.registry.discovery import Registry
from pliant.registry.files import FILE_MODULE

Stamp = tuple[int, int]


class Watch:
    """Tells when one of some files has changed since it was last asked."""

    def __init__(self, files: Sequence[Path] = ()) -> None:
        self._stamps = {file: _stamp(file) for file in files}

    def changed(self) -> list[Path]:
        """Files that changed since the last question, in their order; a file that is gone has changed."""
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
    """Names of the code that the registry has from files; another one where a file says something else."""
    found = (component.implementation for component in registry.components)
    return sorted(name for name in found if name.startswith(FILE_MODULE))


def file_of(registry: Registry, kind: str) -> str:
    """The file that an effect comes from; empty for one that is installed."""
    component = registry.get("effect", kind)
    return component.package if component.implementation.startswith(FILE_MODULE) else ""
