"""Gathered rows become a measurement: SI, defaults, stated sigmas, exclusions, and what is to be said of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pliant.config.measurements import ExcludedSpan, MeasurementNotes
from pliant.errors import UserError, closest
from pliant.formatting import plural
from pliant.measurements.columns import is_output, unit_of
from pliant.measurements.cycles import cycles, spans
from pliant.measurements.gathering import Gatherer, RunRows
from pliant.measurements.header import Header
from pliant.measurements.plausible import out_of_range, time_remarks
from pliant.records.design import Array
from pliant.records.history import REFERENCE_TEMPERATURE_C, History
from pliant.records.measurement import MeasuredRun, Measurement
from pliant.tabular.text import lines_text
from pliant.units import UnitError, parse_quantity

FORCES = ("tip_force_x_n", "tip_force_y_n", "tip_force_z_n")
BASE = ("base_roll_rad", "base_pitch_rad", "base_yaw_rad")
# Remarks on a file by itself, which files that are read together do not deserve.
ONE_RUN = "There is one run only: nothing repeats, and no run can be held out."
NEVER_CHANGES = "never changes: nothing that depends on it can be judged."
DEFAULTS = {
    "temperature_c": f"{REFERENCE_TEMPERATURE_C:g} °C",
    "payload_kg": "the chain's own",
    "cycle": "counted",
    "valve_open": "1",
}


def assembled(
    path: Path,
    gatherer: Gatherer,
    header: Header,
    notes: MeasurementNotes,
    notes_name: str,
    wanted: Sequence[str],
    expected: Mapping[str, tuple[float, float]],
    remarks: Sequence[str],
) -> Measurement:
    """The measurement of a file's rows; raises `UserError` for notes that name what the file does not have."""
    said = list(remarks)
    outputs = _chosen(path, header, wanted)
    said += _condition_remarks(gatherer)
    sigma = _stated(notes, notes_name, outputs)
    runs = [_run(rows, header, outputs, sigma, path) for rows in gatherer.runs if rows.kept]
    said += [f"Run '{rows.name}' has no row that can be used." for rows in gatherer.runs if not rows.kept]
    runs = [run for run in runs if len(run)]
    runs = _counted(runs, header)
    runs, spoken = _excluded(runs, notes.exclude, notes_name)
    said += spoken
    read = [name for name in outputs if any(np.isfinite(run.outputs[name]).any() for run in runs)]
    if not read:
        raise UserError(f"{path}: no reading is left of {', '.join(outputs)}: all are blank, or left out.")
    said += [f"Output '{name}' has no reading and is ignored." for name in outputs if name not in read]
    runs = [_only(run, read) for run in runs]
    measurement = Measurement(tuple(runs), tuple(read), path.name, tuple(said), notes.markers_m)
    return replace(measurement, remarks=(*said, *_look(measurement, expected, notes_name)))


def _chosen(path: Path, header: Header, wanted: Sequence[str]) -> list[str]:
    have = header.names("output")
    for name in wanted:
        if name not in have:
            raise UserError(
                f"{path}: the study asks for output '{name}', which the file does not have{closest(name, have)} "
                f"It has {', '.join(have)}."
            )
    return list(dict.fromkeys(wanted)) or have


def _stated(notes: MeasurementNotes, notes_name: str, outputs: Sequence[str]) -> dict[str, float]:
    """Standard deviations of sensors in SI, from the notes."""
    stated = {}
    for name, value in notes.sigma.items():
        name = name.removeprefix("sigma_")
        if not is_output(name):
            raise UserError(
                f"{notes_name}: 'sigma' has '{name}', which is not an output{closest(name, outputs)}"
            )
        try:
            number = value if isinstance(value, float) else parse_quantity(value, unit_of(name))
        except UnitError as error:
            raise UserError(f"{notes_name}: sigma of '{name}': {error}.") from None
        if not 0 < number < np.inf:
            raise UserError(f"{notes_name}: sigma of '{name}' is {value}; it should be above 0.")
        stated[name] = number
    return stated


