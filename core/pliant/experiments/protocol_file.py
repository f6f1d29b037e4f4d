"""A run as a file to fill in during the experiment: what to do when, with blank columns for readings.

Filled in, it is a measurement file like any other; together with the old file it is one measurement:
``pliant diagnose STUDY.yaml --data old.csv --data next_run.csv``.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from pliant.config.measurements import MeasurementNotes
from pliant.errors import UserError
from pliant.experiments.planned_run import PlannedRun
from pliant.measurements.written_units import column_as_written
from pliant.records.design import Array
from pliant.records.history import BASE, FORCES
from pliant.records.measurement import Measurement
from pliant.store.store import write_atomically

# Significant digits of a supply's setting.
DIGITS = 7


def write_protocol(
    path: Path,
    run: PlannedRun,
    outputs: Sequence[str],
    *,
    measurement: Measurement | None = None,
    notes: MeasurementNotes | None = None,
    study: str = "STUDY.yaml",
    data: Sequence[str] = (),
) -> None:
    """Write the run as a CSV whose comments are the order in words.

    Args:
        path: the file.
        run: what to do.
        outputs: what is read in every run; the outputs that this run adds are appended.
        measurement: the old one: its headings and units are the new file's, and the run and a new specimen get names
            that it does not have.
        notes: the study's renames and units, in which the file is written, because it will be read with them.
        study: its file, for the sentence on the next command.
        data: the old one's files, for the same sentence; the names that it was read under by default.

    Raises:
        UserError: the file cannot be written.
    """
    notes = notes or MeasurementNotes()
    columns = _columns(run, outputs)
    texts = {"run": _run_name(run, measurement), "specimen": _specimen(run, measurement)}
    written = {name: column_as_written(name, measurement, notes) for name in (*texts, *columns)}
    headings = {name: heading for name, (heading, _, _) in written.items()}
    header = list(headings.values())
    values = [(column - written[name][2]) / written[name][1] for name, column in columns.items()]
    blank = [name for name in (*notes.rename, *notes.units) if name not in header]
    blank = [name for name in dict.fromkeys(blank) if notes.rename.get(name, name) not in (*texts, *columns)]
    start = ",".join(_quoted(text) for text in texts.values())
    lines = [f"# {line}" for line in order(run, outputs, measurement, str(path), study, data, headings)]
    lines.append(",".join(map(_quoted, [*header, *blank])))
    for row in zip(*(column.tolist() for column in values), strict=True):
        cells = ("" if value != value else repr(float(f"{value:.{DIGITS}g}")) for value in row)
        lines.append(",".join([start, *cells, *("" for _ in blank)]))
    try:
        write_atomically(path, "\n".join(lines) + "\n")
    except OSError as error:
        raise UserError(f"{path} cannot be written ({error.strerror}); choose another folder.") from None


def order(
    run: PlannedRun,
    outputs: Sequence[str],
    measurement: Measurement | None,
    file: str,
    study: str,
    data: Sequence[str] = (),
    headings: Mapping[str, str] | None = None,
) -> list[str]:
    """Return the order in words, one sentence a line.

    `headings` are the columns' headings in the file if they are not Pliant's.
    """
    history, headed = run.history, lambda name: (headings or {}).get(name, name)
    temperature, angles = float(history.temperature_c[0]), np.rad2deg(history.base_angles_rad[0])
    there = "in these states" if history.time_s is None else "at these times"
    lines = [
        f"Run '{run.name}': {run.words}.",
        f"About {run.minutes:g} min with setting up{f'; needs {run.needs}' if run.needs else ''}.",
        "Specimen: a new one, never loaded before."
        if run.new_specimen
        else "Specimen: the one that was measured.",
        f"Temperature {temperature:g} °C; base roll {angles[0]:g}°, pitch {angles[1]:g}°, yaw {angles[2]:g}°.",
        f"Read {', '.join(dict.fromkeys(map(headed, (*outputs, *run.adds))))} {there} and fill in the blank columns; "
        "write down the drive, the load and the temperature as they were, where they differ.",
    ]
    if np.any(history.moment_n_m):
        lines.append(f"{headed('moment_n_m')} opposes the drive's torque; negative pushes along with it.")
    if history.valve_open is not None:
        lines.append(f"{headed('valve_open')} is 0 where the valve at the specimen is closed.")
    read = (data or (measurement.source or "OLD.csv").split(" + ")) if measurement is not None else ()
    given = " ".join(f"--data {shlex.quote(name)}" for name in (*read, file))
    return [*lines, f"Then: pliant diagnose {shlex.quote(study)} {given}"]


def _columns(run: PlannedRun, outputs: Sequence[str]) -> dict[str, Array]:
    """Return time, inputs, loads and conditions, then blank outputs; loads and rotations that are zero are left out."""
    history, missing = run.history, np.full(len(run.history), np.nan)
    forces = dict(zip(FORCES, history.tip_force_n.T, strict=True))
    turns = dict(zip(BASE, history.base_angles_rad.T, strict=True))
    found = {} if history.time_s is None else {"time_s": history.time_s}
    found |= dict(history.actuation)
    found |= {name: row for name, row in {"moment_n_m": history.moment_n_m, **forces}.items() if np.any(row)}
    if history.payload_kg is not None:
        found["payload_kg"] = history.payload_kg
    if history.valve_open is not None:
        found["valve_open"] = history.valve_open
    found["temperature_c"] = history.temperature_c
    found |= {name: row for name, row in turns.items() if np.any(row)}
    return found | dict.fromkeys((*outputs, *run.adds), missing)


def _run_name(run: PlannedRun, measurement: Measurement | None) -> str:
    taken = {one.name for one in measurement.runs} if measurement is not None else set()
    name, number = run.name, 2
    while name in taken:
        name, number = f"{run.name} {number}", number + 1
    return name


def _specimen(run: PlannedRun, measurement: Measurement | None) -> str:
    if not run.new_specimen:
        return run.history.specimen
    taken = {one.history.specimen for one in measurement.runs} if measurement is not None else set()
    name, number = "new", 2
    while name in taken:
        name, number = f"new {number}", number + 1
    return name


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if any(mark in text for mark in ',"\n') else text
