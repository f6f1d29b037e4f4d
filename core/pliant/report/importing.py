"""An imported recording as a document: doubts first, columns, runs, and the block that reads it again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.formatting import listed, number, output_unit, plural, seconds
from pliant.measurements.block import advised, block_text
from pliant.measurements.columns import column_si_unit as column_unit
from pliant.measurements.plausible import as_remark
from pliant.measurements.repeats import repeat_groups
from pliant.records.design import Array
from pliant.records.history import REFERENCE_TEMPERATURE_C
from pliant.records.measurement import Doubt, MeasuredRun, Measurement
from pliant.records.remark import Rank
from pliant.report.document import (
    Column,
    Document,
    Drawn,
    Section,
    Table,
    Warned,
    as_json,
    brief_table,
    drawn,
    page_table,
    picture,
    section,
)
from pliant.report.recording_charts import MOST_RUNS, recording_chart, recording_loops_chart
from pliant_tables.units import conversion, fits

RUNS_BRIEF = 12  # of the terminal's table
ALIKE = 0.01  # sampling rates with a smaller difference are equal
TITLE = "The measurements block"


@dataclass(frozen=True)
class ReadColumn:
    """A column of the file: its heading and unit there, Pliant's name, range in SI and in the file's unit."""

    heading: str
    unit: str
    name: str
    range: tuple[float, float]
    written_range: tuple[float, float]
    missing: int


@dataclass(frozen=True)
class ReadRun:
    """A run: samples, duration and sampling rate, cycles, conditions, and the run that it repeats."""

    name: str
    samples: int
    duration_s: float | None
    rate_hz: float | None
    cycles: int
    specimen: str
    conditions: str
    repeat_of: str | None


COLUMNS: tuple[Column[ReadColumn], ...] = (
    Column("heading", head="in the file", brief="in the file"),
    Column("unit", head="unit", brief="unit"),
    Column("name", head="read as", brief="read as"),
    Column("range"),
    Column("written_range", "", "from", "from", show=lambda span: number(span[0], 4)),
    Column("written_range", "", "to", "to", show=lambda span: number(span[1], 4)),
    Column("missing", head="missing", brief="missing"),
)
RUNS: tuple[Column[ReadRun], ...] = (
    Column("name", head="run", brief="run"),
    Column("samples", head="samples", brief="samples"),
    Column("duration_s", head="duration", brief="duration", show=seconds),
    Column("rate_hz", head="rate (Hz)", brief="Hz", show=3),
    Column("cycles", head="cycles", brief="cycles"),
    Column("specimen", head="specimen"),
    Column("conditions", head="set", brief="set"),
    Column("repeat_of", head="repeat of", brief="repeat of"),
)


def _warned(doubt: Doubt) -> Warned:
    """Return a doubt as a warning; sorted rows come first and need no decision."""
    return Warned(as_remark(doubt), rank=Rank.FLOOR if doubt.kind == "order" else Rank.UNIT)


def import_document(measurement: Measurement, block: Mapping[str, Any]) -> Document:
    """Return the document of `pliant import`; its JSON by the keys of docs/import_a_recording.md.

    Args:
        measurement: the one that was read.
        block: the keys of `measurements` that were used, `file` first.
    """
    columns, runs = read_columns(measurement), read_runs(measurement)
    doubts = [as_remark(doubt) for doubt in measurement.doubts]
    others = [remark for remark in measurement.remarks if remark not in doubts]
    said = [
        column for column in RUNS if any(map(column.plain_value, runs))
    ]  # without columns empty in all runs
    text = block_text(block, advised(measurement.remarks))
    sentence = _sentence(measurement, runs)
    more = f"… and {len(runs) - RUNS_BRIEF} more runs." if len(runs) > RUNS_BRIEF else ""
    return Document(
        kind="Pliant: a recording as it was understood",
        title=measurement.source or "given in memory",
        sentence=sentence,
        data={
            "data": measurement.source,
            "data_sha256": measurement.sha256,
            "n_samples": measurement.n_samples,
            "inputs": list(measurement.runs[0].history.actuation),
            "outputs": list(measurement.outputs),
            "doubts": [vars(doubt) for doubt in measurement.doubts],
            "columns": [as_json(COLUMNS, column) for column in columns],
            "runs": [as_json(RUNS, run) for run in runs],
            "remarks": others,
            "measurements": dict(block),
            "block": text,
        },
        brief=(brief_table(COLUMNS, columns), brief_table(said, runs[:RUNS_BRIEF], more)),
        warnings=(*map(_warned, measurement.doubts), *map(Warned, others)),
        closing=("", text, sentence),
        draw=lambda: _drawn(
            measurement,
            page_table("Columns", COLUMNS, columns, numeric=3),
            page_table("Runs", said, runs),
            text,
        ),
        footer=f"Recording: {measurement.source or 'given in memory'}. Ranges are in the units of the file",
        page="import.html",
    )


def read_columns(measurement: Measurement) -> list[ReadColumn]:
    """Return each column of numbers that was read, in the order of the file."""
    inputs = list(measurement.runs[0].history.actuation)
    headed = measurement.headed or {name: name for name in (*inputs, *measurement.outputs)}
    every = [_values(run) for run in measurement.runs]
    found = []
    for name, heading in headed.items():
        parts = [run[name] for run in every if name in run]
        if not parts:
            continue
        values = np.concatenate(parts)
        there = values[np.isfinite(values)]
        low, high = (float(there.min()), float(there.max())) if there.size else (np.nan, np.nan)
        unit = measurement.written.get(name, column_unit(name))
        known = fits(unit, column_unit(name))  # dates and frames are no unit: their range is in seconds
        scale, shift = conversion(unit, column_unit(name), heading) if known else (1.0, 0.0)
        written = sorted(((low - shift) / scale, (high - shift) / scale))
        missing = int(values.size - there.size)
        found.append(ReadColumn(heading, unit, name, (low, high), (written[0], written[1]), missing))
    return found


def _values(run: MeasuredRun) -> dict[str, Array]:
    """Return all columns of a run by Pliant's names, SI."""
    time = {} if run.history.time_s is None else {"time_s": run.history.time_s}
    sigma = {f"sigma_{name}": values for name, values in run.sigma.items()}
    return {**time, **run.history.signals(), "cycle": run.cycle, **run.outputs, **sigma}


