"""Form of a learned term: where it acts, over which covariates, with how many knots.

The histories and the model's own motion show which covariates vary in the data, and how far.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.evidence.prediction import Predictor
from pliant.mechanics.learned_curve import KEPT, CurveAxis, Signals, series
from pliant.records.design import Array

# The kind of effect that contains such a form in a study.
KIND = "learned"
# Maximum number of levels of a covariate with as many knots: a line through two, a parabola through three.
FEW_LEVELS = 3
# Smallest spread of a varying covariate, over the largest absolute value.
SPREAD = 1e-3
# Covariates with a memory or a rate have few extreme values: this share is excluded at either end.
TAIL = 0.005
# Number of joints whose motion determines the ranges.
MOST_JOINTS = 3


@dataclass(frozen=True)
class LearnedForm:
    """A learned term without its values.

    Attributes:
        acts_on: as in a study's `learned` effect.
        axes: its covariates with ranges and knots.
    """

    acts_on: str
    axes: tuple[CurveAxis, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(axis.knots for axis in self.axes)

    def block(self, value: Array, sd: Array | None = None) -> dict[str, Any]:
        """Return the effect's block of a study."""
        covariates = [
            {"name": a.name, "low": a.low, "high": a.high, **({} if a.scale == 1.0 else {"scale": a.scale})}
            for a in self.axes
        ]
        found = {"kind": "learned", "acts_on": self.acts_on, "covariates": covariates}
        found["value"] = np.reshape(value, self.shape).tolist()
        return found if sd is None else {**found, "sd": np.reshape(sd, self.shape).tolist()}


class SeenMotion:
    """The signals of a model's joints where something was read."""

    def __init__(self, predictor: Predictor) -> None:
        self.predictor = predictor
        histories, paths = predictor.paths()
        self.runs: list[tuple[str, Signals, NDArray[np.bool_]]] = []
        joints = np.unique(np.linspace(0, predictor.chain.n_joints - 1, MOST_JOINTS).astype(int))
        main = predictor.main_axis
        measured = zip(predictor.measurement.runs, histories, paths, strict=True)
        for run, history, path in measured:
            there = np.any([np.isfinite(values) for values in run.outputs.values()], axis=0)
            read = np.concatenate([np.zeros(history.lead, bool), there])
            pushed = sum(history.actuation[a.input] * a.sign for a in predictor.chain.actuators)
            for j in joints:
                angle = np.where(path.converged, path.joint_angles[:, j, main], 0.0)
                signals = Signals(angle, np.asarray(pushed), history.temperature_c, history.time_s)
                self.runs.append((f"{history.specimen} {j}", signals, read))
        self.timed = all(history.time_s is not None for history in histories)
        self._known: dict[CurveAxis, Array] = {}

    def axis(self, axis: CurveAxis, values: Array | None = None, times: float = 1.0) -> CurveAxis | None:
        """Return a covariate with its range and knots; None if it is constant.

        Args:
            axis: name, most knots and scale.
            values: its samples; by default those of the joints where something was read.
            times: factor of the range.
        """
        values = self.values(axis) if values is None else values
        values = values[np.isfinite(values)]
        if not len(values):
            return None
        tail = TAIL if axis.name.endswith(("change", "rate")) else 0.0
        low, high = (times * float(np.quantile(values, q)) for q in (tail, 1.0 - tail))
        if not high - low > SPREAD * max(abs(low), abs(high)):
            return None
        levels = len(np.unique(np.round((values - low) / (high - low), 2)))
        knots = min(axis.knots, levels if levels <= FEW_LEVELS else axis.knots)
        return replace(axis, low=float(f"{low:.4g}"), high=float(f"{high:.4g}"), knots=max(knots, 2))

    def values(self, axis: CurveAxis) -> Array:
        """Return all samples of the covariate where something was read."""
        if axis not in self._known:
            parts = []
            memories: dict[str, Array] = {}
            for body, run, read in self.runs:
                memory = memories.setdefault(body, np.zeros(2)) if axis.name in KEPT else None
                values = series(axis, run, memory)
                parts.append(values[read])
            self._known[axis] = np.concatenate(parts) if parts else np.zeros(0)
        return self._known[axis]
