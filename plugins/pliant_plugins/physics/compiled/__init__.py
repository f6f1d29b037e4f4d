"""Compiled mechanics that engines share: laws as function pointers, efforts, statics of a chain, equilibria.

numba's cache on disk looks only at the file of a function, not at the files of functions that it calls: when
this package is imported, machine code that is older than any of its sources is deleted.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from numba import njit

ROOM = Path(__file__).parent


def cache_folder() -> Path:
    """Return the folder in which numba keeps the machine code of this package; all of its files share it."""
    return Path(njit(cache=True)(_probe).stats.cache_path)


def discard_stale(folder: Path | None = None, sources: Iterable[Path] | None = None) -> None:
    """Remove cache indexes older than the newest source, so that numba recompiles their functions.

    The defaults are the cache and the sources of this package.
    """
    newest = max(source.stat().st_mtime for source in sources or ROOM.glob("*.py"))
    for index in (folder or cache_folder()).glob("*.nbi"):
        try:
            if index.stat().st_mtime < newest:
                index.unlink()
        except OSError:  # another process was faster, or the installation is read-only
            continue


def is_cached(file: str, function: str) -> bool:
    """Return whether machine code of a function of this package, given by its file's stem, is in the cache."""
    return any(cache_folder().glob(f"{file}.{function}-*.nbi"))


def _probe() -> None:
    """Do nothing: a function of this package whose cache path is that of all."""


discard_stale()
