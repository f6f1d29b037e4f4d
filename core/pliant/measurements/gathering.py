"""Rows of a measurement sorted into runs while they stream by; long runs are thinned, never averaged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.tabular.schema import Column
from pliant.tabular.text import Cells, Problems

MOST_RUNS = 10_000


@dataclass
class Blanks:
    """Rows of one column that are blank: how many in all, the first lines, and how many of each run."""

    count: int = 0
    lines: list[int] = field(default_factory=list)
    of_run: dict[int, int] = field(default_factory=dict)

    def add(self, lines: Array, run: int) -> None:
        self.count += lines.size
        self.lines += lines[: max(0, 6 - len(self.lines))].tolist()
        self.of_run[run] = self.of_run.get(run, 0) + lines.size


@dataclass
class RunRows:
    """Rows of one run that are kept: every `stride`-th of the `count` that were usable."""

    name: str
    specimen: str = ""
    stride: int = 1
    count: int = 0
    last: Array | None = None
    last_line: int = 0
    parts: list[Array] = field(default_factory=list)
    line_parts: list[Array] = field(default_factory=list)
    kept: int = 0

    def append(self, rows: Array, lines: Array) -> None:
        skip = -self.count % self.stride
        self.count += len(rows)
        self._keep(rows[skip :: self.stride].copy(), lines[skip :: self.stride].copy())

    def thin(self) -> None:
        """Keep every second of the rows that were kept so far."""
        rows, lines = self.table()
        self.parts, self.line_parts, self.kept = [], [], 0
        self.stride *= 2
        self._keep(rows[::2].copy(), lines[::2].copy())

    def table(self) -> tuple[Array, Array]:
        """(k, columns) the kept rows and (k,) their lines."""
        return np.concatenate(self.parts), np.concatenate(self.line_parts)

    def _keep(self, rows: Array, lines: Array) -> None:
        if len(rows):
            self.parts.append(rows)
            self.line_parts.append(lines)
            self.kept += len(rows)


class Gatherer:
    """Sorts blocks of rows into runs, checks each run's clock, and keeps at most `most` rows.

    A run keeps every 2^k-th row, with k from its own length and one limit for all runs, so that runs of equal
    length stay alike.

    Attributes:
        runs: in the order of their first rows.
        blanks: what is missing, by column name; rows without time or input are left out at once.
        doubles: rows that repeat the row before to the last digit; they are left out.
        split_runs: runs whose rows do not stand together.
    """

    def __init__(self, columns: Sequence[Column], problems: Problems, most: int) -> None:
        self.columns, self.problems, self.most = tuple(columns), problems, most
        self.limit = most
        self.runs: list[RunRows] = []
        self.blanks: dict[str, Blanks] = {}
        self.doubles = Blanks()
        self.split_runs: dict[int, int] = {}
        self._ids: dict[str, int] = {}
        self._now = -1
        self._time = next((i for i, c in enumerate(columns) if c.role == "time"), None)
        self._needed = [i for i, c in enumerate(columns) if c.role in ("time", "input")]
        self._noted = [i for i, c in enumerate(columns) if c.role in ("condition", "cycle")]

    def add(self, table: Array, lines: Array, runs: Cells | str, specimens: Cells | None) -> None:
        """One block of rows.

        Args:
            table: (n, columns) numbers as written.
            lines: (n,) their lines.
            runs: the run of each row, or one name for all.
            specimens: the specimen of each row, where there is such a column.
        """
        ids = self._run_ids(runs, lines)
        bodies = None if specimens is None else np.array([text.strip() for text in specimens], object)
        order = np.argsort(ids, kind="stable")
        edges = np.flatnonzero(np.diff(ids[order])) + 1
        for rows in np.split(order, edges):
            run = int(ids[rows[0]])
            if run < 0:  # no name: told as a problem
                continue
            if bodies is not None:
                self._specimen(run, bodies[rows], lines[rows])
            self._of_run(run, table[rows], lines[rows])
        self._thin()

    def _run_ids(self, runs: Cells | str, lines: Array) -> Array:
        if isinstance(runs, str):
            runs = (runs,) * lines.size
        ids = np.array([self._ids.get(name, -1) for name in runs], int)
        for index in np.flatnonzero(ids < 0):
            ids[index] = self._id(runs[index].strip(), int(lines[index]))
        changes = np.flatnonzero(np.diff(ids, prepend=self._now))
        for index in changes:
            run = int(ids[index])
            if run >= 0 and self.runs[run].last_line:
                self.split_runs.setdefault(run, int(lines[index]))
            if run >= 0:
                self.runs[run].last_line = int(lines[index])
        self._now = int(ids[-1])
        return ids

    def _id(self, name: str, line: int) -> int:
        if not name:
            self.problems.add(line, "column run is blank; name the run of every row")
            return -1
        if name not in self._ids:
            if len(self.runs) == MOST_RUNS:
                raise UserError(
                    f"{self.problems.path}, line {line}: more than {MOST_RUNS} runs; column 'run' names a recording, "
                    "not a row."
                )
            self._ids[name] = len(self.runs)
            self.runs.append(RunRows(name))
        return self._ids[name]

    def _specimen(self, run: int, names: Array, lines: Array) -> None:
        rows = self.runs[run]
        for index in np.flatnonzero((names != rows.specimen) & (names != "")):
            if rows.specimen and names[index] != rows.specimen:
                self.problems.add(
                    int(lines[index]),
                    f"specimen '{names[index]}' in run '{rows.name}', which began with '{rows.specimen}'; a run has "
                    "one specimen",
                )
            rows.specimen = rows.specimen or str(names[index])

    def _of_run(self, run: int, table: Array, lines: Array) -> None:
        bad = np.isnan(table[:, self._needed]).any(axis=1)
        for i in (*self._needed, *self._noted):
            missing = np.isnan(table[:, i])
            if missing.any():
                self.blanks.setdefault(self.columns[i].name, Blanks()).add(lines[missing], run)
        if bad.any():
            table, lines = table[~bad], lines[~bad]
        if self._time is not None and len(table):
            table, lines = self._in_order(run, table, lines, self._time)
        if len(table):
            self.runs[run].append(table, lines)
            self.runs[run].last = table[-1].copy()

    def _in_order(self, run: int, table: Array, lines: Array, time: int) -> tuple[Array, Array]:
        """The rows without exact doubles; a clock that stands or goes back becomes a problem."""
        rows = self.runs[run]
        before = table[:1] if rows.last is None else rows.last[None, :]
        previous = np.concatenate([before, table[:-1]])
        step = table[:, time] - previous[:, time]
        if rows.last is None:
            step[0] = np.inf
        if (step > 0).all():
            return table, lines
        late = np.flatnonzero(step <= 0)
        same = (table[late] == previous[late]) | (np.isnan(table[late]) & np.isnan(previous[late]))
        doubles = late[same.all(axis=1)]
        for index in np.setdiff1d(late, doubles):
            self._clock_problem(run, int(lines[index]), previous[index, time], table[index, time])
        if not doubles.size:
            return table, lines
        self.doubles.add(lines[doubles], run)
        good = np.ones(len(table), bool)
        good[doubles] = False
        return table[good], lines[good]

    def _clock_problem(self, run: int, line: int, before: float, now: float) -> None:
        name = self.runs[run].name
        if now == before:
            text = f"time_s is {now:g} again in run '{name}', with other values; one sample has one time"
        else:
            text = f"time_s goes back from {before:g} to {now:g} in run '{name}'; give each recording a run of its own"
            if self.split_runs.get(run) == line:
                text = f"run '{name}' begins again with time_s {now:g} after {before:g}; give it another name"
        self.problems.add(line, text)

    def _thin(self) -> None:
        while True:
            for run in self.runs:
                while run.kept > self.limit:
                    run.thin()
            if sum(run.kept for run in self.runs) <= self.most or self.limit <= 1:
                return
            self.limit //= 2
