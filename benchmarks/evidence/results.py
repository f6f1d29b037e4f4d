"""Results as lines of JSON that survive kill -9: a line is there in full or not at all."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any


def append(path: Path, line: dict[str, Any]) -> None:
    """One line in one write at the end of the file, on the disk when this returns.

    A piece of a line that a killed process left behind is closed off first and ignored by `read`.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    text = (json.dumps(line) + "\n").encode()
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        size = os.fstat(handle).st_size
        if size and os.pread(handle, 1, size - 1) != b"\n":
            text = b"\n" + text
        os.write(handle, text)
        os.fsync(handle)
    finally:
        os.close(handle)


def read(path: Path) -> dict[str, dict[str, Any]]:
    """Lines by their `id`, the last one of each; what is no line of results is passed over."""
    lines: dict[str, dict[str, Any]] = {}
    if not path.exists():
        return lines
    for text in path.read_text(errors="replace").splitlines():
        try:
            line = json.loads(text)
        except json.JSONDecodeError:
            continue
        if isinstance(line, dict) and "id" in line:
            lines[line["id"]] = line
    return lines
