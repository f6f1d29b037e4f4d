"""The numbers of a stated law from measured runs: least squares with the engine and the study's effects in the loop.

For whoever has no FEM of the module and no bench that bends it by known moments, but runs of the actuator itself.
Runs without a load determine ratios of the coefficients only, for the angle at rest of k_n p + m_a p u = m_e u²/2 +
b_e u is the same for any multiple of them: then one coefficient has to be held.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.calibration.fitting import BlackBox, minimised
from pliant.config.study import Study
from pliant.errors import NotReachedError, UserError, closest
from pliant.evidence.places import padded
from pliant.evidence.prediction import Predictor
from pliant.interfaces.surrogate import SurrogateConfig
from pliant.measurements.effective import effective_samples
from pliant.mechanics.shared_elasticity import sharing_elasticity
from pliant.pipeline.study import chain_of_study
from pliant.pipeline.workbench import Workbench
from pliant.records.design import Array
from pliant.records.measurement import Measurement

STEP, TOLERANCE, LEAST = 1e-4, 1e-6, 1e-8
# A combination of coefficients that moves the readings less than this share of the strongest one is not determined.
UNDETERMINED = 1e-4
# Residuals are in shares of each output's range, so that angles and positions weigh alike.
SMALLEST_RANGE = 1e-12
DIGITS = 6


@dataclass(frozen=True, eq=False)
class LawOfRuns:
    """A stated law, fitted.

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
        """The line of the study."""
        inner = ", ".join(f"{name}: {value:.{DIGITS}g}" for name, value in self.coefficients.items())
        return f"coefficients: {{{inner}}}"


def law_of_runs(
    bench: Workbench, study: Study, measurement: Measurement, *, held: Sequence[str] = ()
) -> LawOfRuns:
    """Fit the coefficients of the study's stated law; those that it states as 0 and those in `held` stay.

    Raises:
        UserError: no stated law for all joints, a name in `held` that it does not have, or runs that do not tell
            the coefficients apart.
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
    errors = _Errors(bench, study, measurement, config, names)
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
            f"{measurement.source} does not tell {', '.join(names)} apart: without a load only their ratios show. "
            f"Hold one of them, e.g. {names[-1]}, or add runs with a load."
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
    """By name; raises `UserError` for a law that does not state any."""
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
    """Reading − model as a function of the coefficients."""

    def __init__(
        self,
        bench: Workbench,
        study: Study,
        measurement: Measurement,
        config: SurrogateConfig,
        names: Sequence[str],
    ) -> None:
        self.bench, self.measurement, self.config, self.names = bench, measurement, config, names
        self.chain, self.effects = chain_of_study(bench, study).chain, study.effects
        if len(self.chain.laws) > 1:
            raise UserError("The chain has several laws; runs are fitted with one law for all joints.")
        predictor = Predictor.of_study(bench, study, measurement)
        self.backend, self.outputs = predictor.backend, predictor.outputs
        read = {
            name: np.concatenate([run.outputs[name] for run in measurement.runs]) for name in self.outputs
        }
        spans = {name: float(np.nanmax(values) - np.nanmin(values)) for name, values in read.items()}
        self.spans = {name: max(span, SMALLEST_RANGE) for name, span in spans.items()}

    def of(self, values: Array) -> list[dict[str, Array]]:
        """Per run by output (t,), SI; NaN where nothing was read or the model has no equilibrium."""
        config = _with(self.config, dict(zip(self.names, values.tolist(), strict=True)))
        stated = self.bench.build("surrogate", config).stated()
        chain = self.chain.with_(laws=(sharing_elasticity(stated, int(self.chain.parts.max())),))
        predictor = Predictor(self.bench, self.backend, chain, self.measurement, self.effects)
        return [
            {name: run.outputs[name] - model[name] for name in self.outputs}
            for run, model in zip(self.measurement.runs, predictor.evaluate().runs, strict=True)
        ]

    def packed(self, values: Array) -> Array | None:
        """(N,) in shares of each output's range; None where a reading has no equilibrium beside it."""
        pieces = [
            error[name][np.isfinite(run.outputs[name])] / self.spans[name]
            for run, error in zip(self.measurement.runs, self.of(values), strict=True)
            for name in self.outputs
        ]
        packed = np.concatenate(pieces)
        return packed if np.isfinite(packed).all() else None

    def rmse(self, values: Array) -> dict[str, float]:
        errors = self.of(values)
        whole = {name: np.concatenate([run[name] for run in errors]) for name in self.outputs}
        return {name: float(np.sqrt(np.nanmean(series**2))) for name, series in whole.items()}

    def n_effective(self, values: Array) -> float:
        """Independent readings, by the error's correlation in time."""
        counted = effective_samples(padded(self.measurement, self.of(values)), self.measurement)
        return float(sum(counted[name] for name in self.outputs))


def _deviations(slopes: Array, residual: Array, n_effective: float) -> Array | None:
    """(k,) relative standard deviations, slopes (N, k) by relative changes; None where they are not told apart."""
    sizes = np.linalg.svd(slopes, compute_uv=False)
    if sizes[-1] <= UNDETERMINED * sizes[0]:
        return None
    variance = float(residual @ residual) / max(n_effective - slopes.shape[1], 1.0)
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)) * variance), float)
