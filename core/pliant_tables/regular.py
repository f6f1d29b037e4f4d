"""Check that a file named by a user is a regular one, before it is opened."""

from __future__ import annotations

import stat
from pathlib import Path

from pliant_tables.errors import UserError


def require_regular(path: Path) -> None:
    """Raise `UserError` for a device, a pipe or a socket; a missing file is reported when it is opened.

    Raises `OSError` for an error of the file system, `ValueError` for an impossible file name.
    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise UserError(
            f"{path}: it is a device or a pipe, and only files are read; save it as a file first."
        )
