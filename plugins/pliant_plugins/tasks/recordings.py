"""Recorded runs as what a task commands, and the model's readings against what was read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from pliant.errors import UserError, closest
from pliant.interfaces.base import FrozenModel
from pliant.interfaces.effect import Readings
from pliant.measurements.beginnings import led_in, with_known_states
from pliant.measurements.files import read_measurements
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History, held
from pliant.records.rollout import Rollout

# What a run may have read that a rollout has.
READ = ("angle_rad", "elongation_strain", "tip_x_m", "tip_y_m", "tip_z_m")


class RecordingConfig(FrozenModel):
    """``recording: {file: runs.csv, run: 12V}``; see docs/measurement_files.md for what a file may be."""

    file: Path = Field(description="measurement file; columns as in docs/measurement_files.md")
    run: str = Field(default="", description="which run, where the file has several")
    rename: dict[str, str] = Field(
        default_factory=dict, description="the file's column: Pliant's name, e.g. {bend: angle_rad}"
    )
    outputs: tuple[str, ...] = Field(
        default=(), description="which readings to compare with; all that a chain has, by default"
    )
    parts: int = Field(
        default=2,
        ge=1,
        le=100,
        description="equal steps from sample to sample, inputs on straight lines between",
    )


@dataclass(frozen=True, eq=False)
class Recording:
    """One run: `fine` is its history with `parts` steps from sample to sample, led in where it begins in motion.

    `outputs` (t,) are what was read at the samples; NaN where nothing was, or where the state was not known yet.
    """

    fine: History
    parts: int
    outputs: Mapping[str, Array]

    @staticmethod
    def of(config: RecordingConfig, chain: ChainModel) -> Recording:
        """Read it.

        Raises:
            UserError: a file that cannot be read, an unknown run, one without times, a base or payload that is not the
                chain's own.
        """
        found = read_measurements(config.file, {"rename": config.rename}, actuation=chain.inputs)
        runs = {run.name: run for run in with_known_states(found)[0].runs}
        name = config.run or next(iter(runs))
        if name not in runs or (not config.run and len(runs) > 1):
            given = f"names run '{name}'{closest(name, sorted(runs))}" if config.run else "names no run."
            raise UserError(
                f"task 'recording' {given} {config.file} has {', '.join(runs)}: give one as 'run'."
            )
        history = runs[name].history
        if history.time_s is None or len(history) < 2:
            raise UserError(f"{config.file}, run '{name}' has no times, which a motion needs: give 'time_s'.")
        if history.base_angles_rad.any() or history.payload_kg is not None:
            raise UserError(
                f"{config.file}, run '{name}' turns the base or changes the payload, which this task leaves "
                "alone: give them in 'chain', and leave the columns out."
            )
        read = runs[name].outputs
        if unknown := [output for output in config.outputs if output not in read]:
            raise UserError(f"{config.file} has no {unknown[0]}{closest(unknown[0], sorted(read))}")
        outputs = {output: read[output] for output in config.outputs or read}
        return Recording(held(led_in([history])[0]).refined(config.parts), config.parts, outputs)

    @property
    def read_at(self) -> slice:
        """The samples of `fine` that were recorded."""
        return slice(self.fine.lead * self.parts, None, self.parts)

    def errors(
        self, chain: ChainModel, rollout: Rollout, reported: Callable[[Readings], Readings]
    ) -> dict[str, float]:
        """Root mean square of measured − model of each output, such as `angle_rmse_rad`, and the largest, `…_worst_…`.

        Args:
            rollout: the motion at the recorded samples.
            reported: what the sensors make of true readings.
        """
        true = {name: values for name, values in readings_of(chain, rollout).items() if name in self.outputs}
        seen = reported({**true, "time_s": rollout.time_s, "actuation": rollout.actuation.sum(axis=1)})
        numbers = {}
        for name in true:
            missed = self.outputs[name] - np.asarray(seen[name], float)
            missed = missed[np.isfinite(missed)]
            if len(missed):
                stem, unit = _named(name)
                numbers[f"{stem}_rmse_{unit}"] = float(np.sqrt(np.mean(missed**2)))
                numbers[f"{stem}_worst_{unit}"] = float(np.abs(missed).max())
        return numbers


def error_names() -> tuple[str, ...]:
    """Names of what `Recording.errors` may give."""
    parts = [_named(name) for name in READ]
    return tuple(f"{stem}_{what}_{unit}" for stem, unit in parts for what in ("rmse", "worst"))


def readings_of(chain: ChainModel, rollout: Rollout) -> dict[str, Any]:
    """(t,) of each name in `READ` that the chain has, as it truly is."""
    geometry = ChainGeometry.of(chain)
    total = rollout.joint_angles[:, :, geometry.main].sum(axis=1)
    tip = dict(zip(READ[2:], rollout.markers_m[:, -1].T, strict=True))
    if geometry.kind == "prismatic":
        return {"elongation_strain": total / chain.length_m, **tip}
    return {"angle_rad": total, **tip}


def _named(output: str) -> tuple[str, str]:
    stem, _, unit = output.rpartition("_")
    return stem, unit
