"""Reading of files named by users: only regular ones are opened, up to the size that their reader allows.

A device gives bytes without end, and a pipe may never give one; with both the command would hang.
"""

from __future__ import annotations

from pathlib import Path

from pliant.errors import UserError, closest
from pliant_tables.regular import require_regular as require_regular


def require_there(path: Path, what: str, among: str = "*") -> None:
    """Raise `UserError` if a path from the user is no file, with the closest name in its folder.

    Args:
        path: as the user wrote it.
        what: begins the message, such as "surface 'body.stl'".
        among: pattern of the possible names, such as "*.xml".
    """
    if not path.is_file():
        beside = sorted(p.name for p in path.parent.glob(among)) if path.parent.is_dir() else []
        raise UserError(f"{what} is no file{closest(path.name, beside)}")


def read_regular(path: Path, largest: int, what: str) -> bytes:
    """Return the bytes of a regular file of at most `largest`.

    Args:
        path: the file.
        largest: bytes that it may have.
        what: name of such files in the message, such as "a study".

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
