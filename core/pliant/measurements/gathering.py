"""Streaming of measurement rows into runs; long runs are downsampled, never averaged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pliant.errors import UserError
from pliant.formatting import plural
from pliant.measurements.interleaved import Line, longest_line, values_between
from pliant.measurements.plausible import as_key
from pliant.records.design import Array
from pliant.records.history import REFERENCE_TEMPERATURE_C
from pliant_tables.cells import Cells, Problems, lines_text
from pliant_tables.clock import Disorder
from pliant_tables.schema import FRAMES, FileColumn

MOST_RUNS = 10_000
NOTHING: Mapping[str, bool] = {}
DEFAULTS = {
    "temperature_c": f"{REFERENCE_TEMPERATURE_C:g} °C",
    "payload_kg": "the chain's own",
    "valve_open": "1",
}


@dataclass
class Blanks:
    """Blank rows of one column: the first lines, and their count in each run."""

    lines: list[int] = field(default_factory=list)
    of_run: dict[int, int] = field(default_factory=dict)

    @property
    def count(self) -> int:
        return sum(self.of_run.values())

    def add(self, lines: Array, run: int) -> None:
        self.lines += lines[: max(0, 6 - len(self.lines))].astype(int).tolist()
        self.of_run[run] = self.of_run.get(run, 0) + lines.size


@dataclass
class RunRows:
    """Rows of one run that are kept: every `stride`-th of the `count` usable ones; a row ends with its line.

    `part` counts from 1 if a restarting clock begins a new run; otherwise 0.
    """

    name: str
    specimen: str = ""
    part: int = 0
    latest: float = -np.inf
    disorder: Disorder | None = None
    stride: int = 1
    count: int = 0
    parts: list[Array] = field(default_factory=list)
    last: Array | None = None

    @property
    def kept(self) -> int:
        return sum(map(len, self.parts))

    def append(self, rows: Array) -> None:
        self.parts.append(rows[-self.count % self.stride :: self.stride].copy())
        self.count += len(rows)
        self.last = rows[-1].copy()

    def thin(self) -> None:
        """Keep every second of the rows that were kept so far."""
        self.parts = [np.concatenate(self.parts)[::2].copy()]
        self.stride *= 2


class Gatherer:
    """Sorts blocks of rows into runs, checks each run's clock, and keeps at most `most` rows.

    A run keeps every 2^k-th row, with k from its own length and one limit for all runs, so that runs of equal length
    remain alike.

    Attributes:
        runs: in the order of their first rows.
        blanks: missing values, by column name; rows without time or input are left out at once.
        doubles: rows that are identical to the row before; they are left out.
        split_runs: runs whose rows are not contiguous, with the line where each continues.
        named_by: the line of the notes by which a column that is not read would name the runs.
        filled: inputs that are filled between their own rows, and whether they hold until the next one.
        lines: the longest straight line of each of them.
        sorted_runs: runs whose rows were sorted by time, with the first line that was out of order.
    """

    def __init__(
        self,
        columns: Sequence[FileColumn],
        problems: Problems,
        most: int,
        restarts: bool = False,
        named_by: str = "",
        filled: Mapping[str, bool] = NOTHING,
    ) -> None:
        self.named_by = named_by
        self.restarts = restarts
        self.sorted_runs: dict[str, int] = {}
        self.columns, self.problems, self.most, self.limit = tuple(columns), problems, most, most
        self.runs: list[RunRows] = []
        self.blanks: dict[str, Blanks] = {}
        self.doubles = Blanks()
        self.split_runs: dict[int, int] = {}
        self._ids: dict[str, int] = {}
        self._begun: set[int] = set()
        self._now = -1
        roles = [column.role for column in columns]
        self._time = roles.index("time") if "time" in roles else None
        self.filled, self.lines = filled, dict[str, Line]()
        self._filled = [i for i, column in enumerate(columns) if column.name in filled]
        self._needed = [
            i for i, role in enumerate(roles) if role in ("time", "input") and i not in self._filled
        ]
        self._noted = [i for i, role in enumerate(roles) if role in ("condition", "cycle")]

    def add(self, table: Array, lines: Array, runs: Cells, specimens: Cells | None) -> None:
        """Add one block of rows.

        Args:
            table: (n, columns) numbers as written.
            lines: (n,) their lines.
            runs: the run of each row.
            specimens: the specimen of each row, if there is such a column.
        """
        ids = self._run_ids(runs, lines)
        bodies = None if specimens is None else np.array([text.strip() for text in specimens], object)
        table = np.column_stack([table, lines])
        order = np.argsort(ids, kind="stable")
        for rows in np.split(order, np.flatnonzero(np.diff(ids[order])) + 1):
            run = int(ids[rows[0]])
            if run >= 0:  # the others have no name and were reported
                if bodies is not None:
                    self._specimen(self.runs[run], bodies[rows], lines[rows])
                self._append_run(run, table[rows])
        while True:
            for one in self.runs:
                while one.kept > self.limit:
                    one.thin()
            if self.limit <= 1 or sum(one.kept for one in self.runs) <= self.most:
                return
            self.limit //= 2

    def _run_ids(self, runs: Cells, lines: Array) -> Array:
        known = {name: self._ids.get(name, -1) for name in dict.fromkeys(runs)}
        for name in [name for name, run in known.items() if run < 0 and name.strip()]:
            known[name] = self._id(name.strip(), int(lines[runs.index(name)]))
        ids = np.array([known[name] for name in runs], int)
        for index in np.flatnonzero(ids < 0):
            self._id("", int(lines[index]))
        for index in np.flatnonzero(np.diff(ids, prepend=self._now)):
            run = int(ids[index])
            if run in self._begun:
                self.split_runs.setdefault(run, int(lines[index]))
            elif run >= 0:
                self._begun.add(run)
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

    def _specimen(self, run: RunRows, names: Array, lines: Array) -> None:
        for index in np.flatnonzero((names != run.specimen) & (names != "")):
            run.specimen = run.specimen or str(names[index])
            if names[index] != run.specimen:
                self.problems.add(
                    int(lines[index]),
                    f"specimen '{names[index]}' in run '{run.name}', which began with '{run.specimen}'; a run has "
                    "one specimen",
                )

    def _append_run(self, run: int, table: Array) -> None:
        self._note_blanks(run, table, self._needed)
        table = table[~np.isnan(table[:, self._needed]).any(axis=1)]
        for part in self._parts(run, table):
            run = self._ids[self.runs[run].name] if self.restarts else run
            self._note_blanks(run, part, self._noted)
            if self._time is not None and len(part):
                part = self._without_doubles(run, part, self._time)
            if len(part):
                self.runs[run].append(part)

    def _note_blanks(self, run: int, table: Array, columns: Sequence[int]) -> None:
        for i in columns:
            missing = np.isnan(table[:, i])
            if missing.any():
                self.blanks.setdefault(self.columns[i].name, Blanks()).add(table[missing, -1], run)

    def _parts(self, run: int, table: Array) -> Iterator[Array]:
        """Yield the table, divided where the clock restarts if a restart begins a new run."""
        if not self.restarts or self._time is None or not len(table):
            yield table
            return
        last = self.runs[run].last
        times = table[:, self._time]
        before = np.concatenate([times[:1] if last is None else last[self._time, None], times[:-1]])
        for number, part in enumerate(np.split(table, np.flatnonzero(times < before))):
            if number:
                self._begin_part(run)
            if len(part):
                yield part

    def _begin_part(self, run: int) -> None:
        old = self.runs[self._ids[self.runs[run].name]]
        old.part = old.part or 1
        if len(self.runs) == MOST_RUNS:
            raise UserError(f"{self.problems.path}: the clock begins again more than {MOST_RUNS} times.")
        self._ids[old.name] = len(self.runs)
        self._begun.add(len(self.runs))
        self._now = len(self.runs)
        self.runs.append(RunRows(old.name, old.specimen, old.part + 1))

    def _without_doubles(self, run: int, table: Array, time: int) -> Array:
        """Return the rows without exact duplicates; a clock that repeats or goes back is noted."""
        rows = self.runs[run]
        last = rows.last
        previous = np.concatenate([table[:1] if last is None else last[None, :], table[:-1]])
        step = table[:, time] - previous[:, time]
        if last is None:
            step[0] = np.inf
        wrong = np.flatnonzero(step <= 0)
        if wrong.size:
            now, before = table[wrong, :-1], previous[wrong, :-1]
            doubles = wrong[((now == before) | (np.isnan(now) & np.isnan(before))).all(axis=1)]
            others = np.setdiff1d(wrong, doubles)
            if others.size:
                rows.disorder = rows.disorder or Disorder()
                rows.disorder.note(table[:, -1], table[:, time], previous[:, time], others, rows.latest)
            if doubles.size:
                self.doubles.add(table[doubles, -1], run)
                table = np.delete(table, doubles, axis=0)
        rows.latest = max(rows.latest, float(table[:, time].max(initial=-np.inf)))
        return table

    def finish(self) -> None:
        """Sort rows by time where that is safe; undecidable cases become problems."""
        for number, run in enumerate(self.runs):
            found = run.disorder
            if found is None or self._time is None:
                continue
            column = self.columns[self._time]
            counter = found.counter(column.stamped)
            if counter is None and run.stride == 1 and found.sortable(run.count):
                table = np.concatenate(run.parts)
                table = table[np.argsort(table[:, self._time], kind="stable")]
                if (np.diff(table[:, self._time]) > 0).all():
                    run.parts = [table]
                    self.sorted_runs[run.name] = found.line
                    continue
            goes_on, notes = self.split_runs.get(number), self.problems.notes_name
            wraps = "" if counter is None else _wrap_line(column, *counter)
            for line, text in found.sentences(run.name, goes_on, notes, self.named_by, wraps):
                self.problems.add(line, text)

        for run in self.runs:
            if self._filled and self._time is not None and run.kept:
                self._fill(run, self._time)

    def _fill(self, run: RunRows, time: int) -> None:
        """Fill the inputs that stand in rows of their own; rows outside their span are left out."""
        if run.stride > 1:
            names = ", ".join(self.columns[i].name for i in self._filled)
            raise UserError(
                f"{self.problems.path}: {names} stands in rows of its own, and {run.count} rows of run '{run.name}' "
                f"are more than max_samples ({self.most}); raise it, or divide the file."
            )
        table = np.concatenate(run.parts)
        for i in self._filled:
            name, there = self.columns[i].name, np.isfinite(table[:, i])
            self.blanks.setdefault(name, Blanks()).add(table[~there, -1], self.runs.index(run))
            knots, own = table[there, time], table[there, i]
            line = longest_line(table[:, time], knots, own)
            if line is not None and line.rows > (self.lines[name].rows if name in self.lines else 0):
                self.lines[name] = line
            table[:, i] = values_between(table[:, time], knots, own, self.filled[name])
        run.parts = [table[np.isfinite(table[:, self._filled]).all(axis=1)]]

    def named(self) -> list[RunRows]:
        """Return the runs in the order of their first rows; parts by a restarting clock are numbered: "a 1", "a 2"."""
        for run in self.runs:
            if run.part:
                run.name = f"{run.name} {run.part}"
        if not self.restarts:
            return self.runs
        return sorted(self.runs, key=lambda run: run.parts[0][0, -1] if run.kept else np.inf)

    def no_rows(self) -> str:
        """Return why no row can be used."""
        if not self.blanks:
            return "the file has a header and no rows."
        name, blanks = max(self.blanks.items(), key=lambda item: item[1].count)
        where = lines_text(blanks.lines, blanks.count)
        return f"no row can be used; {name} is blank in {blanks.count} of them ({where})."

    def remarks(self, blank_rows: int) -> list[str]:
        """Return remarks on the changes to rows while reading."""
        remarks = []
        for i in self._needed:
            name = self.columns[i].name
            if blanks := self.blanks.get(name):
                remarks.append(
                    f"{name} is blank in {plural(blanks.count, 'row')} ({lines_text(blanks.lines, blanks.count)}): "
                    "left out; inputs are taken as straight lines across them."
                )
        for name, hold in self.filled.items():
            if blanks := self.blanks.get(name):
                how = "held until the next one" if hold else "taken as straight lines between them"
                remarks.append(
                    f"{name} stands in rows of its own ({plural(blanks.count, 'other row')}): {how}; rows outside "
                    "their span are left out."
                )
        if doubles := self.doubles.count:
            remarks.append(
                f"Left out: {plural(doubles, 'row')} equal to the row before in every column "
                f"({lines_text(self.doubles.lines, doubles)})."
            )
        if blank_rows:
            remarks.append(f"Left out: {plural(blank_rows, 'row')} of nothing but separators.")
        if self.split_runs:
            run, line = next(iter(self.split_runs.items()))
            remarks.append(
                f"Rows of {len(self.split_runs)} of {len(self.runs)} runs are not consecutive (run "
                f"'{self.runs[run].name}' continues in line {line}); they were joined in the file's order."
            )
        remarks += self.order_remarks()
        if thinned := [run for run in self.runs if run.stride > 1]:
            longest = max(thinned, key=lambda run: run.stride)
            total = sum(run.count for run in self.runs)
            remarks.append(
                f"{total} rows are more than max_samples ({self.most}): of {len(thinned)} of {len(self.runs)} runs "
                f"only a part of the rows is kept (run '{longest.name}': one in {longest.stride} of "
                f"{longest.count}). Nothing was averaged; changes faster than the kept rows are lost."
            )
        return remarks

    def order_remarks(self) -> list[str]:
        """Return a sentence on runs whose rows were sorted."""
        if not self.sorted_runs:
            return []
        runs = ", ".join(f"'{name}'" for name in list(self.sorted_runs)[:5])
        line = next(iter(self.sorted_runs.values()))
        clock = next(column.written for column in self.columns if column.role == "time")
        return [
            f"{clock}: rows of run {runs} did not stand in its order (first in line {line}) and were sorted by it."
        ]

    def condition_remarks(self) -> list[str]:
        """Return remarks on blank loads and conditions: the default for a run without any value, else rows left out."""
        remarks = []
        for i in self._noted:
            name, role = self.columns[i].name, self.columns[i].role
            blanks, default = self.blanks.get(name), DEFAULTS.get(name, "0")
            if blanks is None:
                continue
            if role == "cycle":
                rows = plural(blanks.count, "row")
                remarks.append(f"cycle is blank in {rows}: it is counted from the actuation in those runs.")
                continue
            silent = [count for run, count in blanks.of_run.items() if count >= self.runs[run].count]
            if silent:
                remarks.append(
                    f"{name} is blank throughout {plural(len(silent), 'run')}: taken as {default} there."
                )
            if partly := blanks.count - sum(silent):
                remarks.append(
                    f"{name} is blank in {plural(partly, 'row')} of runs that have it elsewhere "
                    f"({lines_text(blanks.lines, blanks.count)}): left out; write {default} where that is meant."
                )
        return remarks


def _wrap_line(clock: FileColumn, what: str, span: float) -> str:
    """Return what began again, and the line of the notes that continues the clock."""
    size = (
        f"{clock.scale * span:.10g} s"
        if clock.in_unit == FRAMES
        else f"{span:.10g} {clock.in_unit or clock.unit}"
    )
    return f"{what} does; write 'wrap: {{{as_key(clock.written)}: {'1 h' if clock.stamped else size}}}'"