def read_runs(measurement: Measurement) -> list[ReadRun]:
    """Return each run in the order of recording."""
    names = [run.name for run in measurement.runs]
    first = {k: names[group.runs[0]] for group in repeat_groups(measurement) for k in group.runs[1:]}
    found = []
    for k, run in enumerate(measurement.runs):
        time = run.history.time_s if len(run) > 1 else None
        found.append(
            ReadRun(
                run.name,
                len(run),
                float(time[-1] - time[0]) if time is not None else None,
                float(1.0 / np.median(np.diff(time))) if time is not None else None,
                int(np.unique(run.cycle[np.isfinite(run.cycle)]).size),
                run.history.specimen,
                ", ".join(_conditions(run)),
                first.get(k),
            )
        )
    return found


def _conditions(run: MeasuredRun) -> Iterator[str]:
    """Yield loads and conditions that are not the default ones: "payload 20 g", "temperature 22 to 25 °C"."""
    for name, values in run.history.signals().items():
        usual = REFERENCE_TEMPERATURE_C if name == "temperature_c" else 1.0 if name == "valve_open" else 0.0
        if name in run.history.actuation or not (values != usual).any():
            continue
        unit = output_unit(name)
        low, high = (number(end * unit.factor, 3) for end in (values.min(), values.max()))
        yield f"{unit.label} {unit.attached(low if low == high else f'{low} to {high}')}"


def _sentence(measurement: Measurement, runs: list[ReadRun]) -> str:
    """Return "2 runs, 122 readings of bend angle over pressure, 25 Hz; 1 doubt"."""
    outputs = listed(list(dict.fromkeys(output_unit(name).label for name in measurement.outputs)))
    inputs = listed([output_unit(name).label for name in measurement.runs[0].history.actuation])
    rates = [run.rate_hz for run in runs if run.rate_hz is not None]
    low, high = (min(rates), max(rates)) if rates else (0.0, 0.0)
    rate = number(high, 3) if high - low <= ALIKE * high else f"{number(low, 3)} to {number(high, 3)}"
    clock = f"{rate} Hz" if rates else "without time"
    doubts = plural(len(measurement.doubts), "doubt") if measurement.doubts else "nothing doubtful"
    readings = plural(measurement.n_samples, "reading")
    return f"{plural(len(runs), 'run')}, {readings} of {outputs} over {inputs}, {clock}; {doubts}."


def _drawn(measurement: Measurement, columns: Table, runs: Table, block: str) -> Drawn:
    count = len(measurement.runs)
    shown = f"the first {MOST_RUNS} of {count} runs" if count > MOST_RUNS else "every run"
    over_time = picture(
        "recording", f"Readings and inputs of {shown} over time.", recording_chart(measurement)
    )
    over_input = picture("loops", f"Readings of {shown} over the input.", recording_loops_chart(measurement))
    return drawn(
        over_time,
        section("Columns", columns, open=True),
        section("Runs", runs),
        section("Readings over the input", over_input),
        Section(
            TITLE,
            code=block,
            note="Paste it into a study; or its lines without 'file' into a YAML of the same name beside the file.",
            open=True,
        ),
    )
