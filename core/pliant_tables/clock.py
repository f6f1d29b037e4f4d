"""Disorder of a run's clock, which repeats or goes back: whether its rows may be sorted, and the messages if not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pliant_tables.arrays import Array
from pliant_tables.wording import plural

# Early rows in order: from this number on they are a separate recording.
LONGEST = 10
FEWEST = 8  # rows of a run that are sorted; the order of fewer is not informative
HOUR_S = 3600.0
# Spans of counters, in ticks and in thousandths and millionths of them: of milliseconds or microseconds, in seconds.
COUNTERS = tuple((bits, 2.0**bits * tick) for bits in (16, 32) for tick in (1.0, 1e-3, 1e-6))
FEW_STEPS, AT_MOST = (
    10.0,
    0.1,
)  # usual steps, and share of its span, by which one that began again has gone on


@dataclass
class Disorder:
    """The disorder in the clock of one run.

    Attributes:
        line, before, now: of the first row before which the time goes back, and that time.
        steps: number of rows before which it goes back.
        equal_line, equal_at: the first row with the time of the row before and other values.
        equal: number of such rows.
        stretch: the longest succession of rows in order, all earlier than some row above them.
        usual: the median step forward of the rows around the first step back.
    """

    line: int = 0
    before: float = 0.0
    now: float = 0.0
    steps: int = 0
    equal_line: int = 0
    equal_at: float = 0.0
    equal: int = 0
    stretch: int = 0
    usual: float = 0.0

    def note(self, lines: Array, times: Array, before: Array, wrong: Array, latest: float) -> None:
        """Record some rows.

        Args:
            lines, times: (n,) of the rows.
            before: (n,) time of the row before each.
            wrong: indices of rows that are not later than the row before, and do not repeat it.
            latest: the latest time of all rows above these.
        """
        equal = wrong[times[wrong] == before[wrong]]
        back = wrong[times[wrong] < before[wrong]]
        if equal.size and not self.equal:
            self.equal_line, self.equal_at = int(lines[equal[0]]), float(times[equal[0]])
        if back.size and not self.steps:
            first = int(back[0])
            self.line, self.before, self.now = int(lines[first]), float(before[first]), float(times[first])
            forward = times - before
            self.usual = float(np.median(forward[forward > 0])) if (forward > 0).any() else 0.0
        self.equal += equal.size
        self.steps += back.size
        so_far = np.maximum.accumulate(np.concatenate([[latest], times]))[:-1]
        late = times < so_far
        succession = np.cumsum(~late | (times <= before))
        self.stretch = max(self.stretch, int(np.bincount(succession[late]).max(initial=0)))

    def sortable(self, count: int) -> bool:
        """Return whether sorting a run of `count` rows is safe: single rows are too early, or there is no order.

        Sorting also requires that no time occurs twice, and that the clock does not restart.
        """
        mixed = self.stretch < LONGEST and 4 * self.steps >= count
        return count >= FEWEST and not self.equal and (mixed or self.stretch == 1)

    def counter(self, stamped: bool) -> tuple[str, float] | None:
        """Return what began again, in words, and its span: a counter's bits, or the hour of a clock that was set back.

        `stamped`: the clock has dates or times of day. None for any other step back.
        """
        hour = [("a clock that is set back by an hour", HOUR_S)]
        counters = hour if stamped else [(f"a counter of {bits} bits", span) for bits, span in COUNTERS]
        gained = [(what, span, self.now + span - self.before) for what, span in counters if self.steps]
        return next(
            (
                (what, span)
                for what, span, step in gained
                if 0 < step <= min(FEW_STEPS * self.usual, AT_MOST * span)
            ),
            None,
        )

    def sentences(
        self, run: str, goes_on: int | None, notes: str, named_by: str = "", wraps: str = ""
    ) -> Iterator[tuple[int, str]]:
        """Yield line and text of each undecidable case.

        Args:
            run: its name.
            goes_on: the line where it continues after rows of another run.
            notes: where the user states what the file does not contain.
            named_by: the line of the notes by which a column of the file would name the runs.
            wraps: what began again, and the line of the notes that continues it; empty for other steps back.
        """
        if self.equal:
            again = f", and so in {plural(self.equal - 1, 'more row')}" if self.equal > 1 else ""
            coarse = (
                "; where the clock is coarser than even rows, take it out and write their rate, as 'rate: 25 Hz', "
                f"into {notes}"
                if self.equal > 1
                else ""
            )
            yield (
                self.equal_line,
                f"time_s is {self.equal_at:g} again in run '{run}', with other values{again}; one sample has one time"
                f"{coarse}",
            )
        if self.steps:
            again = f" and again in {plural(self.steps - 1, 'more row')}" if self.steps > 1 else ""
            if wraps:
                back = f"from {self.before:.10g} to {self.now:.10g} in run '{run}'{again}"
                yield self.line, f"time_s goes back {back}, as {wraps} into {notes}"
                return
            if goes_on == self.line:
                text = f"run '{run}' begins again with time_s {self.now:g} after {self.before:g}; give it another name"
            else:
                text = (
                    f"time_s goes back from {self.before:g} to {self.now:g} in run '{run}'{again}; give each "
                    "recording a run of its own"
                )
            named = f"'{named_by}' if that column names the recordings, or " if named_by else ""
            yield (
                self.line,
                f"{text}, or write {named}'restarts: new run' into {notes} if a clock that begins again begins a run",
            )
