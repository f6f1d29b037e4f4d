"""A run's clock that stands or goes back: whether its rows may be sorted, and what is said where they may not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pliant.formatting import plural
from pliant.records.design import Array

# Rows that stand too early and follow each other in order: from here on they are a recording of its own.
LONGEST = 10
FEWEST = 8  # rows of a run that are sorted; of fewer nobody can tell what their order means


@dataclass
class Disorder:
    """What is wrong with the clock of one run.

    Attributes:
        line, before, now: of the first row before which the time goes back, and that time.
        steps: rows before which it does.
        equal_line, equal_at: the first row with the time of the row before and other values.
        equal: rows that have it.
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
        """Take in some rows.

        Args:
            lines, times: (n,) of the rows.
            before: (n,) time of the row before each.
            wrong: places of rows that are not later than the row before, and do not repeat it.
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
        """Whether sorting is surely meant, of a run of `count` rows: single rows are too early, or there is no order.

        Then no time comes twice, and no clock begins again.
        """
        mixed = self.stretch < LONGEST and 4 * self.steps >= count
        return count >= FEWEST and not self.equal and (mixed or self.stretch == 1)

    def sentences(self, run: str, goes_on: int | None, notes: str) -> Iterator[tuple[int, str]]:
        """Line and text of what cannot be decided.

        Args:
            run: its name.
            goes_on: the line where it goes on after rows of another run.
            notes: where the user writes what the file does not say.
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
            yield (
                self.line,
                f"{text}, or write 'restarts: new run' into {notes} if a clock that begins again begins a run",
            )
