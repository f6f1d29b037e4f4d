"""Fit of a stated law's coefficients to measured runs by least squares, with the engine and the study's effects.

It needs neither FEM of the module nor a test with known moments, only runs of the actuator. Runs without a load
determine only ratios of the coefficients, since the angle at rest of k_n p + m_a p u = m_e u²/2 + b_e u is the same for
any multiple of them: then one coefficient has to be fixed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.config.study import Study
from pliant.errors import NotReachedError, UserError, closest
from pliant.evidence.error_bins import padded
from pliant.evidence.prediction import Predictor
from pliant.interfaces.surrogate import SurrogateConfig
from pliant.measurements.effective import effective_samples
from pliant.mechanics.shared_elasticity import sharing_elasticity
from pliant.pipeline.study import build_study_chain
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant_calibrate.fitting import BlackBox, minimised

STEP, TOLERANCE, LEAST = 1e-4, 1e-6, 1e-8
# A combination of coefficients with less effect on the readings, relative to the strongest one, is not determined.
UNDETERMINED = 1e-4
# Residuals are relative to each output's range, so that angles and positions have equal weight.
SMALLEST_RANGE = 1e-12
DIGITS = 6


@dataclass(frozen=True, eq=False)
class LawOfRuns:
    """Result of fitting a stated law.

    Attributes:
        study: the study with the coefficients.
        coefficients, sd: values in SI, and standard deviations of those that were fitted.
        before, after: root mean square error by output, SI.
        n_effective: independent readings, by the residual's correlation in time.
    """

    study: Study
    coefficients: Mapping[str, float]
    sd: Mapping[str, float]
    before: Mapping[str, float]
    after: Mapping[str, float]
    n_effective: float

    def yaml(self) -> str:
        """Return the coefficients as a line of the study."""
        inner = ", ".join(f"{name}: {value:.{DIGITS}g}" for name, value in self.coefficients.items())
        return f"coefficients: {{{inner}}}"


def fit_stated_law(
    context: RunContext, study: Study, measurement: Measurement, *, held: Sequence[str] = ()
) -> LawOfRuns:
    """Fit the coefficients of the study's stated law, except those stated as 0 and those in `held`.

    Raises:
        UserError: no stated law for all joints, a name in `held` that it does not have, or runs that do not
            distinguish the coefficients.
        NotReachedError: the model has no equilibrium with the coefficients that the study states.
    """
    config = study.surrogate
    given = stated_coefficients(config)
    for name in held:
        if name not in given:
            raise UserError(f"The law has no coefficient '{name}' to hold{closest(name, given)}")
    names = [name for name, value in given.items() if value != 0.0 and name not in held]
    if config is None or not names:
        raise UserError("No coefficient is left to fit: all are held or stated as 0.")
    errors = _Errors(context, study, measurement, config, names)
    start = np.array([given[name] for name in names])
    found = minimised(BlackBox(errors.packed, np.abs(start), STEP, True, TOLERANCE, LEAST), start)
    if found is None:
        raise NotReachedError(
            f"{measurement.source}: with the law that the study states some measured states have no equilibrium; "
            "begin with a stiffer law, or look at the units."
        )
    n_effective = errors.n_effective(found.values)
    sd = _deviations(found.jacobian * np.abs(start), found.residuals, n_effective)
    if sd is None:
        raise UserError(
            f"{measurement.source} does not tell {', '.join(names)} apart: without a load only their ratios are "
            f"identifiable. Hold one of them, e.g. {names[-1]}, or add runs with a load."
        )
    values = {name: float(f"{v:.{DIGITS}g}") for name, v in zip(names, found.values, strict=True)}
    return LawOfRuns(
        study=study.model_copy(update={"surrogate": _with(config, values)}),
        coefficients={**given, **values},
        sd=dict(zip(names, (sd * np.abs(start)).tolist(), strict=True)),
        before=errors.rmse(start),
        after=errors.rmse(found.values),
        n_effective=n_effective,
    )


def stated_coefficients(config: SurrogateConfig | None) -> dict[str, float]:
    """Return the coefficients by name; raise `UserError` for a law that does not state any."""
    coefficients = getattr(config, "coefficients", None)
    if coefficients is None and getattr(config, "axes", None):
        raise UserError(
            "The laws of joints with several axes are not fitted to runs: state a law of one axis, or fit "
            "'actuation_gain' and 'stiffness' by 'pliant extend'."
        )
    if coefficients is None:
        raise UserError(
            "Only a law that is stated by its coefficients is fitted to runs: give "
            "'surrogate: {kind: polynomial, form: study, coefficients: {...}}' with rough values."
        )
    return {name: float(value) for name, value in coefficients.model_dump().items()}


def _with(config: SurrogateConfig, values: Mapping[str, float]) -> SurrogateConfig:
    old = config.coefficients  # type: ignore[attr-defined]
    return config.model_copy(update={"coefficients": old.model_copy(update=dict(values))})


class _Errors:
    """Errors, reading − model, as a function of the coefficients."""

    def __init__(
        self,
        context: RunContext,
        study: Study,
        measurement: Measurement,
        config: SurrogateConfig,
        names: Sequence[str],
    ) -> None:
        self.context, self.measurement, self.config, self.names = context, measurement, config, names
        self.chain, self.effects = build_study_chain(context, study).chain, study.effects
        if len(self.chain.laws) > 1:
            raise UserError("The chain has several laws; runs are fitted with one law for all joints.")
        predictor = Predictor.from_study(context, study, measurement)
        self.backend, self.outputs = predictor.backend, predictor.outputs
        read = {
            name: np.concatenate([run.outputs[name] for run in measurement.runs]) for name in self.outputs
        }
        spans = {name: float(np.nanmax(values) - np.nanmin(values)) for name, values in read.items()}
        self.spans = {name: max(span, SMALLEST_RANGE) for name, span in spans.items()}

    def evaluate(self, values: Array) -> list[dict[str, Array]]:
        """Return per run and output (t,), SI; NaN without a reading or an equilibrium of the model."""
        config = _with(self.config, dict(zip(self.names, values.tolist(), strict=True)))
        stated = self.context.build("surrogate", config).stated()
        chain = self.chain.with_(laws=(sharing_elasticity(stated, int(self.chain.parts.max())),))
        predictor = Predictor(self.context, self.backend, chain, self.measurement, self.effects)
        return [
            {name: run.outputs[name] - model[name] for name in self.outputs}
            for run, model in zip(self.measurement.runs, predictor.evaluate().runs, strict=True)
        ]

    def packed(self, values: Array) -> Array | None:
        """Return (N,) errors relative to each output's range; None if a reading has no equilibrium."""
        pieces = [
            error[name][np.isfinite(run.outputs[name])] / self.spans[name]
            for run, error in zip(self.measurement.runs, self.evaluate(values), strict=True)
            for name in self.outputs
        ]
        packed = np.concatenate(pieces)
        return packed if np.isfinite(packed).all() else None

    def rmse(self, values: Array) -> dict[str, float]:
        errors = self.evaluate(values)
        whole = {name: np.concatenate([run[name] for run in errors]) for name in self.outputs}
        return {name: float(np.sqrt(np.nanmean(series**2))) for name, series in whole.items()}

    def n_effective(self, values: Array) -> float:
        """Return the number of independent readings, by the error's correlation in time."""
        counted = effective_samples(padded(self.measurement, self.evaluate(values)), self.measurement)
        return float(sum(counted[name] for name in self.outputs))


def _deviations(slopes: Array, residual: Array, n_effective: float) -> Array | None:
    """Return (k,) relative standard deviations from slopes (N, k) by relative changes; None if not identifiable."""
    sizes = np.linalg.svd(slopes, compute_uv=False)
    if sizes[-1] <= UNDETERMINED * sizes[0]:
        return None
    variance = float(residual @ residual) / max(n_effective - slopes.shape[1], 1.0)
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)) * variance), float)
