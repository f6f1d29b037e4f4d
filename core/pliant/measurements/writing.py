"""Writer of measurements as the CSV that `read_measurement` reads back exactly."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.history import BASE, FORCES, REFERENCE_TEMPERATURE_C
from pliant.records.measurement import MeasuredRun, Measurement
from pliant.store.store import write_atomically

PLAIN = r"[\w.+-]+( [\w.+-]+)*"  # texts that need no quotes


def write_measurement(measurement: Measurement, path: Path | str) -> None:
    """Write runs, inputs, loads, conditions, readings and stated sigmas; NaN is blank, numbers are exact.

    Loads that are 0 everywhere, the reference temperature and a base that never rotates are left out. If the markers
    have positions, the YAML notes are written next to the CSV. Remarks are not kept.

    Raises `UserError` for a name that a CSV cannot contain, or if only some runs have a clock.
    """
    path = Path(path)
    clocks = {run.history.time_s is None for run in measurement.runs}
    if len(clocks) > 1:
        raise UserError(f"{path}: some runs have time_s and some have none; write them to two files.")
    tables = [_columns(run) for run in measurement.runs]
    order = [
        *("time_s", *(measurement.runs[0].history.actuation if tables else ()), "moment_n_m", *FORCES),
        *("payload_kg", "valve_open", "temperature_c", *BASE, "cycle", *measurement.outputs),
        *(f"sigma_{name}" for name in measurement.outputs),
    ]
    used = [name for name in order if any(name in t and _matters(name, t[name]) for t in tables)]
    specimens = any(run.history.specimen for run in measurement.runs)
    lines = [",".join(["run", *(["specimen"] if specimens else []), *used])]
    for run, table in zip(measurement.runs, tables, strict=True):
        texts = [_text(run.name, path)] + ([_text(run.history.specimen, path)] if specimens else [])
        missing = np.full(len(run), np.nan)
        for row in zip(*(table.get(name, missing).tolist() for name in used), strict=True):
            lines.append(",".join([*texts, *("" if value != value else repr(float(value)) for value in row)]))
    write_atomically(path, "\n".join(lines) + "\n")
    if measurement.marker_arms_m:
        arms = ", ".join(repr(float(arm)) for arm in measurement.marker_arms_m)
        aside = [list(map(float, offset)) for offset in measurement.marker_offsets_m]
        notes = f"markers_m: [{arms}]\n" + (f"marker_offsets_m: {aside}\n" if aside else "")
        write_atomically(path.with_suffix(".yaml"), notes)


def _columns(run: MeasuredRun) -> dict[str, Array]:
    return {
        **({} if run.history.time_s is None else {"time_s": run.history.time_s}),
        **run.history.signals(),
        "cycle": run.cycle,
        **run.outputs,
        **{f"sigma_{name}": values for name, values in run.sigma.items()},
    }


def _matters(name: str, values: Array) -> bool:
    """Return whether a column carries information that its absence would not."""
    if name in (*FORCES, *BASE, "moment_n_m"):
        return bool(np.any(values != 0))
    if name == "temperature_c":
        return bool(np.any(values != REFERENCE_TEMPERATURE_C))
    if name in ("payload_kg", "valve_open") or name.startswith("sigma_"):
        return bool(np.isfinite(values).any())
    return True


def _text(name: str, path: Path) -> str:
    if re.fullmatch(PLAIN, name):
        return name
    if name != name.strip() or re.search(r"[\r\n\x00]", name):
        raise UserError(
            f"{path}: '{name}' cannot be a name in a table; leave out line breaks and outer blanks."
        )
    return '"' + name.replace('"', '""') + '"' if name else ""
