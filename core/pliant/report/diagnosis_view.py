"""What the pictures of a diagnosis read out of it: the model before and after, and the runs where it matters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.verdict import NOTHING, UNKNOWN, Kinds
from pliant.evidence.comparison import compare
from pliant.evidence.prediction import RunReadings
from pliant.evidence.scores import GroupError
from pliant.records.measurement import Measurement
from pliant.report.comparison_view import Compared

MOST_EXPLANATIONS = 2
MOST_HYPOTHESES = 8


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """A measurement and what came of asking which effect is missing."""

    measurement: Measurement
    found: Diagnosis

    @cached_property
    def explanations(self) -> tuple[Kinds, ...]:
        """Sets of effects to draw beside the model as it is: the best, two where the data do not decide."""
        judgement = self.found.judgement
        if self.found.verdict != "ambiguous":
            return tuple(kinds for kinds in (self.found.explained,) if kinds != NOTHING)
        left = [kinds for kinds in judgement.credible if kinds not in (NOTHING, UNKNOWN)]
        return tuple(left[:MOST_EXPLANATIONS])

    @cached_property
    def before(self) -> Compared:
        """The model as it is against the measurement."""
        return self._compared(NOTHING)

    @cached_property
    def after(self) -> Compared | None:
        """The model with the best explanation; None where there is none to draw."""
        return self._compared(self.explanations[0]) if self.explanations else None

    def predicted(self, kinds: Kinds) -> tuple[RunReadings, ...]:
        """Per run and output (t,) what the model says with these effects; NaN where nothing was read."""
        readings = self.found.readings
        return readings.unpack(readings.values - self.found.fits[kinds].residual)

    def floor(self, output: str) -> float:
        """The noise of an output, SI; NaN where nothing tells it."""
        return self.found.noise.floors[output].value

    def hypotheses(self) -> list[Kinds]:
        """Those to show: the most probable, and always the model as it is and an effect outside the list."""
        every = list(self.found.judgement.probability)
        kept = set(every[:MOST_HYPOTHESES]) | {NOTHING, UNKNOWN}
        return [kinds for kinds in every if kinds in kept]

    def left_out_error(self, kinds: Kinds) -> float:
        """Error on runs left out of the fit over the floor; NaN for an effect outside the list."""
        return np.nan if kinds == UNKNOWN else self.found.left_out_ratio(kinds)

    def telling_runs(self, count: int) -> list[str]:
        """One run of each of the conditions in which the explanation takes away most of the squared error.

        Without an explanation: in which the error is largest for its number of readings.
        """
        gain = self._gains()
        ranked = sorted(self.before.comparison.conditions, key=lambda c: -self._of(c, gain))
        return [max(c.runs, key=lambda name: gain[name]) for c in ranked[:count]]

    def outputs_by_gain(self) -> list[str]:
        """Outputs that were fitted, the one whose error falls most first."""
        readings, fits = self.found.readings, self.found.fits
        before = fits[NOTHING].residual ** 2
        after = fits[self.explanations[0]].residual ** 2 if self.explanations else 0.0 * before
        gain = np.bincount(readings.output, weights=before - after, minlength=len(readings.outputs))
        return [readings.outputs[k] for k in np.argsort(-gain, kind="stable")]

    def _gains(self) -> dict[str, float]:
        readings, fits = self.found.readings, self.found.fits
        gain = fits[NOTHING].residual ** 2
        if self.explanations:
            gain = gain - fits[self.explanations[0]].residual ** 2
        sums = np.bincount(readings.run, weights=gain, minlength=readings.n_runs)
        count = np.bincount(readings.run, minlength=readings.n_runs)
        return {
            run.name: float(s / max(n, 1))
            for run, s, n in zip(self.measurement.runs, sums, count, strict=True)
        }

    @staticmethod
    def _of(condition: GroupError, gain: dict[str, float]) -> float:
        return float(np.mean([gain[name] for name in condition.runs]))

    def _compared(self, kinds: Kinds) -> Compared:
        predicted = self.predicted(kinds)
        return Compared(self.measurement, predicted, compare(self.measurement, predicted))
