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


@dataclass
class Disorder:
    """The disorder in the clock of one run.

    Attributes:
        line, before, now: of the first row before which the time goes back, and that time.
        steps: number of rows before which it goes back.
        equal_line, equal_at: the first row with the time of the row before and other values.
        equal: number of such rows.
        stretch: the longest succession of rows in order, all earlier than some row above them.
    """

    line: int = 0
    before: float = 0.0
    now: float = 0.0
    steps: int = 0
    equal_line: int = 0
    equal_at: float = 0.0
    equal: int = 0
    stretch: int = 0

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

    def sentences(
        self, run: str, goes_on: int | None, notes: str, named_by: str = ""
    ) -> Iterator[tuple[int, str]]:
        """Yield line and text of each undecidable case.

        Args:
            run: its name.
            goes_on: the line where it continues after rows of another run.
            notes: where the user states what the file does not contain.
            named_by: the line of the notes by which a column of the file would name the runs.
        """
        if self.equal:
            again = f", and so in {plural(self.equal - 1, 'more row')}" if self.equal > 1 else ""
            yield (
                self.equal_line,
                f"time_s is {self.equal_at:g} again in run '{run}', with other values{again}; one sample has one time",
            )
        if self.steps:
            again = f" and again in {plural(self.steps - 1, 'more row')}" if self.steps > 1 else ""
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
