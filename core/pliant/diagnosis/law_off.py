"""How far a joint law is off, and where, as the readings of a diagnosis show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pliant.diagnosis.fitting import EffectFit, ReadingVector
from pliant.diagnosis.law_discrepancy import LawErrorBasis
from pliant.evidence.prediction import Predictor
from pliant.formatting import unit_of
from pliant.mechanics.learned_curve import CurveAxis
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.measurement import Measurement


@dataclass(frozen=True, eq=False)
class LawOff:
    """An error of the law beside a hypothesis.

    Attributes:
        size: its most probable size, a share of the torque range; `effort` is that range, N·m or N.
        output, change: the reading that it changes most in units of its noise, and by how much there, SI.
        actuation, reading: the input and the measured reading at that sample, SI; `drive` is the input's name.
        share: of the mean squared error of the model as it is that it explains.
        axes: actuation and deformation, or one of them, with the knots of the surface.
        value, sd: at the knots, N·m or N: posterior mean and standard deviation.
    """

    size: float
    effort: float
    output: str
    change: float
    drive: str
    actuation: float
    reading: float
    share: float
    axes: tuple[CurveAxis, ...]
    value: Array
    sd: Array

    @property
    def words(self) -> str:
        """``by 0.31° at 9.2 kPa and 12°``."""
        unit, pushed = unit_of(self.output), unit_of(self.drive)
        return (
            f"by {unit.text(abs(self.change), 2)} at {pushed.text(self.actuation, 2)} and "
            f"{unit.text(self.reading, 2)}"
        )


def law_off(
    predictor: Predictor,
    measurement: Measurement,
    readings: ReadingVector,
    basis: LawErrorBasis,
    fit: EffectFit,
) -> LawOff | None:
    """Return by how much the law is off beside a hypothesis; None where that holds no error of the law.

    Args:
        predictor: the model.
        measurement: the runs of the readings.
        readings: places and scales.
        basis: of the law's error.
        fit: the hypothesis.
    """
    if fit.law is None or not np.isfinite(fit.raw).all():
        return None
    change = fit.law.change
    worst = int(np.argmax(np.abs(change)))
    output = readings.outputs[readings.output[worst]]
    run, sample = _place(readings, output, worst)
    history = measurement.runs[run].history
    drive = predictor.chain.actuators[0].input
    raw, left = float(np.sum(fit.raw**2)), float(np.sum(fit.residual**2))
    spread = np.sqrt(fit.law.precision) * fit.law.size  # root of N σ² / n_eff
    root = spread * fit.law.posterior_root()
    return LawOff(
        size=fit.law.size,
        effort=basis.effort,
        output=output,
        change=float(change[worst]) * readings.scales[output],
        drive=drive,
        actuation=_level(history, drive, sample),
        reading=float(readings.values[worst]) * readings.scales[output],
        share=max(1.0 - left / max(raw, 1e-300), 0.0),
        axes=basis.form.axes,
        value=(basis.directions @ fit.law.coefficient).reshape(basis.form.shape),
        sd=np.sqrt(np.sum((basis.directions @ root) ** 2, axis=1)).reshape(basis.form.shape),
    )


def _level(history: History, drive: str, sample: int) -> float:
    values: Sequence[float] | Array = history.actuation.get(drive, np.zeros(0))
    return float(values[sample]) if len(values) > sample else 0.0


def _place(readings: ReadingVector, output: str, index: int) -> tuple[int, int]:
    """Return the run and the sample of a reading of the vector."""
    marked = np.zeros(len(readings))
    marked[index] = 1.0
    for run, values in enumerate(readings.unpack(marked)):
        found = np.flatnonzero(np.nan_to_num(values[output]) > 0.0)
        if len(found):
            return run, int(found[0])
    raise IndexError(index)
