"""Forms of a learned term: where it acts, over which covariates, with how many knots.

The histories and the model's own motion show which covariates vary in the data, and how far: a constant covariate gives
no form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.evidence.prediction import Predictor
from pliant.mechanics.learned_curve import KEPT, NAMES, CurveAxis, Signals, series
from pliant.records.design import Array

# The kind of effect that contains such a form in a study.
KIND = "learned"
# Maximum number of levels of a covariate with as many knots: a line through two, a parabola through three.
FEW_LEVELS = 3
# Smallest spread of a varying covariate, over the largest absolute value.
SPREAD = 1e-3
# Covariates with a memory or a rate have few extreme values: this share is excluded at either end.
TAIL = 0.005
TIMES_S = (1.0, 5.0, 25.0)
WIDTHS = (0.05, 0.2)
# Covariates with a scale that is searched after the form is chosen.
TUNED = (
    "rate",
    "actuation_rate",
    "actuation_direction",
    "angle_direction",
    "actuation_change",
    "angle_change",
)
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

    @property
    def complexity(self) -> tuple[int, int]:
        """Return the number of covariates, and how many of them are rates or carry a memory."""
        return len(self.axes), sum(
            axis.name not in ("angle", "actuation", "temperature") for axis in self.axes
        )

    def block(self, value: Array, sd: Array | None = None) -> dict[str, Any]:
        """Return the effect's block of a study."""
        covariates = [
            {"name": a.name, "low": a.low, "high": a.high, **({} if a.scale == 1.0 else {"scale": a.scale})}
            for a in self.axes
        ]
        found = {"kind": "learned", "acts_on": self.acts_on, "covariates": covariates}
        found["value"] = np.reshape(value, self.shape).tolist()
        return found if sd is None else {**found, "sd": np.reshape(sd, self.shape).tolist()}

    def with_knots(self, shape: Sequence[int]) -> LearnedForm:
        """Return the form with other numbers of knots."""
        return replace(
            self, axes=tuple(replace(a, knots=int(n)) for a, n in zip(self.axes, shape, strict=True))
        )


