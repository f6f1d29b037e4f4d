"""Columns that begin again: an angle within one turn, a clock of 32 bits, a clock that is set back by an hour."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pliant.config.measurements import MeasurementNotes
from pliant.errors import UserError
from pliant.measurements.columns import column_si_unit
from pliant.measurements.plausible import as_key
from pliant.records.design import Array
from pliant.records.measurement import Doubt, MeasuredRun
from pliant_tables.cells import Cells
from pliant_tables.clock import FEW_STEPS, HOUR_S
from pliant_tables.schema import FileColumn, noted
from pliant_tables.units import parse_si_value, stem

TURN = 2 * math.pi
JUMP, REST = (
    0.75,
    0.25,
)  # of a turn: the least jump of a sensor that begins again, and its greatest true motion


@dataclass
class Unwrapper:
    """Adds the spans after which columns have begun again, block by block.

    Attributes:
        spans: by index of the column, in the unit of its numbers.
        clock: index of the clock, which only goes forward.
    """

    spans: Mapping[int, float] = field(default_factory=dict)
    clock: int | None = None
    _state: dict[tuple[int, str], tuple[float, float]] = field(default_factory=dict)

    def unwrap(self, columns: list[Array], runs: Cells) -> list[Array]:
        """Return the (n,) numbers of each column, continued by run."""
        if not self.spans:
            return columns
        names, found = np.array(runs, object), list(columns)
        for place, span in self.spans.items():
            values = found[place].copy()
            for run in dict.fromkeys(runs):
                rows = np.flatnonzero((names == run) & np.isfinite(values))
                if rows.size:
                    values[rows] = self._continued(place, run, values[rows], span)
            found[place] = values
        return found

    def _continued(self, place: int, run: str, values: Array, span: float) -> Array:
        last, turns = self._state.get((place, run), (float(values[0]), 0.0))
        steps = np.diff(values, prepend=last) / span
        back = (steps < -0.5).astype(float) if place == self.clock else -np.rint(steps)
        passed = turns + np.cumsum(back)
        self._state[place, run] = float(values[-1]), float(passed[-1])
        return values + span * passed


def stated_unwrapper(
    notes: MeasurementNotes, notes_name: str, columns: Sequence[FileColumn], *, si: bool = False
) -> Unwrapper:
    """Return the unwrapper of some columns by the notes' `wrap`; `si`: their numbers are in SI, not as written.

    Raises `UserError` for a span that is not above 0 or of another unit.
    """
    spans = {}
    for place, column in enumerate(columns):
        names = (column.written, stem(column.written), column.name)
        if (value := noted(notes.wrap, *names)) is None:
            continue
        where = notes.at(notes_name, "wrap", next(name for name in names if name in notes.wrap))
        span = parse_si_value(value, column.unit, f"{where}: 'wrap' of '{column.written}'")
        if not 0 < span < math.inf:
            raise UserError(f"{where}: 'wrap' of '{column.written}' is {value}; it should be above 0.")
        spans[place] = span if si else span / abs(column.scale)
    clock = next((place for place, column in enumerate(columns) if column.role == "time"), None)
    return Unwrapper(spans, clock)


def hour_doubts(runs: Sequence[MeasuredRun], clock: FileColumn | None) -> list[Doubt]:
    """Return a doubt for a clock of dates or times of day that jumps forward by an hour: summer time began."""
    if clock is None or not clock.stamped:
        return []
    for run in runs:
        steps = np.diff(run.history.time_s) if run.history.time_s is not None else np.zeros(0)
        gained = steps - HOUR_S
        most = FEW_STEPS * float(np.median(steps)) if steps.size else 0.0
        jumps = np.flatnonzero((gained > 0) & (gained <= most))
        if jumps.size == 1:
            first, second = (int(run.lines[jumps[0] + k]) for k in (0, 1))
            text = (
                f"{clock.written} jumps forward by an hour from line {first} to {second}, as a clock does when summer "
                "time begins: if it was set, write the times with their offset, such as +02:00. Nothing was changed."
            )
            return [Doubt(clock.written, "clock", text)]
    return []


def turn_doubts(
    runs: Sequence[MeasuredRun], columns: Mapping[str, FileColumn], notes: MeasurementNotes, notes_name: str
) -> list[Doubt]:
    """Return a doubt for each angle that jumps by about a whole turn from one reading to the next."""
    doubts = []
    for name in runs[0].outputs if runs else ():
        column = columns.get(name)
        if column is None or column_si_unit(name) != "rad":
            continue
        if noted(notes.wrap, column.written, stem(column.written), name) is not None:
            continue
        for run in runs:
            there = np.flatnonzero(np.isfinite(run.outputs[name]))
            steps = np.abs(np.diff(run.outputs[name][there]))
            jumps = np.flatnonzero((steps > JUMP * TURN) & (np.abs(steps - TURN) < REST * TURN))
            if jumps.size:
                first, second = (int(run.lines[there[jumps[0] + k]]) for k in (0, 1))
                text = (
                    f"{column.written} jumps by {math.degrees(steps[jumps[0]]):.0f}° from line {first} to {second}: "
                    "if the sensor counts within one turn, write "
                    f"'wrap: {{{as_key(column.written)}: 360 deg}}' into {notes_name}. Nothing was changed."
                )
                doubts.append(Doubt(column.written, "turn", text))
                break
    return doubts


def with_whole_turns(runs: Sequence[MeasuredRun], names: Sequence[str]) -> list[MeasuredRun]:
    """Return the runs with some angles continued over whole turns, to judge their zeros."""
    found = []
    for run in runs:
        outputs = dict(run.outputs)
        for name in names:
            there = np.isfinite(outputs[name])
            continued = outputs[name].copy()
            continued[there] = np.unwrap(continued[there])
            outputs[name] = continued
        found.append(run.with_outputs(outputs))
    return found
