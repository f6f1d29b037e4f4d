"""Compiled mechanics that engines share: laws as function pointers, efforts, statics of a chain, equilibria.

numba's cache on disk looks only at the file of a function, not at the files of functions that it calls: when
this room is imported, machine code that is older than any of its sources is thrown away.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from numba import njit

ROOM = Path(__file__).parent


def cache_folder() -> Path:
    """Where numba keeps the machine code of this room; all of its files share one folder."""
    return Path(njit(cache=True)(_probe).stats.cache_path)


def discard_stale(folder: Path | None = None, sources: Iterable[Path] | None = None) -> None:
    """Remove cache indexes older than the newest source: numba compiles anew what they listed.

    Without arguments this is about the cache and the sources of this room.
    """
    newest = max(source.stat().st_mtime for source in sources or ROOM.glob("*.py"))
    for index in (folder or cache_folder()).glob("*.nbi"):
        try:
            if index.stat().st_mtime < newest:
                index.unlink()
        except OSError:  # another process was faster, or the installation is read-only
            continue


def is_cached(file: str, function: str) -> bool:
    """Whether machine code of a function of this room, given by its file's stem, is in the cache."""
    return any(cache_folder().glob(f"{file}.{function}-*.nbi"))


def _probe() -> None:
    """A function of this room; its cache's path is that of all."""


discard_stale()