# acts_on, then for each covariate its name and its maximum number of knots.
FORMS: tuple[tuple[str, tuple[tuple[str, int], ...]], ...] = (
    ("input", (("actuation", 14),)),
    ("input", (("temperature", 4),)),
    ("input", (("time", 24),)),
    ("input", (("actuation_change", 8),)),
    ("input", (("actuation", 9), ("actuation_rate", 3))),
    ("input", (("actuation", 9), ("actuation_direction", 3))),
    ("input", (("actuation", 6), ("temperature", 3))),
    ("actuation", (("travel", 6),)),
    ("actuation", (("angle", 10),)),
    ("actuation", (("largest_angle", 6),)),
    ("elastic", (("actuation", 14),)),
    ("elastic", (("angle", 10),)),
    ("elastic", (("temperature", 4),)),
    ("elastic", (("travel", 6),)),
    ("elastic", (("largest_angle", 6),)),
    ("moment", (("angle", 14),)),
    ("moment", (("rate", 5),)),
    ("moment", (("time", 24),)),
    ("moment", (("angle_direction", 3),)),
    ("moment", (("angle_change", 8),)),
    ("moment", (("angle_direction", 3), ("temperature", 3))),
    ("moment", (("angle", 6), ("angle_direction", 3))),
    ("moment", (("angle", 6), ("largest_angle", 4))),
    ("moment", (("angle", 6), ("actuation", 5))),
    ("moment", (("rate", 5), ("temperature", 3))),
    ("reading", (("angle", 40),)),
    ("reading", (("time", 24),)),
    ("reading", (("angle", 12), ("angle_direction", 3))),
    ("reading", (("angle_change", 8),)),
)


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

    def forms(self) -> list[LearnedForm]:
        """Return every form whose covariates these runs vary, the simplest first."""
        found = []
        for acts_on, wanted in FORMS:
            options: list[tuple[CurveAxis, ...]] = [()]
            for name, knots in wanted:
                axes = self.axes(name, knots, acts_on)
                options = [(*before, axis) for before in options for axis in axes]
            found += [LearnedForm(acts_on, axes) for axes in options]
        return sorted(found, key=lambda form: (form.complexity, np.prod(form.shape)))

    def rescaled(self, form: LearnedForm, which: int, share: float) -> LearnedForm | None:
        """Return the form with the scale of one covariate changed by a share; None if it is then constant."""
        axis = form.axes[which]
        scaled = replace(axis, scale=float(f"{share * axis.scale:.2g}"))
        found = self._axis(scaled, form.acts_on == "reading" and axis.name.startswith("angle"))
        return (
            None
            if found is None
            else replace(form, axes=(*form.axes[:which], found, *form.axes[which + 1 :]))
        )

    @cached_property
    def readings(self) -> Array:
        """Return all angles that the sensors read according to the model, where they did."""
        runs = zip(self.predictor.measurement.runs, self.predictor.evaluate().runs, strict=True)
        angles = [
            values[np.isfinite(measured.outputs[name])]
            for measured, run in runs
            for name, values in run.items()
            if name.endswith("angle_rad")
        ]
        values: Array = np.concatenate(angles) if angles else np.zeros(0)
        return values[np.isfinite(values)]

    def axes(self, name: str, knots: int, acts_on: str) -> list[CurveAxis]:
        """Return the covariate with each of its possible scales; empty if it is constant."""
        if not self.timed and name in ("rate", "time", "actuation_rate", "actuation_change", "angle_change"):
            return []
        if acts_on == "reading" and not len(self.readings):
            return []
        whole = acts_on == "reading" and name.startswith("angle")  # a reading is of the chain, not of a joint
        found = [
            self._axis(CurveAxis(name, 0.0, 1.0, knots, scale), whole) for scale in self._scales(name, whole)
        ]
        return [axis for axis in found if axis is not None]

    def _scales(self, name: str, whole: bool) -> Sequence[float]:
        def span(x: Array) -> float:
            return max(float(np.ptp(x)), 1e-12) if len(x) else 1.0

        if name in ("actuation_change", "angle_change"):
            return TIMES_S
        if name == "angle_direction":
            angle = self.readings if whole else self._values(CurveAxis("angle", 0.0, 1.0, 2))
            return [float(f"{share * span(angle):.2g}") for share in WIDTHS]
        pushed = self._values(CurveAxis("actuation", 0.0, 1.0, 2))
        if name == "actuation_direction":
            return [float(f"{WIDTHS[0] * span(pushed):.2g}")]
        if name == "travel":
            return [float(f"{max(float(np.abs(pushed).max()), 1e-12):.2g}")]
        if name in ("rate", "actuation_rate"):
            return [float(f"{self._slow(name):.2g}")]
        return [1.0]

    def _slow(self, name: str) -> float:
        """Return a rate that separates motion from rest: a third of the lower quartile of the rates in motion."""
        rates: list[Array] = []
        for _, run, read in self.runs:
            if read.any() and run.time_s is not None:
                x = run.angle if name == "rate" else run.actuation
                step = np.diff(run.time_s)
                rates.append(np.abs(np.diff(x)[step > 0] / step[step > 0]))
        every = np.concatenate(rates) if rates else np.zeros(0)
        moving = every[every > 0.02 * every.max(initial=0.0)]
        return max(float(np.quantile(moving, 0.25)) / 3.0, 1e-12) if len(moving) else 1.0

    def _axis(self, axis: CurveAxis, whole: bool) -> CurveAxis | None:
        values = self.readings if whole and axis.name == "angle" else self._values(axis)
        values = values[np.isfinite(values)]
        if not len(values):
            return None
        tail = TAIL if axis.name.endswith(("change", "rate")) else 0.0
        low, high = (float(np.quantile(values, q)) for q in (tail, 1.0 - tail))
        if whole and axis.name == "angle_change":
            joints = self.predictor.chain.n_joints
            low, high = joints * low, joints * high
        if not high - low > SPREAD * max(abs(low), abs(high)):
            return None
        levels = len(np.unique(np.round((values - low) / (high - low), 2)))
        knots = min(axis.knots, levels if levels <= FEW_LEVELS else axis.knots)
        return replace(axis, low=float(f"{low:.4g}"), high=float(f"{high:.4g}"), knots=max(knots, 2))

    def _values(self, axis: CurveAxis) -> Array:
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


assert all(name in NAMES for _, wanted in FORMS for name, _ in wanted)
