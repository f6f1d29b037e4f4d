"""Log of solves by the benchmarks' plugin files: whole lines in the file $SPRINGS_LOG, from any process."""

from __future__ import annotations

import os
from pathlib import Path


def note(what: str) -> None:
    """Append one line in one write at the end of the file."""
    handle = os.open(os.environ["SPRINGS_LOG"], os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    os.write(handle, f"{what}\n".encode())
    os.close(handle)


def noted(log: Path) -> list[tuple[str, str, str]]:
    """Return whole lines of the file: event, process, subject."""
    if not log.exists():
        return []
    lines = log.read_text(encoding="utf-8").rpartition("\n")[0].splitlines()
    return [(what, pid, of) for what, pid, of in (line.split(" ", 2) for line in lines)]


def candidate(length_m: float, pressure_pa: float) -> str:
    """Return the name of a search's candidate in the file, by its module's length and its pressure."""
    return f"{length_m:.9g}/{pressure_pa:.9g}"
