"""Bench that a laboratory's own software runs: protocols go into a folder as files, recordings are waited for there."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from pliant.errors import UserError
from pliant.experiments.planned_run import NEW, PlannedRun
from pliant.experiments.protocol_file import write_protocol
from pliant.measurements.reading import read_measurement
from pliant.records.measurement import MeasuredRun
from pliant.units import Time
from pliant_bench.bench import (
    Bench,
    BenchChannel,
    BenchConfig,
    BenchProtocol,
    BenchRecording,
    BenchSample,
    ChannelCheck,
    Ending,
    RunStoppedError,
    Watch,
)
from pliant_bench.clock import Clock, RealClock
from pliant_bench.config import EnvelopeConfig, InputLimitsConfig
from pliant_bench.limits import check_protocol
from pliant_bench.plans import protocol_history

# Beside a recording: it is complete. In the folder: the software shall vent.
DONE, STOP = ".done", "STOP"
RECORDED = ".recorded"


class FilesConfig(BenchConfig):
    """Folder and channels of a bench that other software runs."""

    kind: Literal["files"] = "files"
    folder: Path = Field(examples=["bench"], description="where protocols and recordings lie")
    inputs: dict[str, InputLimitsConfig] = Field(
        min_length=1, description="every input with the limits of the bench"
    )
    outputs: dict[str, EnvelopeConfig] = Field(
        min_length=1, description="every output with the range of its sensor"
    )
    wait_s: Time = Field(3600.0, gt=0, description="longest wait for a recording, beyond the run's duration")
    stable_s: Time = Field(
        2.0, gt=0, description="a recording whose size has not changed for this long is complete"
    )
    poll_s: Time = Field(0.2, gt=0, description="time between two looks into the folder")


class FilesBench(Bench):
    """Writes ``NAME.csv`` and waits for ``NAME.recorded.csv`` or another table of this stem.

    A recording is complete when its size is stable, or at once when ``NAME.recorded.csv.done`` exists. The watch sees
    its samples when it is complete: nothing is watched while the run lasts, and the software has to keep its own
    limits. A file ``STOP`` in the folder asks the software to vent.
    """

    config: FilesConfig

    def __init__(self, config: FilesConfig) -> None:
        super().__init__(config)
        self.clock: Clock = RealClock()
        self.say: Callable[[str], None] = lambda sentence: print(sentence, file=sys.stderr)
        self._stopping = threading.Event()

    @property
    def inputs(self) -> tuple[BenchChannel, ...]:
        return tuple(BenchChannel(name, one.limits(name)) for name, one in self.config.inputs.items())

    @property
    def outputs(self) -> tuple[BenchChannel, ...]:
        return tuple(BenchChannel(name, one.limits(name)) for name, one in self.config.outputs.items())

    def connect(self) -> None:
        folder = self.config.folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
            (folder / STOP).unlink(missing_ok=True)
        except OSError as error:
            raise UserError(
                f"The folder {folder} cannot be used ({error.strerror}); state another one as bench: {{kind: files, "
                "folder: …}."
            ) from None

    def check(self) -> tuple[ChannelCheck, ...]:
        """Return every channel without a value: nothing is known before the first recording."""
        return tuple(ChannelCheck(channel.name, np.nan) for channel in (*self.inputs, *self.outputs))

    def run(self, protocol: BenchProtocol, watch: Watch) -> BenchRecording:
        check_protocol(protocol, self.limited_inputs)
        stem = self.config.folder / _file_name(protocol.name)
        if self._recording(stem) is not None:
            raise UserError(f"A recording {stem.name}{RECORDED}.* is there before the run; take it away.")
        self._stopping.clear()
        (self.config.folder / STOP).unlink(missing_ok=True)
        self._write(protocol, stem)
        self.say(
            f"Run '{protocol.name}' is in {stem.name}.csv. Waiting for {stem.name}{RECORDED}.csv in "
            f"{self.config.folder} (about {protocol.duration_s / 60:.1f} min; Ctrl-C ends the wait)."
        )
        try:
            path = self._wait(stem, protocol.duration_s)
        except RunStoppedError as stopped:
            return _recording(protocol, None, self.outputs, "stopped", str(stopped))
        except KeyboardInterrupt:
            self.stop()
            raise
        done = _recording(protocol, self._read(path, protocol), self.outputs)
        try:
            for sample in _samples(done):
                watch(sample)
        except RunStoppedError as stopped:
            return replace(done, ending="stopped", reason=str(stopped))
        return done

    def stop(self) -> None:
        try:
            (self.config.folder / STOP).touch()  # first, so that it is there when the run has ended
        except OSError as error:
            self.say(
                f"{self.config.folder / STOP} cannot be written ({error.strerror}): vent the bench by hand."
            )
        self._stopping.set()

    def close(self) -> None:
        pass

    def _write(self, protocol: BenchProtocol, stem: Path) -> None:
        specimen = NEW if protocol.new_specimen else ""
        history = protocol_history(protocol, list(protocol.commands), specimen)
        run = PlannedRun(protocol.name, protocol.words, history, round(protocol.duration_s / 60, 2))
        write_protocol(stem.with_name(f"{stem.name}.csv"), run, list(self.config.outputs))

    def _recording(self, stem: Path) -> Path | None:
        """Return the recording of a run, if there is one."""
        names = sorted(stem.parent.glob(f"{stem.name}{RECORDED}.*"))
        return next((path for path in names if path.suffix != DONE), None)

    def _wait(self, stem: Path, duration_s: float) -> Path:
        """Return the recording when it is complete.

        Raises:
            RunStoppedError: `stop` was called, or the wait is over.
        """
        config = self.config
        deadline_s = self.clock.now() + duration_s + config.wait_s
        size, stable_since_s = -1, self.clock.now()
        while True:
            path, now_s = self._recording(stem), self.clock.now()
            if path is not None:
                if path.with_name(path.name + DONE).exists():
                    return path
                now_size = path.stat().st_size
                if now_size != size:
                    size, stable_since_s = now_size, now_s
                elif size > 0 and now_s - stable_since_s >= config.stable_s:
                    return path
            if now_s > deadline_s:
                raise RunStoppedError(
                    f"No recording {stem.name}{RECORDED}.csv came within {config.wait_s:g} s."
                )
            if self.clock.sleep_until(now_s + config.poll_s, self._stopping):
                raise RunStoppedError("The run was stopped by the user.")

    def _read(self, path: Path, protocol: BenchProtocol) -> MeasuredRun:
        """Return the run of a recording; raise `UserError` if there is another number of runs, or no time."""
        measurement = read_measurement(path, actuation=None)
        if len(measurement.runs) != 1 or measurement.runs[0].history.time_s is None:
            raise UserError(
                f"{path} has {len(measurement.runs)} runs, with or without time; the recording of run "
                f"'{protocol.name}' needs one run with a column time_s."
            )
        missing = [name for name in self.config.outputs if name not in measurement.runs[0].outputs]
        if missing:
            raise UserError(
                f"{path} has no column {', '.join(missing)}, which the block bench states as outputs."
            )
        return measurement.runs[0]


def _file_name(run: str) -> str:
    """Return the name of a run as that of a file."""
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in run) or "run"


def _recording(
    protocol: BenchProtocol,
    run: MeasuredRun | None,
    outputs: tuple[BenchChannel, ...],
    ending: Ending = "complete",
    reason: str = "",
) -> BenchRecording:
    """Return the recording of a run; inputs that were not recorded are those of the protocol."""
    if run is None or run.history.time_s is None:
        empty = np.zeros(0)
        nothing = {channel.name: empty for channel in outputs}
        late = np.zeros(0, bool)
        return BenchRecording(
            protocol, empty, empty, dict.fromkeys(protocol.commands, empty), nothing, late, ending, reason
        )
    time_s = run.history.time_s - run.history.time_s[0]
    commands = {}
    for name, values in protocol.commands.items():
        planned = np.interp(time_s, protocol.time_s, values)
        read = run.input(name)
        commands[name] = np.where(np.isfinite(read), read, planned)
    readings = {channel.name: run.outputs[channel.name] for channel in outputs}
    return BenchRecording(
        protocol, time_s, time_s, commands, readings, np.zeros(len(time_s), bool), ending, reason
    )


def _samples(recording: BenchRecording) -> list[BenchSample]:
    """Return the samples of a recording; the index is that of the last instant of the protocol before each."""
    last = len(recording.protocol) - 1
    places = np.searchsorted(recording.protocol.time_s, recording.read_s + 1e-9, side="right") - 1
    return [
        BenchSample(
            int(min(max(place, 0), last)),
            float(recording.commanded_s[k]),
            float(recording.read_s[k]),
            {name: float(values[k]) for name, values in recording.commands.items()},
            {name: float(values[k]) for name, values in recording.readings.items()},
        )
        for k, place in enumerate(places)
    ]