def _run(
    rows: RunRows, header: Header, outputs: Sequence[str], stated: Mapping[str, float], path: Path
) -> MeasuredRun:
    table, lines = rows.table()
    columns = {
        column.name: column.scale * table[:, i] + column.shift
        if column.scale != 1 or column.shift
        else table[:, i]
        for i, column in enumerate(header.columns)
    }
    conditions = header.names("condition")
    silent = [name for name in conditions if np.isnan(columns[name]).all()]
    good = np.ones(len(lines), bool)
    for name in conditions:
        good &= ~np.isnan(columns[name]) | (name in silent)
    columns = {name: values[good] for name, values in columns.items() if name not in silent}
    _check_valve(columns, lines[good], path)
    history = _history(rows, columns, header, int(good.sum()))
    sigma = _sigma(columns, outputs, stated, lines[good], path)
    nothing = np.full(len(history), np.nan)
    return MeasuredRun(
        history,
        {name: columns[name] for name in outputs},
        sigma,
        columns.get("cycle", nothing),
        lines[good],
    )


def _history(rows: RunRows, columns: Mapping[str, Array], header: Header, n: int) -> History:
    def column(name: str, default: float = 0.0) -> Array:
        return columns[name] if name in columns else np.full(n, default)

    return History(
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


def _check_valve(columns: Mapping[str, Array], lines: Array, path: Path) -> None:
    valve = columns.get("valve_open", np.ones(len(lines)))
    bad = lines[(valve != 0.0) & (valve != 1.0)]
    if bad.size:
        raise UserError(
            f"{path}, {lines_text(bad.tolist())}: valve_open should be 1 (chambers connected to the supply) or 0 "
            "(closed off)."
        )


def _sigma(
    columns: Mapping[str, Array],
    outputs: Sequence[str],
    stated: Mapping[str, float],
    lines: Array,
    path: Path,
) -> dict[str, Array]:
    """Stated standard deviations, row by row before those of the whole sensor."""
    found = {}
    for name in outputs:
        values = columns.get(f"sigma_{name}", np.full(len(lines), np.nan))
        bad = lines[values <= 0]
        if bad.size:
            raise UserError(
                f"{path}, {lines_text(bad.tolist())}: sigma_{name} should be above 0; leave it blank otherwise."
            )
        values = np.where(np.isnan(values), stated.get(name, np.nan), values)
        if not np.isnan(values).all():
            found[name] = values
    return found


def _counted(runs: Sequence[MeasuredRun], header: Header) -> list[MeasuredRun]:
    """Cycle numbers from the actuation where the file does not give all of a run's."""
    ranges = spans([run.history for run in runs])
    return [
        replace(run, cycle=cycles(run.history, ranges)) if np.isnan(run.cycle).any() else run for run in runs
    ]


def _excluded(
    runs: Sequence[MeasuredRun], exclude: Sequence[ExcludedSpan], notes_name: str
) -> tuple[list[MeasuredRun], list[str]]:
    """Readings of spans become missing, so that the model still lives through them; whole runs go."""
    kept, said = list(runs), []
    for span in exclude:
        index = next((i for i, run in enumerate(kept) if run.name == span.run), None)
        if index is None:
            raise UserError(
                f"{notes_name}: 'exclude' names run '{span.run}', which is not there"
                f"{closest(span.run, [run.name for run in runs])}"
            )
        why = f" ({span.why})" if span.why else ""
        if span.whole_run:
            said.append(
                f"Run '{span.run}' is left out{why}, and with it what it did to the specimen; give 'start' and 'end' "
                "to keep its inputs."
            )
            del kept[index]
            continue
        inside = _inside(kept[index], span, notes_name)
        said.append(
            f"{plural(int(inside.sum()), 'sample')} of run '{span.run}' not compared{why}; inputs are kept."
        )
        kept[index] = kept[index].with_outputs(
            {name: np.where(inside, np.nan, values) for name, values in kept[index].outputs.items()}
        )
    return kept, said


def _inside(run: MeasuredRun, span: ExcludedSpan, notes_name: str) -> Array:
    if span.lines is not None:
        clock, start, end = run.lines, float(span.lines[0]), float(span.lines[1])
    elif run.history.time_s is not None:
        clock = run.history.time_s
        start = -np.inf if span.start_s is None else span.start_s
        end = np.inf if span.end_s is None else span.end_s
    else:
        raise UserError(
            f"{notes_name}: run '{run.name}' has no time_s; give 'lines: [first, last]' to exclude a part."
        )
    return np.asarray((clock >= start) & (clock <= end))


def _only(run: MeasuredRun, names: Sequence[str]) -> MeasuredRun:
    return replace(
        run,
        outputs={name: run.outputs[name] for name in names},
        sigma={name: run.sigma[name] for name in names if name in run.sigma},
    )


def _condition_remarks(gatherer: Gatherer) -> list[str]:
    """Blank loads and conditions: the default where a run has none at all, else rows that are left out."""
    remarks = []
    for column in gatherer.columns:
        blanks = gatherer.blanks.get(column.name)
        if blanks is None or column.role not in ("condition", "cycle"):
            continue
        default = DEFAULTS.get(column.name, "0")
        if column.role == "cycle":
            remarks.append(
                f"cycle is blank in {plural(blanks.count, 'row')}: it is counted from the actuation in those runs."
            )
            continue
        silent = [run for run, count in blanks.of_run.items() if count >= gatherer.runs[run].count]
        if silent:
            remarks.append(
                f"{column.name} is blank throughout {plural(len(silent), 'run')}: taken as {default} there."
            )
        partly = blanks.count - sum(blanks.of_run[run] for run in silent)
        if partly:
            remarks.append(
                f"{column.name} is blank in {plural(partly, 'row')} of runs that have it elsewhere "
                f"({lines_text(blanks.lines, blanks.count)}): left out; write {default} where that is meant."
            )
    return remarks


def _look(
    measurement: Measurement, expected: Mapping[str, tuple[float, float]], notes_name: str
) -> list[str]:
    """What the values themselves make one ask."""
    histories = [run.history for run in measurement.runs]
    ranges = spans(histories)
    remarks = [f"Input '{name}' {NEVER_CHANGES}" for name, width in ranges.items() if width == 0]
    if len(measurement.runs) == 1:
        remarks.append(ONE_RUN)
    silent = [
        run.name for run in measurement.runs if not any(np.isfinite(v).any() for v in run.outputs.values())
    ]
    if silent:
        remarks.append(f"No reading in run {', '.join(silent[:10])}: only its inputs are followed.")
    timed = [h.time_s for h in histories if h.time_s is not None and len(h) > 1]
    if timed:
        whole = all(bool((t == np.round(t)).all()) for t in timed)
        step = float(np.median(np.concatenate([np.diff(t) for t in timed])))
        remarks += time_remarks(step, whole, notes_name)
    remarks += out_of_range(_largest(measurement), expected, notes_name)
    return remarks


def _largest(measurement: Measurement) -> dict[str, float]:
    """Largest magnitude of each column. Of inputs with the same unit only the largest: the others may idle."""
    largest: dict[str, float] = {}

    def note(name: str, values: Array) -> None:
        top = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
        largest[name] = max(largest.get(name, 0.0), top)

    for run in measurement.runs:
        history = run.history
        for name, values in (*history.actuation.items(), *run.outputs.items()):
            note(name, values)
        for name, values in zip(
            (*FORCES, *BASE), (*history.tip_force_n.T, *history.base_angles_rad.T), strict=True
        ):
            note(name, values)
        note("moment_n_m", history.moment_n_m)
        note("temperature_c", history.temperature_c)
        if history.payload_kg is not None:
            note("payload_kg", history.payload_kg)
    inputs = sorted(measurement.runs[0].history.actuation, key=lambda name: -largest[name])
    for i, name in enumerate(inputs):
        if any(unit_of(name) == unit_of(other) for other in inputs[:i]):
            del largest[name]
    return largest
