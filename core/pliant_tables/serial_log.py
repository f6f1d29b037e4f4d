"""Logs of a serial monitor: the time of day before each line, and values behind their names.

The Arduino IDE copies ``17:13:18.016 -> 12.5,3.1`` where its time stamps are shown; its plotter is fed with
``pressure_kpa:12.5,angle_deg:3.1``.
"""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from typing import IO

from pliant_tables.cells import COMMA_DECIMAL, is_number

STAMPED = re.compile(r"\s*(\d{1,2}:\d\d:\d\d[.,]\d{1,6}) -> ?(.*)")
LABELLED = re.compile(r"\s*([^\W\d][^:,;\t]*?)\s*:\s*([-+]?[\d.][^:,;\t\s]*)\s*")
SEPARATOR = re.compile(r"[,;\t]")
OWN_CLOCK = re.compile(r"\s*(time|timestamp|millis|micros|zeit|t)\b.*|\s*(time|t)_.*", re.IGNORECASE)
CLOCK, RECEIVED = "time", "received"  # names of the monitor's stamps: of the clock, or beside the board's own
LEAST, SHARE = 2, 0.9  # lines by which such a log is known, and share of its lines with a stamp


class SerialLog(io.StringIO):
    """The lines of a log as those of a table, one for one.

    Attributes:
        separator: the mark between its cells.
        names: of the columns, where each line has them; else empty, and the header is a line of the log.
    """

    def __init__(self, file: IO[str], separator: str, names: Sequence[str]) -> None:
        super().__init__()
        self._file, self.separator, self.names = file, separator, tuple(names)

    def read(self, size: int | None = -1, /) -> str:
        """Return whole lines of about this many characters."""
        return "".join(self._line(line) for line in self._file.readlines(-1 if size is None else size))

    def close(self) -> None:
        """Close the log."""
        self._file.close()
        super().close()

    def _line(self, line: str) -> str:
        stamp, rest = _divided(line.rstrip("\n"))
        if not stamp and not self.names:
            return line
        cells = SEPARATOR.split(rest)
        if self.names:
            cells = [match[2] if (match := LABELLED.fullmatch(cell)) else cell for cell in cells]
        header = not self.names and cells[0].strip()[:1].isalpha()
        clock = RECEIVED if any(map(OWN_CLOCK.fullmatch, cells)) else CLOCK
        whole = [*([clock if header else stamp.replace(",", ".")] if stamp else []), *cells]
        return self.separator.join(whole) + "\n" * line.endswith("\n")


def opened_log(file: IO[str], lines: Sequence[str]) -> SerialLog | None:
    """Return the log whose first lines are these; None for another text."""
    there = [line for line in lines if line.strip()]
    divided = [_divided(line) for line in there]
    stamped = sum(bool(stamp) for stamp, _ in divided) >= SHARE * len(there)
    rests = [SEPARATOR.split(rest) for _, rest in divided]
    labels = [tuple(match[1] for cell in cells if (match := LABELLED.fullmatch(cell))) for cells in rests]
    named = labels[0] if labels else ()
    labelled = len(named) > 1 and all(
        own == named and len(own) == len(cells) and all(map(_is_value, cells))
        for own, cells in zip(labels, rests, strict=True)
    )
    if len(there) < LEAST or not (labelled or stamped):
        return None
    mark = SEPARATOR.search(divided[-1][1])
    own = any(map(OWN_CLOCK.fullmatch, named))
    names = [*([RECEIVED if own else CLOCK] if stamped else []), *named] if labelled else ()
    return SerialLog(file, mark[0] if mark else ",", names)


def _divided(line: str) -> tuple[str, str]:
    """Return the stamp before a line, "" where it has none, and the rest."""
    match = STAMPED.fullmatch(line)
    return (match[1], match[2]) if match else ("", line)


def _is_value(cell: str) -> bool:
    match = LABELLED.fullmatch(cell)
    return match is not None and (is_number(match[2]) or COMMA_DECIMAL.fullmatch(match[2]) is not None)
