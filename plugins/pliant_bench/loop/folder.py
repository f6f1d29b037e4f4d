"""Folder of an experiment: every plan, sample, recording and verdict is on disk before the next step.

::

    experiment.json           study, bench and settings that began it
    run_01/plan.json          what is asked for, and why
    run_01/protocol.csv       the commands, one row per instant
    run_01/expected.csv       expected readings, of the explanation so far and of the study's own model
    run_01/samples.csv        what the bench did and read, one row per sample, written as it comes in
    run_01/recording_01.csv   the samples as a measurement file
    run_01/recording.json     how the run ended; present once the recording is complete
    run_01/verdict.json       the diagnosis after this run
    run_01/compared.csv       the run with and without the explanation of the last diagnosis
    run_01/end.json           why a stable verdict has no further run to meet
    status.json               what is being done now, for a live view
    stop                      present while somebody asks for a stop (the red button)
"""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.plain_values import plain
from pliant.store.store import write_atomically
from pliant_bench.bench import BenchProtocol, BenchRecording, BenchSample
from pliant_bench.watchdog import Expectation

FORMAT = 1
RUN = re.compile(r"run_(\d+)")
OWN_COLUMNS = ("index", "commanded_s", "read_s", "late")


@dataclass(frozen=True)
class RoundFolder:
    """Files of one run."""

    path: Path
    number: int

    def read(self, name: str) -> dict[str, Any] | None:
        """Return a JSON file of the run; None if it is not there yet."""
        return read_json(self.path / f"{name}.json")

    def write(self, name: str, values: Mapping[str, Any]) -> None:
        """Write a JSON file of the run."""
        write_json(self.path / f"{name}.json", values)

    @property
    def samples(self) -> Path:
        """Return the file of the samples."""
        return self.path / "samples.csv"

    @property
    def recording(self) -> Path:
        """Return the measurement file."""
        return self.path / f"recording_{self.number:02d}.csv"

    @property
    def is_recorded(self) -> bool:
        """Return whether the run has ended and its recording is written."""
        return (self.path / "recording.json").exists()

    def write_plan(self, protocol: BenchProtocol, plan: Mapping[str, Any]) -> None:
        """Write the protocol and why it was chosen; the plan comes last, so that a plan has its protocol."""
        self.path.mkdir(parents=True, exist_ok=True)
        write_columns(self.path / "protocol.csv", {"time_s": protocol.time_s, **protocol.commands})
        own = {
            "name": protocol.name,
            "words": protocol.words,
            "conditions": dict(protocol.conditions),
            "new_specimen": protocol.new_specimen,
        }
        self.write("plan", own | dict(plan))

    def read_protocol(self) -> BenchProtocol:
        """Return the protocol of the plan."""
        plan = self.read("plan") or {}
        commands = read_columns(self.path / "protocol.csv")
        clock = commands.pop("time_s")
        return BenchProtocol(
            plan["name"], plan["words"], clock, commands, plan["conditions"], plan["new_specimen"]
        )

    def read_recording(self) -> BenchRecording:
        """Return what the bench did, from the samples; without samples an empty recording."""
        protocol, ended = self.read_protocol(), self.read("recording") or {}
        plan = self.read("plan") or {}
        asked = replace(protocol, conditions={**plan.get("setting", {}), **protocol.conditions})
        columns = read_columns(self.samples) if self.samples.exists() else {}
        empty = np.zeros(0)
        outputs = [name for name in columns if name not in (*OWN_COLUMNS, *protocol.commands)]
        return BenchRecording(
            asked,
            columns.get("commanded_s", empty),
            columns.get("read_s", empty),
            {name: columns.get(name, empty) for name in protocol.commands},
            {name: columns[name] for name in outputs},
            columns.get("late", empty) > 0.5,
            ended.get("ending", "lost"),
            ended.get("reason", ""),
        )

    def write_expected(self, expected: Expectation, clock: Array) -> None:
        """Write the expected readings of the run at the instants of its protocol, SI."""
        columns: dict[str, Array] = {"time_s": clock}
        unknown = np.full(len(clock), np.nan)
        for name, mean in expected.mean.items():
            band = expected.band.get(name, unknown)
            columns |= {name: mean, f"{name} sd": expected.sd[name]}
            columns |= {f"{name} before": expected.before.get(name, mean), f"{name} before sd": unknown}
            columns |= {f"{name} after": mean, f"{name} after sd": band}
        write_columns(self.path / "expected.csv", columns)
        self.write("expected", {"explanation": expected.explanation})

    def read_expected(self) -> dict[str, Array]:
        """Return the columns of the expected readings; empty without them."""
        path = self.path / "expected.csv"
        return read_columns(path) if path.exists() else {}


