"""Reader of measurements: from CSV and notes to runs with their inputs, readings, and remarks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pliant.config.measurements import (
    MOST_SAMPLES,
    PER_RUN,
    UNKNOWN,
    ExcludedSpan,
    LetGoConfig,
    MeasurementNotes,
    MeasurementsConfig,
    SensorFrameConfig,
)
from pliant.errors import UserError, closest
from pliant.execution.progress import Progress, Silent
from pliant.formatting import plural
from pliant.measurements.columns import MEASUREMENT, column_si_unit, match, outputs_among, with_clock
from pliant.measurements.doubts import quantity_text, sensor_doubts
from pliant.measurements.elsewhere import Elsewhere, external_columns
from pliant.measurements.gathering import Gatherer, RunRows
from pliant.measurements.header import Header, read_header
from pliant.measurements.highpass import noise_variance
from pliant.measurements.interleaved import Line, filled_inputs, line_doubt
from pliant.measurements.notes import file_digest, notes_on
from pliant.measurements.plausible import (
    as_key,
    as_remark,
    implausible_columns,
    time_doubts,
    vacuum_doubts,
)
from pliant.measurements.proposing import rate_doubts, rename_line, run_doubts
from pliant.measurements.wrapping import (
    Unwrapper,
    hour_doubts,
    stated_unwrapper,
    turn_doubts,
    with_whole_turns,
)
from pliant.records.design import Array
from pliant.records.history import BASE, FORCES, REFERENCE_TEMPERATURE_C, History, LetGo
from pliant.records.measurement import Doubt, MeasuredRun, Measurement, SensorFrame
from pliant.records.remark import detail
from pliant.units import UnitError, parse_quantity
from pliant_tables.cells import lines_text
from pliant_tables.columns import is_frame
from pliant_tables.opening import FRAME, open_sheet
from pliant_tables.schema import FileColumn, noted
from pliant_tables.sheet import Sheet
from pliant_tables.units import parse_si_value, stem

LARGE_FILE = 20_000_000  # bytes: from this size on reading shows its progress
# A cycle rises above the first share of a run's own range and returns below the second.
LOADED, RETURNED = 0.6, 0.25
SMALLER = 0.5  # of the largest range of its unit: an input may idle
SMALLEST = 0.1  # of the range of all runs: less than that is no cycle
NOISE_RANGE = 9.0  # range of an idle gauge in standard deviations of its noise
ENOUGH = 50  # samples needed to separate the noise of an input from its signal
VALLEY = 5.0  # standard deviations of noise above a valley's lowest sample that belong to its floor
AT_REST = 0.05  # of the range above the lowest point: still at rest
Levels = tuple[str, float, float]
# Remarks on a single file, which are dropped for files that are read together.
ONE_RUN = "There is one run only: nothing repeats, and no run can be held out."
NEVER_CHANGES = "never changes: its influence cannot be judged."


def read_measurement(
    source: Path | str | Any,
    *,
    settings: MeasurementNotes | None = None,
    actuation: Sequence[str] | None = None,
    expected: Mapping[str, tuple[float, float]] | None = None,
    progress: Progress | None = None,
    runs_seen: set[str] | None = None,
    elsewhere_noted: set[tuple[str, str]] | None = None,
) -> Measurement:
    """Read a measurement (docs/measurement_files.md) and the YAML notes of the same stem.

    The file is streamed in blocks; memory is bounded by `settings.max_samples`, regardless of the file's length.

    Args:
        source: the file, or a pandas frame.
        settings: the study's `measurements` block, or notes; its entries override those of the notes next to the file.
        actuation: names of the chain's inputs, which the file must have; all inputs of the file by default.
        expected: for some columns the range that the model covers (a law's domain, the chain's length), to
            detect a wrong unit.
        progress: receives rows read, for files above 20 MB.
        runs_seen: collects the names of the runs; exclusions for other runs are then left to other files.
        elsewhere_noted: collects keys and columns of notes that the file does not have; then they are left to others.

    Raises:
        UserError: the file cannot be read, a row or column is wrong (all such rows with their lines, 20 of them
            listed), or the chain's inputs or the wanted outputs are missing.
    """
    in_memory = is_frame(source)
    path = Path(FRAME if in_memory else source)
    notes, notes_name = notes_on(source, settings)
    with open_sheet(source if in_memory else path, MEASUREMENT.example, notes, notes_name) as opened:
        sheet = with_clock(opened, notes)
        asked = notes.join is not None or notes.name_pattern is not None or bool(notes.runs)
        own = set(match(sheet, notes, notes_name, frozenset(), elsewhere_noted)) if asked else set()
        other = external_columns(path, notes, notes_name, actuation, own) if asked else Elsewhere()
        texts = [FileColumn("the file's name", name, "text", "") for name in other.texts]
        given = [*texts, *other.columns]
        header = read_header(sheet, notes, notes_name, actuation, given, elsewhere_noted)
        most = settings.max_samples if isinstance(settings, MeasurementsConfig) else MOST_SAMPLES
        named_by = next((rename_line(name, "run") for name, is_ in header.may_be.items() if is_ == "run"), "")
        filled = filled_inputs(sheet, header.columns, notes, notes_name)
        gatherer = Gatherer(header.every, sheet.problems, most, notes.restarts is not None, named_by, filled)
        unwrapper = stated_unwrapper(notes, notes_name, header.columns)
        _gather(sheet, header, other, gatherer, unwrapper, progress or Silent())
        gatherer.finish()
    sheet.problems.raise_if_any()
    gathered = gatherer.named()
    if not any(rows.kept for rows in gathered):
        raise UserError(f"{path}: {gatherer.no_rows()}")
    said = [*header.remarks, *other.remarks, *gatherer.remarks(sheet.blank_rows)]
    wanted = settings.outputs if isinstance(settings, MeasurementsConfig) else ()
    outputs = _chosen(path, header, wanted, notes.at(path, "outputs"))
    said += gatherer.condition_remarks()
    stated = _stated(notes, notes_name, outputs, header)
    if notes.marker_offsets_m and len(notes.marker_offsets_m) != len(notes.markers_m):
        raise UserError(
            f"{notes.at(notes_name, 'marker_offsets')}: 'marker_offsets' has {len(notes.marker_offsets_m)} entries and "
            f"'markers' {len(notes.markers_m)}; give an offset for each, [0, 0, 0] for one on the centre line."
        )
    runs = [_run(rows, header, outputs, stated, path) for rows in gathered if rows.kept]
    said += [f"Run '{rows.name}' has no row that can be used." for rows in gathered if not rows.kept]
    runs = [run for run in runs if len(run)]
    ranges = spans([run.history for run in runs])
    levels = _levels(notes, notes_name, header)
    runs = [  # cycles are counted unless the file gives all of a run's
        replace(run, cycle=cycles(run.history, ranges, levels))
        if levels is not None or np.isnan(run.cycle).any()
        else run
        for run in runs
    ]
    if notes.cycles is not None:
        runs = [part for run in runs for part in _by_cycle(run)]
    runs = _let_go(runs, notes.let_go)
    spans_here = list(enumerate(notes.exclude))
    if runs_seen is not None:
        names = {run.name for run in runs}
        runs_seen |= names
        spans_here = [(number, span) for number, span in spans_here if span.run in names]
    placed = [(span, notes.at(notes_name, "exclude", number)) for number, span in spans_here]
    runs = without_excluded(runs, placed, said)
    read = [name for name in outputs if any(np.isfinite(run.outputs[name]).any() for run in runs)]
    if not runs and runs_seen is not None:  # other files may have some
        return Measurement((), (), path.name, tuple(said))
    if not read:
        raise UserError(f"{path}: no reading is left of {', '.join(outputs)}: all are blank, or left out.")
    said += [
        detail(f"Output '{name}' has no reading and is ignored.") for name in outputs if name not in read
    ]
    runs = [
        replace(
            run,
            outputs={name: run.outputs[name] for name in read},
            sigma={name: values for name, values in run.sigma.items() if name in read},
        )
        for run in runs
    ]
    said += _look(runs)
    doubts = run_doubts(sheet, header.may_be, notes_name) if header.may_be else []
    doubts += [] if header.names("time") else rate_doubts(sheet, notes_name)
    own_columns = {column.name: column for column in header.columns}
    doubts += _line_doubts(runs, own_columns, gatherer.lines, other, notes, notes_name)
    turns = turn_doubts(runs, own_columns, notes, notes_name)
    continued = with_whole_turns(
        runs, [name for name, c in own_columns.items() if c.written in {d.column for d in turns}]
    )
    doubts += [*turns, *_doubts(continued, expected or {}, notes_name, own_columns)]
    said += map(as_remark, doubts)
    doubts += [Doubt(text.partition(":")[0], "order", text) for text in gatherer.order_remarks()]
    return Measurement(
        tuple(runs),
        tuple(read),
        path.name,
        tuple(said),
        notes.markers_m,
        "" if in_memory else file_digest(path),
        tuple(doubts),
        {column.name: column.unit_as_written for column in header.every if column.unit},
        {column.name: column.written for column in header.columns},
        notes.marker_offsets_m,
        {} if notes.frame is None else _frames(notes.frame),
        _free_zeros(notes, notes_name, header, read),
    )


def _frames(stated: SensorFrameConfig) -> dict[str, SensorFrame]:
    turns = stated.turn if isinstance(stated.turn, dict) else {"*": stated.turn}
    return {pattern: _frame(turn) for pattern, turn in turns.items()}


def _frame(turn: Any) -> SensorFrame:
    if isinstance(turn, tuple):
        return SensorFrame(quaternion=turn)
    return SensorFrame() if isinstance(turn, str) else SensorFrame(angle_rad=turn)


def _free_zeros(
    notes: MeasurementNotes, notes_name: str, header: Header, outputs: Sequence[str]
) -> dict[str, str]:
    """Return the outputs with an unknown zero in the notes, and whether each run has its own."""
    free = {}
    for column in header.columns:
        zero = noted(notes.zero, column.written, stem(column.written), column.name)
        if zero not in (UNKNOWN, PER_RUN):
            continue
        if column.role != "output":
            raise UserError(
                f"{notes.at(notes_name, 'zero', column.written)}: 'zero' of '{column.written}' is '{zero}', which can "
                "be said of readings alone; give its value."
            )
        if column.name in outputs:
            free[column.name] = str(zero)
    return free


def _by_cycle(run: MeasuredRun) -> list[MeasuredRun]:
    """Return each cycle of a run as a separate run of the same specimen; a run of one cycle unchanged."""
    numbers = np.unique(run.cycle)
    if len(numbers) < 2:
        return [run]
    parts = [run.at(np.flatnonzero(run.cycle == number)) for number in numbers]
    return [
        replace(part, history=part.history.with_(run=f"{run.name} cycle {number:g}"))
        for number, part in zip(numbers, parts, strict=True)
    ]


def _let_go(runs: Sequence[MeasuredRun], stated: Mapping[str, LetGoConfig]) -> list[MeasuredRun]:
    """Mark the runs that begin deflected, with the first angle read, which may be left out later."""
    marked = []
    for run in runs:
        if (how := stated.get(run.name)) is not None:
            read = [run.outputs[name][0] for name in ("angle_rad", "angle_y_rad") if name in run.outputs]
            first = next((float(value) for value in read if np.isfinite(value)), None)
            bend = first if how.bend_rad is None else how.bend_rad
            run = replace(run, history=run.history.with_(let_go=LetGo(how.at_s, bend)))
        marked.append(run)
    return marked


def _gather(
    sheet: Sheet,
    header: Header,
    other: Elsewhere,
    gatherer: Gatherer,
    unwrapper: Unwrapper,
    progress: Progress,
) -> None:
    large = sheet.path.is_file() and sheet.path.stat().st_size > LARGE_FILE
    task = progress.begin(f"read {sheet.path.name}, rows", sheet.lines()) if large else Silent()
    run, specimen = (header.texts.get(name) for name in ("run", "specimen"))
    named = other.texts.get("run", sheet.path.stem)
    clock = next((column for column in header.columns if column.role == "time"), None)
    try:
        for block in sheet.blocks():
            count = len(block.lines)
            numbers = [c.written_values(block, header.places[c.written]) for c in header.columns]
            runs = (named,) * count if run is None else block.texts(run)
            specimens = None if specimen is None else block.texts(specimen)
            if "specimen" in other.texts:
                specimens = (other.texts["specimen"],) * count
            if other.specimens:
                before = specimens or ("",) * count
                pairs = zip(runs, before, strict=True)
                specimens = tuple(other.specimens.get(name.strip(), body) for name, body in pairs)
            numbers = unwrapper.unwrap(numbers, runs)
            times = None
            if clock is not None:
                times = clock.scale * numbers[header.columns.index(clock)] + clock.shift
            if other.columns:
                numbers += other.values(times, runs)
            gatherer.add(np.column_stack(numbers), block.lines, runs, specimens)
            task.advance(count)
    finally:
        task.finish()


def _chosen(path: Path, header: Header, wanted: Sequence[str], where: str) -> list[str]:
    have = header.names("output")
    called = _called(header)
    wanted = [called.get(name, name) for name in wanted]
    for name in wanted:
        if name not in have:
            raise UserError(
                f"{where}: the study asks for output '{name}', which {path.name} does not have{closest(name, have)} "
                f"It has {', '.join(have)}."
            )
    return list(dict.fromkeys(wanted)) or have


def _called(header: Header) -> dict[str, str]:
    """Return Pliant's name of each column by the file's, with and without the trailing unit."""
    return {name: column.name for column in header.columns for name in (column.written, stem(column.written))}


def _stated(
    notes: MeasurementNotes, notes_name: str, outputs: Sequence[str], header: Header
) -> dict[str, float]:
    """Return standard deviations of sensors in SI, from the notes, by the file's names or Pliant's."""
    stated = {}
    called = _called(header)
    for written, value in notes.sigma.items():
        name, where = written, notes.at(notes_name, "sigma", written)
        name = called.get(name, name).removeprefix("sigma_")
        if not outputs_among([name]):
            raise UserError(f"{where}: 'sigma' has '{name}', which is not an output{closest(name, outputs)}")
        try:
            number = value if isinstance(value, float) else parse_quantity(value, column_si_unit(name))
        except UnitError as error:
            raise UserError(f"{where}: sigma of '{name}': {error}.") from None
        if not 0 < number < np.inf:
            raise UserError(f"{where}: sigma of '{name}' is {value}; it should be above 0.")
        stated[name] = number
    return stated


def _run(
    rows: RunRows, header: Header, outputs: Sequence[str], stated: Mapping[str, float], path: Path
) -> MeasuredRun:
    """Return the run in SI; entirely blank conditions take their defaults, rows that lack one are left out."""
    table = np.concatenate(rows.parts)
    lines = table[:, -1].astype(int)
    columns = {
        c.name: c.scale * values + c.shift if c.scale != 1 or c.shift else values
        for c, values in zip(header.every, table.T[:-1], strict=True)
    }
    silent = [name for name in header.names("condition") if np.isnan(columns[name]).all()]
    good = np.ones(len(lines), bool)
    for name in header.names("condition"):
        good &= ~np.isnan(columns[name]) | (name in silent)
    columns = {name: values[good] for name, values in columns.items() if name not in silent}
    lines, n = lines[good], int(good.sum())

    def column(name: str, default: float = 0.0) -> Array:
        return columns.get(name, np.full(n, default))

    def check(bad: Any, problem: str) -> None:
        if bad.any():
            raise UserError(f"{path}, {lines_text(lines[bad].tolist())}: {problem}")

    valve = column("valve_open", 1.0)
    problem = "valve_open should be 1 (chambers connected to the supply) or 0 (closed off)."
    check((valve != 0.0) & (valve != 1.0), problem)
    sigma = {}
    for name in outputs:  # row by row before those of the whole sensor
        values = column(f"sigma_{name}", np.nan)
        check(values <= 0, f"sigma_{name} should be above 0; leave it blank otherwise.")
        values = np.where(np.isnan(values), stated.get(name, np.nan), values)
        if not np.isnan(values).all():
            sigma[name] = values
    history = History(
        run=rows.name,
        specimen=rows.specimen,
        time_s=columns.get("time_s"),
        actuation={name: columns[name] for name in header.names("input")},
        tip_force_n=np.column_stack([column(name) for name in FORCES]),
        moment_n_m=column("moment_n_m"),
        temperature_c=column("temperature_c", REFERENCE_TEMPERATURE_C),
        base_angles_rad=np.column_stack([column(name) for name in BASE]),
        payload_kg=columns.get("payload_kg"),
        valve_open=columns.get("valve_open"),
    )
    readings = {name: columns[name] for name in outputs}
    return MeasuredRun(history, readings, sigma, column("cycle", np.nan), lines)


def without_excluded(
    runs: Sequence[MeasuredRun], exclude: Sequence[tuple[ExcludedSpan, str]], said: list[str]
) -> list[MeasuredRun]:
    """Return runs with the readings of excluded spans set to missing, so that the model still simulates them.

    Whole runs are removed. `exclude`: each span with where it was written.
    """
    kept = list(runs)
    for span, where in exclude:
        index = next((i for i, run in enumerate(kept) if run.name == span.run), None)
        if index is None:
            raise UserError(
                f"{where}: 'exclude' names run '{span.run}', which is not there"
                f"{closest(span.run, [run.name for run in runs])}"
            )
        run, why = kept[index], f" ({span.why})" if span.why else ""
        if span.whole_run:
            said.append(
                f"Run '{span.run}' is left out{why}, and with it what it did to the specimen; give 'start' and 'end' "
                "to keep its inputs."
            )
            del kept[index]
            continue
        if span.lines is not None:
            inside = (run.lines >= span.lines[0]) & (run.lines <= span.lines[1])
        elif run.history.time_s is None:
            raise UserError(
                f"{where}: run '{run.name}' has no time_s; give 'lines: [first, last]' to exclude a part."
            )
        else:
            start = -np.inf if span.start_s is None else span.start_s
            end = np.inf if span.end_s is None else span.end_s
            inside = (run.history.time_s >= start) & (run.history.time_s <= end)
        samples = plural(int(inside.sum()), "sample")
        said.append(f"{samples} of run '{span.run}' not compared{why}; inputs are kept.")
        outputs = {name: np.where(inside, np.nan, values) for name, values in run.outputs.items()}
        kept[index] = run.with_outputs(outputs)
    return kept


def _look(runs: Sequence[MeasuredRun]) -> list[str]:
    """Return remarks on the values: constant inputs, a single run, runs without readings."""
    histories = [run.history for run in runs]
    remarks = [f"Input '{name}' {NEVER_CHANGES}" for name, width in spans(histories).items() if width == 0]
    if len(runs) == 1:
        remarks.append(ONE_RUN)
    silent = [run.name for run in runs if not any(np.isfinite(v).any() for v in run.outputs.values())]
    if silent:
        remarks.append(f"No reading in run {', '.join(silent[:10])}: only its inputs are followed.")
    return remarks


def _doubts(
    runs: Sequence[MeasuredRun],
    expected: Mapping[str, tuple[float, float]],
    notes_name: str,
    columns: Mapping[str, FileColumn],
) -> list[Doubt]:
    """Return doubts about columns whose values do not fit their stated quantity."""
    histories = [run.history for run in runs]
    doubts: list[Doubt] = []
    clock = columns.get("time_s")
    timed = [h.time_s for h in histories if h.time_s is not None and len(h) > 1]
    if timed and clock is not None and clock.in_unit == "s":
        whole = all(bool((t == np.round(t)).all()) for t in timed)
        step = float(np.median(np.concatenate([np.diff(t) for t in timed])))
        doubts += time_doubts(step, whole, notes_name, clock)
    largest: dict[str, float] = {}  # magnitude of each column
    for run in runs:
        for name, values in {**run.history.signals(), **run.outputs}.items():
            top = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
            largest[name] = max(largest.get(name, 0.0), top)
    inputs = sorted(histories[0].actuation, key=lambda name: -largest[name])
    for i, name in enumerate(inputs):
        if any(column_si_unit(name) == column_si_unit(other) for other in inputs[:i]):
            del largest[name]  # of inputs with the same unit only the largest is judged: the others may idle
    usual = {
        name: float(np.mean([np.nanmean(h.actuation[name]) for h in histories if len(h)])) for name in inputs
    }
    doubts += [*hour_doubts(runs, clock), *vacuum_doubts(usual, notes_name, columns)]
    doubts += implausible_columns(largest, expected, notes_name, columns)
    return doubts + sensor_doubts(runs, columns, notes_name)


def _line_doubts(
    runs: Sequence[MeasuredRun],
    columns: Mapping[str, FileColumn],
    lines: Mapping[str, Line],
    other: Elsewhere,
    notes: MeasurementNotes,
    notes_name: str,
) -> list[Doubt]:
    """Return a doubt for each input that takes a long straight line and may have held its value instead."""
    doubts = []
    for name, line in lines.items():
        column = columns[name]
        if noted(notes.hold, column.written, stem(column.written), name) is None:
            line = replace(
                line,
                **{end: column.scale * getattr(line, end) + column.shift for end in ("first", "last")},
            )
            remedy = f"hold: {{{as_key(column.written)}: true}}"
            doubts.append(
                line_doubt(column.written, line, partial(quantity_text, column=column), remedy, notes_name)
            )
    if other.joined is not None and notes.join is not None and notes.join.hold is None:
        for name, line in other.joined.long_lines([run.history for run in runs]).items():
            column = other.joined.columns[name]
            remedy = f"join: {{file: {notes.join.file}, hold: true}}"
            if notes.join.shift_s:
                remedy = remedy.replace("}", f", shift: {notes.join.shift_s:g} s}}")
            doubts.append(
                line_doubt(column.written, line, partial(quantity_text, column=column), remedy, notes_name)
            )
    return doubts


def _levels(notes: MeasurementNotes, notes_name: str, header: Header) -> Levels | None:
    """Return the levels of an input by which the notes define cycles, SI; None if they state none."""
    stated = notes.cycles
    if stated is None or isinstance(stated, str):
        return None
    inputs = [column for column in header.every if column.role == "input"]
    for column in inputs:
        if stated.of in (column.written, stem(column.written), column.name):
            where = f"{notes.at(notes_name, 'cycles')}: 'cycles'"
            low, high = (parse_si_value(one, column.unit, where) for one in (stated.low, stated.high))
            if not low < high:
                raise UserError(f"{where}: 'low' should be below 'high'.")
            return column.name, low, high
    names = [column.written for column in inputs]
    raise UserError(
        f"{notes.at(notes_name, 'cycles', 'of')}: 'cycles' are of '{stated.of}', which is no input"
        f"{closest(stated.of, names)}"
    )


def cycles(history: History, ranges: Mapping[str, float], levels: Levels | None = None) -> Array:
    """Return (t,) the cycle of each sample, from 1.

    A cycle is a rise of the actuation (the largest of all inputs, each from its lowest value in the run and over its
    range) above 60 % of the run's range after a return below 25 %: the two thresholds keep noise and small reversals
    from counting. The number changes where the rise begins. An idle input makes no cycle: its range in the run is
    sensor noise and below half of the largest range of any input with its unit in any run, or below a tenth of that.

    Args:
        history: the run.
        ranges: range of each input over all runs; a run that moves less than a tenth of it has one cycle.
        levels: an input with the values below which it has returned and above which it is loaded, instead.
    """
    if levels is not None:
        signal = np.asarray(history.actuation[levels[0]], float)
        low, width = float(signal.min()), max(float(np.ptp(signal)), 1e-300)
        returned, loaded = ((level - low) / width for level in levels[1:])
        return _risen(history, (signal - low) / width, returned, loaded)
    signal = np.zeros(len(history))
    for name, values in history.actuation.items():
        alike = max(width for other, width in ranges.items() if column_si_unit(other) == column_si_unit(name))
        idle = np.ptp(values) < SMALLER * alike and _is_noise(history, values)
        if np.ptp(values) > SMALLEST * alike and not idle:
            size = np.abs(values)
            signal = np.maximum(signal, (size - size.min()) / ranges[name])
    if np.ptp(signal) < SMALLEST:
        return np.ones(len(history), int)
    return _risen(history, (signal - signal.min()) / np.ptp(signal), RETURNED, LOADED)


def _risen(history: History, height: Array, returned: float, loaded: float) -> Array:
    """Return (t,) how often a height in [0, 1] has risen above `loaded` after a return below `returned`, from 1."""
    number = np.ones(len(height), int)
    state = np.where(height > loaded, 1, np.where(height < returned, -1, 0))
    marked = np.flatnonzero(state)
    if not len(marked):
        return number
    turns = marked[1:][np.diff(state[marked]) > 0]  # first samples that are loaded again
    if state[marked[0]] < 0:
        turns = turns[1:]  # the first rise belongs to cycle 1
    rest = AT_REST + VALLEY * _fast_noise(history, height)
    for turn in turns:  # from the last sample before the rise that is still as low as the valley
        first = int(np.flatnonzero(height[:turn] > loaded)[-1]) + 1
        valley = height[first:turn]
        low = valley <= min(float(valley.min()) + rest, returned)
        number[first + int(np.flatnonzero(low)[-1]) :] += 1
    return number


def _is_noise(history: History, values: Array) -> bool:
    """Return whether the variation of an input in a run is only the noise of its gauge."""
    return bool(np.ptp(values) < NOISE_RANGE * _fast_noise(history, values))


def _fast_noise(history: History, values: Array) -> float:
    """Return the standard deviation of fast noise; 0 with too few samples to separate it from a signal."""
    clock = np.arange(len(values), dtype=float) if history.time_s is None else history.time_s
    return float(np.sqrt(noise_variance(clock, values)[0])) if len(values) >= ENOUGH else 0.0


def spans(histories: Sequence[History]) -> dict[str, float]:
    """Return the range of each input over all histories."""
    spread = {}
    for name in dict.fromkeys(name for history in histories for name in history.actuation):
        values = [h.actuation[name] for h in histories if len(h)]
        spread[name] = float(max(v.max() for v in values) - min(v.min() for v in values))
    return spread
