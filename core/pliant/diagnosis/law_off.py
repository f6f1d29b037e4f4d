"""Error of a joint law, and where it matters most, from the readings of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.law_discrepancy import LawErrorBasis, LawReference
from pliant.diagnosis.learned_forms import SeenMotion
from pliant.diagnosis.learned_term import LearnedTerm
from pliant.diagnosis.left_out import assign_blocks, heldout_residual, specimen_indices
from pliant.diagnosis.noise import NoiseView
from pliant.diagnosis.readings import ReadingVector
from pliant.evidence.measured_model import MeasuredModel
from pliant.evidence.prediction import Predictor
from pliant.formatting import output_unit
from pliant.mechanics.learned_curve import basis as surface
from pliant.mechanics.learned_curve import series
from pliant.records.design import Array
from pliant.records.measurement import Measurement


@dataclass(frozen=True, eq=False)
class LawOff:
    """An error of the law under a hypothesis.

    Attributes:
        size: root mean square over the states that the model visits, as a share of the torque range; `effort` is
            that range, N·m or N.
        output, change: the reading that it changes most in units of its noise, and by how much there, SI.
        actuation, reading: the input and the measured reading at that sample, SI; `drive` is the input's name.
        share: explained share of the model's squared error.
        term: the error as a learned term over actuation and deformation, with its band.
    """

    size: float
    effort: float
    output: str
    change: float
    drive: str
    actuation: float
    reading: float
    share: float
    term: LearnedTerm

    @property
    def words(self) -> str:
        """Return ``by 0.31° at 9.2 kPa and 12°``."""
        unit, pushed = output_unit(self.output), output_unit(self.drive)
        change, reading = (unit.text(value, 2) for value in (abs(self.change), self.reading))
        return f"by {change} at {pushed.text(self.actuation, 2)} and {reading}"


def law_off(
    predictor: MeasuredModel,
    measurement: Measurement,
    readings: ReadingVector,
    reference: LawReference | None,
    fit: EffectFit,
    noise: NoiseView,
) -> LawOff | None:
    """Return the error of the law under a hypothesis; None if the hypothesis includes no error of the law.

    Args:
        predictor: the model.
        measurement: the runs of the readings.
        readings: positions and scales.
        reference: the law's error as in the fits; None if they have none.
        fit: the hypothesis.
        noise: estimated from the best hypothesis.
    """
    basis = None if reference is None else reference.basis
    if not isinstance(predictor, Predictor) or basis is None or fit.law is None:
        return None
    if not np.isfinite(fit.raw).all():
        return None
    change = fit.law.change
    worst = int(np.argmax(np.abs(change)))
    output = readings.outputs[readings.output[worst]]
    run, sample = _place(readings, output, worst)
    drive = predictor.chain.actuators[0].input
    level = measurement.runs[run].history.actuation.get(drive)
    raw, left = float(np.sum(fit.raw**2)), float(np.sum(fit.residual**2))
    return LawOff(
        size=_visited(predictor, basis, fit.law.coefficient) / basis.effort,
        effort=basis.effort,
        output=output,
        change=float(change[worst]) * readings.scales[output],
        drive=drive,
        actuation=0.0 if level is None else float(level[sample]),
        reading=float(readings.values[worst]) * readings.scales[output],
        share=max(1.0 - left / max(raw, 1e-300), 0.0),
        term=_term(predictor, measurement, readings, fit, basis, noise),
    )


def _visited(predictor: Predictor, basis: LawErrorBasis, coefficient: Array) -> float:
    """Return the root mean square of the law's error over the states that the model visits, N·m or N."""
    axes, values = basis.form.axes, basis.directions @ coefficient
    errors = [
        (surface(axes, [series(axis, run) for axis in axes]) @ values)[read]
        for _, run, read in SeenMotion(predictor).runs
    ]
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def _term(
    predictor: Predictor,
    measurement: Measurement,
    readings: ReadingVector,
    fit: EffectFit,
    basis: LawErrorBasis,
    noise: NoiseView,
) -> LearnedTerm:
    """Return the law's error of a fit as a learned term, judged on held-out specimens, runs, or blocks of a run."""
    assert fit.law is not None
    drive = predictor.chain.actuators[0].input
    folds, on = _folds(measurement, readings)
    without = heldout_residual(fit, folds, exact_law=True)
    left = heldout_residual(fit, folds)
    root = np.sqrt(fit.law.precision) * fit.law.size * (basis.directions @ fit.law.posterior_root())
    covariance = root @ root.T
    value = basis.directions @ fit.law.coefficient
    sd = np.array([float(f"{x:.2g}") for x in np.sqrt(np.diag(covariance))])
    scale = 1.0 / np.sqrt(noise.floor_square) if noise.floor_square > 0.0 else np.nan
    before, after = (float(np.sqrt(np.mean(one**2))) * scale for one in (without, left))
    apart = float(np.sqrt(np.sum((without - left) ** 2) * len(left) / max(noise.n_effective, 2.0)))
    fall = float(without @ without - left @ left)
    digits = 3 - int(np.floor(np.log10(max(float(np.abs(value).max()), 1e-12))))
    value = np.round(value, digits)
    config = basis.config(predictor)
    return LearnedTerm(
        effect=config.model_validate(basis.form.block(value, sd)),
        form=basis.form,
        value=value,
        sd=sd,
        covariance=covariance,
        before=before,
        after=after,
        sure=fall / (2.0 * apart / scale) if apart > 0.0 and np.isfinite(scale) else 0.0,
        freedom=float(np.trace(np.linalg.solve(fit.law.normal, fit.law.columns.T @ fit.law.columns))),
        residual=fit.residual,
        left_out=left,
        tried=1,
        drive=drive,
        on=on,
    )


def _folds(measurement: Measurement, readings: ReadingVector) -> tuple[NDArray[np.intp], str]:
    """Return (N,) the fold of each reading, and what is left out."""
    specimens = specimen_indices(measurement.runs)[readings.run]
    if len(np.unique(specimens)) > 1:
        return specimens, "specimens left out"
    if len(np.unique(readings.run)) > 2:
        return readings.fold, "runs left out"
    return assign_blocks(readings), "blocks left out"


def _place(readings: ReadingVector, output: str, index: int) -> tuple[int, int]:
    """Return the run and the sample of a reading of the vector."""
    marked = np.zeros(len(readings))
    marked[index] = 1.0
    for run, values in enumerate(readings.unpack(marked)):
        found = np.flatnonzero(np.nan_to_num(values[output]) > 0.0)
        if len(found):
            return run, int(found[0])
    raise IndexError(index)