@dataclass(frozen=True)
class ExperimentFolder:
    """The folder of an experiment."""

    path: Path

    def begin(self, begun: Mapping[str, Any]) -> bool:
        """Write what began the experiment; return whether it is resumed.

        Raises:
            UserError: the folder has an experiment of another study or bench.
        """
        path = self.path / "experiment.json"
        earlier = read_json(path)
        if earlier is None:
            write_json(path, {"format": FORMAT, **begun})
            return False
        differs = [key for key, value in begun.items() if earlier.get(key) != value]
        if differs:
            raise UserError(
                f"{self.path} has an experiment with another {differs[0]}; give another --out, or the study as it was."
            )
        return True

    def rounds(self) -> list[RoundFolder]:
        """Return the runs that have a plan, in their order."""
        numbered = [(int(m[1]), p) for p in self.path.glob("run_*") if (m := RUN.fullmatch(p.name))]
        return [RoundFolder(p, n) for n, p in sorted(numbered) if (p / "plan.json").exists()]

    def next_round(self) -> RoundFolder:
        """Return the folder of the next run, which is not there yet."""
        number = max((one.number for one in self.rounds()), default=0) + 1
        return RoundFolder(self.path / f"run_{number:02d}", number)

    def recordings(self) -> list[Path]:
        """Return the measurement files of the runs that have readings, in their order."""
        return [one.recording for one in self.rounds() if one.recording.exists()]

    @property
    def stop_file(self) -> Path:
        """Return the file whose presence stops a run."""
        return self.path / "stop"

    def write_status(self, **status: Any) -> None:
        """Write what is being done, for a live view."""
        write_json(self.path / "status.json", status)


class SampleLog:
    """Writer of the samples of a run, each one flushed before the next instant."""

    def __init__(self, path: Path, protocol: BenchProtocol, outputs: tuple[str, ...]) -> None:
        self._inputs, self._outputs = tuple(protocol.commands), outputs
        self._file: TextIO = path.open("w", encoding="utf-8", newline="")
        self._writer = csv.writer(self._file, lineterminator="\n")
        self._writer.writerow([*OWN_COLUMNS, *self._inputs, *outputs])

    def write(self, sample: BenchSample) -> None:
        """Write one sample."""
        values = [sample.commands.get(name, np.nan) for name in self._inputs]
        values += [sample.readings.get(name, np.nan) for name in self._outputs]
        cells = ["" if value != value else repr(float(value)) for value in values]
        times = ["" if t != t else f"{t:.6f}" for t in (sample.commanded_s, sample.read_s)]
        self._writer.writerow([sample.index, *times, int(sample.late), *cells])
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def write_columns(path: Path, columns: Mapping[str, Array]) -> None:
    """Write columns of equal length as CSV; a value that is not finite is a blank cell."""
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(columns)
    for row in zip(*(values.tolist() for values in columns.values()), strict=True):
        writer.writerow(["" if value != value else repr(value) for value in row])
    write_atomically(path, table.getvalue())


class GrowingColumns:
    """Columns of a CSV of numbers to which a program appends: each call reads the lines that are new.

    A blank cell is NaN. A last line without its end is read when it is complete.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._read_bytes = path, 0
        self._columns: dict[str, list[float]] = {}

    def read(self) -> Mapping[str, Sequence[float]]:
        """Return all columns so far; none where the file does not exist. A shorter file than before is read again."""
        if not self._path.exists():
            return {}
        with self._path.open("rb") as file:
            if file.seek(0, io.SEEK_END) < self._read_bytes:  # the file was replaced
                self._read_bytes, self._columns = 0, {}
            file.seek(self._read_bytes)
            data = file.read()
        whole = data[: data.rfind(b"\n") + 1]
        self._read_bytes += len(whole)
        rows = list(csv.reader(whole.decode().splitlines()))
        if rows and not self._columns:
            self._columns = {name: [] for name in rows.pop(0)}
        for row in rows:
            if len(row) == len(self._columns):
                for column, cell in zip(self._columns.values(), row, strict=True):
                    column.append(float(cell) if cell else math.nan)
        return self._columns


def read_columns(path: Path) -> dict[str, Array]:
    """Return the columns of a CSV of numbers; a blank cell is NaN, and a last line that was cut off is left out."""
    return {name: np.array(values, float) for name, values in GrowingColumns(path).read().items()}


def write_recording(
    path: Path, recording: BenchRecording, run: str, specimen: str, conditions: Mapping[str, float]
) -> int:
    """Write a measurement file of the samples that have a command; return their number.

    `time_s` is the time at which the inputs were set; a blank cell is an output that was not read.
    """
    inputs, outputs = list(recording.commands), list(recording.readings)
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(["run", "specimen", "time_s", *inputs, *conditions, *outputs])
    number, last = 0, -np.inf
    for k, time_s in enumerate(recording.commanded_s.tolist()):
        if not time_s > last:
            continue
        set_to = [repr(float(recording.commands[name][k])) for name in inputs]
        read = [recording.readings[name][k] for name in outputs]
        cells = ["" if value != value else repr(float(value)) for value in read]
        writer.writerow([run, specimen, f"{time_s:.6f}", *set_to, *map(repr, conditions.values()), *cells])
        number, last = number + 1, time_s
    write_atomically(path, table.getvalue())
    return number


def read_json(path: Path) -> dict[str, Any] | None:
    """Return the JSON object in a file; None if the file is not there."""
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except ValueError:
        raise UserError(
            f"{path} is not readable as JSON; remove its run's folder to do the run again."
        ) from None
    return found


def write_json(path: Path, values: Mapping[str, Any]) -> None:
    """Write a JSON object at once."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, json.dumps(plain(values), indent=1, allow_nan=False) + "\n")
