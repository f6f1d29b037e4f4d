"""The record of which study used which artifact: `<root>/uses/<study>.txt`, one line for each artifact."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

USES = "uses"


class Uses:
    """Artifacts that one study uses of a store. Without write permission nothing is recorded, and nothing fails."""

    def __init__(self, root: Path, study: str) -> None:
        self._file = root / USES / f"{study}.txt" if study else None
        self._noted: set[str] | None = None

    def note(self, stage: str, key: str) -> None:
        """Record that the study has made or found this artifact."""
        if self._file is None:
            return
        line = f"{stage}/{key}"
        if self._noted is None:
            self._noted = set(_lines(self._file))
        if line not in self._noted:
            self._noted.add(line)
            with suppress(OSError):
                self._file.parent.mkdir(exist_ok=True)
                with self._file.open(
                    "a", encoding="utf-8"
                ) as file:  # one short write: processes do not mix lines
                    file.write(line + "\n")


def users(root: Path) -> dict[str, tuple[str, ...]]:
    """Return "stage/key" → the studies that used it."""
    found: dict[str, list[str]] = {}
    for file in sorted((root / USES).glob("*.txt")):
        for line in dict.fromkeys(_lines(file)):
            found.setdefault(line, []).append(file.stem)
    return {line: tuple(studies) for line, studies in found.items()}


def _lines(file: Path) -> list[str]:
    try:
        return file.read_text(encoding="utf-8").split()
    except (OSError, ValueError):
        return []
