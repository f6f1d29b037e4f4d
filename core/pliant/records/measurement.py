"""Measurements: laboratory recordings, run by run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.history import History


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """One run: its inputs and readings.

    Attributes:
        history: inputs, loads and conditions.
        outputs: (t,) for each output of the measurement, SI; NaN without a reading.
        sigma: (t,) stated standard deviation for the outputs that have one; NaN if it is not stated.
        cycle: (t,) cycle number of the file, else counted from the actuation, from 1.
        lines: (t,) the line of each sample in the file; empty for data in memory.
    """

    history: History
    outputs: Mapping[str, Array]
    sigma: Mapping[str, Array]
    cycle: Array
    lines: Array

    @property
    def name(self) -> str:
        return self.history.run

    def __len__(self) -> int:
        return len(self.history)

    def input(self, name: str) -> Array:
        """Return (t,) an input by name; NaN if the run does not have it."""
        return np.asarray(self.history.actuation.get(name, np.full(len(self), np.nan)), float)

    def at(self, places: NDArray[np.intp]) -> MeasuredRun:
        """Return the run at some of its samples, with ascending indices (k,)."""
        return MeasuredRun(
            self.history.at_samples(places),
            {name: values[places] for name, values in self.outputs.items()},
            {name: values[places] for name, values in self.sigma.items()},
            self.cycle[places],
            self.lines[places] if len(self.lines) else self.lines,
        )

    def with_outputs(self, outputs: Mapping[str, Array]) -> MeasuredRun:
        """Return the run with other readings, otherwise unchanged."""
        return replace(self, outputs=dict(outputs))


@dataclass(frozen=True)
class Doubt:
    """A column that was read as stated but may have another meaning.

    Attributes:
        column: its name in the file.
        kind: unit, zero, beginning (in the middle of a motion), saturated, frozen, order (rows that were sorted),
            rate (stated without a clock), run (an unread column may name the runs), turn (an angle that begins again),
            hold (a straight line that may be a held value), clock (set forward by an hour) or sign (of a vacuum).
        sentence: the reason for the doubt, and the line of the notes that resolves it; it starts with the column.
    """

    column: str
    kind: str
    sentence: str


@dataclass(frozen=True)
class SensorFrame:
    """Rotation of the frame in which positions or pairs of bends are read; unknown without both.

    Attributes:
        quaternion: (w, x, y, z) that rotates world vectors to those of the camera.
        angle_rad: about the chain axis, from the module's y and z to the axes of a pair of bend sensors.
    """

    quaternion: tuple[float, float, float, float] | None = None
    angle_rad: float | None = None

    @property
    def unknown(self) -> bool:
        return self.quaternion is None and self.angle_rad is None


@dataclass(frozen=True, eq=False)
class Measurement:
    """Runs with the same outputs, in chronological order.

    Attributes:
        runs: see `MeasuredRun`.
        outputs: names as in docs/conventions.md (`angle_rad`, `tip_x_m`…); the unit is in the name.
        source: the file's name, for messages.
        sha256: of the file's content; "" for data in memory.
        remarks: changes and observations of the reader that affect the interpretation of results, in sentences.
        marker_arms_m: position along the chain at rest of `marker_k`, from the base, for k from 1; empty if the
            markers are the chain's own (joints 1…N, then the tip as N + 1).
        marker_offsets_m: (x, y, z) offset of each from the centre line, in the frame of its piece; empty if all are
            on it.
        frames: in which positions or pairs of bends are read, by a pattern of runs' names ("*" for all); empty for
            the world's and the module's.
        free_zeros: outputs of unknown zero → "unknown" (one for all runs) or "per run".
        doubts: columns that may have another meaning; `remarks` includes their sentences.
        written: Pliant's name of each read column → its unit in the file ("mbar" of `pressure_pa`).
        headed: Pliant's name of each read column → its heading in the file ("Druck [mbar]").
    """

    runs: tuple[MeasuredRun, ...]
    outputs: tuple[str, ...]
    source: str = ""
    remarks: tuple[str, ...] = ()
    marker_arms_m: tuple[float, ...] = ()
    sha256: str = ""
    doubts: tuple[Doubt, ...] = ()
    written: Mapping[str, str] = field(default_factory=dict)
    headed: Mapping[str, str] = field(default_factory=dict)
    marker_offsets_m: tuple[tuple[float, float, float], ...] = ()
    frames: Mapping[str, SensorFrame] = field(default_factory=dict)
    free_zeros: Mapping[str, str] = field(default_factory=dict)

    @property
    def n_samples(self) -> int:
        """Number of readings of all outputs."""
        return int(sum(np.isfinite(run.outputs[name]).sum() for run in self.runs for name in self.outputs))
