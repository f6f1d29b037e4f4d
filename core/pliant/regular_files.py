"""Files that somebody names: only regular ones are opened, and none that is larger than its reader can take.

A device gives bytes without an end, and a pipe may never give one; both would look like a command that hangs.
"""

from __future__ import annotations

import stat
from pathlib import Path

from pliant.errors import UserError, closest


def require_regular(path: Path) -> None:
    """Raise `UserError` for a device, a pipe or a socket; what is not there is left to whoever opens it.

    Raises `OSError` where the file system itself refuses, `ValueError` for a name that no file can have.
    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise UserError(
            f"{path}: it is a device or a pipe, and only files are read; save it as a file first."
        )


def require_there(path: Path, what: str, among: str = "*") -> None:
    """Raise `UserError` where a path that somebody wrote is no file, with the nearest name in its folder.

    Args:
        path: as it was written.
        what: begins the message, such as "surface 'body.stl'".
        among: names that were meant, such as "*.xml".
    """
    if not path.is_file():
        beside = sorted(p.name for p in path.parent.glob(among)) if path.parent.is_dir() else []
        raise UserError(f"{what} is no file{closest(path.name, beside)}")


def read_regular(path: Path, largest: int, what: str) -> bytes:
    """The bytes of a regular file of at most `largest`.

    Args:
        path: the file.
        largest: bytes that it may have.
        what: names such files in the message, such as "a study".

    Raises:
        UserError: it is no regular file, or it is too large.
        OSError: as `open` does.
    """
    require_regular(path)
    with path.open("rb") as file:
        found = file.read(largest + 1)
    if len(found) > largest:
        raise UserError(
            f"{path}: it has more than {largest // 1000} kB, which is the most that {what} may have."
        )
    return found
