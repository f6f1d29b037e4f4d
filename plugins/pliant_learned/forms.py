"""Forms that are tried for a learned term: where it acts, over which covariates that vary in the data.

A constant covariate gives no form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from pliant.diagnosis.learned_forms import LearnedForm, SeenMotion
from pliant.evidence.prediction import Predictor
from pliant.mechanics.learned_curve import NAMES, CurveAxis
from pliant.records.design import Array

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


def complexity(form: LearnedForm) -> tuple[int, int]:
    """Return the number of covariates, and how many of them are rates or carry a memory."""
    simple = ("angle", "actuation", "temperature")
    return len(form.axes), sum(axis.name not in simple for axis in form.axes)


def with_knots(form: LearnedForm, shape: Sequence[int]) -> LearnedForm:
    """Return a form with other numbers of knots."""
    return replace(form, axes=tuple(replace(a, knots=int(n)) for a, n in zip(form.axes, shape, strict=True)))


class SeenForms:
    """The forms over covariates that vary where something was read."""

    def __init__(self, predictor: Predictor) -> None:
        self.predictor, self.seen = predictor, SeenMotion(predictor)

    def forms(self) -> list[LearnedForm]:
        """Return every form whose covariates these runs vary, the simplest first."""
        found = []
        for acts_on, wanted in FORMS:
            options: list[tuple[CurveAxis, ...]] = [()]
            for name, knots in wanted:
                axes = self.axes(name, knots, acts_on)
                options = [(*before, axis) for before in options for axis in axes]
            found += [LearnedForm(acts_on, axes) for axes in options]
        return sorted(found, key=lambda form: (complexity(form), np.prod(form.shape)))

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
        if not self.seen.timed and name in (
            "rate",
            "time",
            "actuation_rate",
            "actuation_change",
            "angle_change",
        ):
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
            angle = self.readings if whole else self.seen.values(CurveAxis("angle", 0.0, 1.0, 2))
            return [float(f"{share * span(angle):.2g}") for share in WIDTHS]
        pushed = self.seen.values(CurveAxis("actuation", 0.0, 1.0, 2))
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
        for _, run, read in self.seen.runs:
            if read.any() and run.time_s is not None:
                x = run.angle if name == "rate" else run.actuation
                step = np.diff(run.time_s)
                rates.append(np.abs(np.diff(x)[step > 0] / step[step > 0]))
        every = np.concatenate(rates) if rates else np.zeros(0)
        moving = every[every > 0.02 * every.max(initial=0.0)]
        return max(float(np.quantile(moving, 0.25)) / 3.0, 1e-12) if len(moving) else 1.0

    def _axis(self, axis: CurveAxis, whole: bool) -> CurveAxis | None:
        """Return a covariate with its range; `whole`: of the chain, whose angles add those of all joints."""
        values = self.readings if whole and axis.name == "angle" else None
        joints = self.predictor.chain.n_joints if whole and axis.name == "angle_change" else 1
        return self.seen.axis(axis, values, joints)


assert all(name in NAMES for _, wanted in FORMS for name, _ in wanted)
