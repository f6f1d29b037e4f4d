"""Parsing of time stamps: ISO, German, American dates with a time of day, or a time of day alone."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

_ISO = r"(?P<year>\d{4})[-/.](?P<month>\d{1,2})[-/.](?P<day>\d{1,2})"
_GERMAN = r"(?P<d>\d{1,2})\.(?P<m>\d{1,2})\.(?P<y>\d{4}|\d\d)"
_SLASHED = r"(?P<one>\d{1,2})/(?P<two>\d{1,2})/(?P<last>\d{4}|\d\d)"  # month or day first
_SECOND = r"(?P<second>\d{2})(?:[.,](?P<fraction>\d{1,9}))?"
_CLOCK = rf"(?P<hour>\d{{1,2}}):(?P<minute>\d{{2}})(?::{_SECOND})?(?:\s*(?P<half>[AaPp])\.?[Mm]\.?)?"
STAMP = re.compile(
    rf"(?:(?:{_ISO}|{_GERMAN}|{_SLASHED})(?:[T ,]\s*{_CLOCK.replace('?P<', '?P<at_')})?|{_CLOCK})"
    r"\s*(?:Z|[+-]\d\d:?\d\d)?"
)
OFFSET = re.compile(r"\s*(?:Z|([+-])(\d\d):?(\d\d))$", re.MULTILINE)
NO_STAMP = np.iinfo(np.int64).min
DAY = 86_400_000_000  # microseconds


@dataclass
class StampClock:
    """The state of a column of stamps: its first and last stamp, and the number of midnights passed."""

    first: int
    last: int
    midnights: int = 0


def is_stamp(text: str) -> bool:
    """Return whether a cell contains a date, a date and a time, or a time of day."""
    return STAMP.fullmatch(text.strip()) is not None


def is_day(text: str) -> bool:
    """Return whether a cell contains a date without a time of day."""
    return is_stamp(text) and ":" not in text


def is_clock_time(text: str) -> bool:
    """Return whether a cell contains a time of day without a date."""
    match = STAMP.fullmatch(text.strip())
    return match is not None and match["hour"] is not None


def microseconds(cells: Sequence[str]) -> Any:
    """Return (n,) microseconds of time stamps; `NO_STAMP` where a cell contains none.

    Raises `ValueError` for dates with slashes whose differences depend on the order of month and day.
    """
    cells = [cell.strip() for cell in cells]
    if OFFSET.search("\n".join(cells)):
        stamps = _local_microseconds([OFFSET.sub("", cell) for cell in cells])
        return np.where(stamps == NO_STAMP, stamps, stamps - np.array([_ahead(cell) for cell in cells]))
    return _local_microseconds(cells)


def _ahead(cell: str) -> int:
    """Return by how many microseconds the clock of a stamp is ahead of universal time, by its offset: +02:00."""
    match = OFFSET.search(cell)
    if match is None or match[1] is None:
        return 0
    minutes = 60 * int(match[2]) + int(match[3])
    return (minutes if match[1] == "+" else -minutes) * 60_000_000


def _local_microseconds(cells: Sequence[str]) -> Any:
    """Return the microseconds of stamps without an offset."""
    try:
        iso = np.array(cells, "datetime64[us]")
        if not np.isnat(iso).any():
            return iso.astype(np.int64)
    except ValueError:
        pass
    matches = [STAMP.fullmatch(cell) for cell in cells]
    stamps = _all(matches, month_first=True)
    if not any(match is not None and match["one"] for match in matches):
        return stamps
    other = _all(matches, month_first=False)
    lost, lost_other = (int((s == NO_STAMP).sum()) for s in (stamps, other))
    if lost != lost_other:
        return stamps if lost < lost_other else other
    if not np.array_equal(np.diff(stamps), np.diff(other)):
        raise ValueError
    return stamps


def _all(matches: Sequence[re.Match[str] | None], month_first: bool) -> Any:
    found = (NO_STAMP if m is None else _microsecond(m.groupdict(), month_first) for m in matches)
    return np.fromiter(found, np.int64, len(matches))


def _microsecond(found: Mapping[str, str | None], month_first: bool) -> int:
    def part(*names: str, default: str = "0") -> int:
        return int(next((text for name in names if (text := found[name])), default))

    year = part("year", "y", "last", default="1970")
    year += 2000 if year < 100 else 0
    month, day = ("one", "two") if month_first else ("two", "one")
    try:
        date = datetime(year, part("month", "m", month, default="1"), part("day", "d", day, default="1"))
    except ValueError:
        return int(NO_STAMP)
    hour, half = part("at_hour", "hour"), (found["at_half"] or found["half"] or "").lower()
    if half:
        hour = hour % 12 + (12 if half == "p" else 0)
    seconds = 3600 * hour + 60 * part("at_minute", "minute") + part("at_second", "second")
    fraction = str(found["at_fraction"] or found["fraction"] or "0")
    return (date - datetime(1970, 1, 1)).days * DAY + seconds * 1_000_000 + int(fraction.ljust(6, "0")[:6])


def since_first(stamps: Any, clock: StampClock, daily: bool) -> Any:
    """Return (n,) seconds since the clock's first stamp, and advance the clock.

    `daily`: times of day, which may pass midnight.
    """
    if daily:
        before = np.concatenate([[clock.last], stamps[:-1]])
        passed = clock.midnights + np.cumsum(stamps - before < -DAY // 2)
        clock.last, clock.midnights = int(stamps[-1]), int(passed[-1])
        stamps = stamps + DAY * passed
    return (stamps - clock.first) / 1e6
