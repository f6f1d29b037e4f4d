"""Measurements: what a bench recorded, run by run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.history import History


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """One run: its inputs and what was read.

    Attributes:
        history: inputs, loads and conditions.
        outputs: (t,) for each output of the measurement, SI; NaN where nothing was read.
        sigma: (t,) stated standard deviation for the outputs that have one; NaN where it is not stated.
        cycle: (t,) cycle number where the file gives it, else counted from the actuation, from 1.
        lines: (t,) the line of the file that each sample stands in; empty for data made in memory.
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
        """(t,) an input by name; NaN where the run has none of it."""
        return np.asarray(self.history.actuation.get(name, np.full(len(self), np.nan)), float)

    def at(self, places: NDArray[np.intp]) -> MeasuredRun:
        """Some of its samples, (k,) their places in their order."""
        return MeasuredRun(
            self.history.at_samples(places),
            {name: values[places] for name, values in self.outputs.items()},
            {name: values[places] for name, values in self.sigma.items()},
            self.cycle[places],
            self.lines[places] if len(self.lines) else self.lines,
        )

    def with_outputs(self, outputs: Mapping[str, Array]) -> MeasuredRun:
        """The run with other readings, everything else kept."""
        return replace(self, outputs=dict(outputs))


@dataclass(frozen=True)
class Doubt:
    """A column that was read as it says, and may mean something else.

    Attributes:
        column: its name in the file.
        kind: unit, zero, beginning (in the middle of a motion), saturated, frozen, or order (rows that were sorted).
        sentence: what makes one doubt, and the line of the notes that would settle it; it begins with the column.
    """

    column: str
    kind: str
    sentence: str


@dataclass(frozen=True)
class SensorFrame:
    """The turn of the frame in which positions or pairs of bends are read; unknown where both are None.

    Attributes:
        quaternion: (w, x, y, z) that takes world vectors to those of the camera.
        angle_rad: about the chain axis, from the module's y and z to the axes of a pair of bend sensors.
    """

    quaternion: tuple[float, float, float, float] | None = None
    angle_rad: float | None = None

    @property
    def unknown(self) -> bool:
        return self.quaternion is None and self.angle_rad is None


@dataclass(frozen=True, eq=False)
class Measurement:
    """Runs with the same outputs, in the order in which they were done.

    Attributes:
        runs: see `MeasuredRun`.
        outputs: names as in docs/conventions.md (`angle_rad`, `tip_x_m`…); the unit is in the name.
        source: the file's name, for messages.
        sha256: of the file's content; empty for data made in memory.
        remarks: what the reader did or noticed that changes how results should be read, in sentences.
        marker_arms_m: position along the chain at rest of `marker_k`, from the base, for k from 1; empty where
            markers are the chain's own (joints 1…N, then the tip as N + 1).
        marker_offsets_m: (x, y, z) of each of them beside the centre line, in the frame of its piece; empty where all
            stand on it.
        frames: in which positions or pairs of bends are read, by a pattern of runs' names ("*" for all); empty for the
            world's and the module's.
        free_zeros: outputs whose zero is unknown → "unknown" (one of all runs) or "per run".
        doubts: columns that may mean something else; `remarks` holds their sentences too.
        written: Pliant's name of each column that was read → its unit in the file ("mbar" of `pressure_pa`).
        headed: Pliant's name of each column that was read → its heading in the file ("Druck [mbar]").
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
        """Readings that are there, over all outputs."""
        return int(sum(np.isfinite(run.outputs[name]).sum() for run in self.runs for name in self.outputs))
