"""Fit a material's constants to bench data: start, search, certainty, what speaks against the result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pliant.calibration.fitting import (
    BlackBox,
    Fit,
    MaterialConstant,
    changed,
    chosen,
    constants_of,
    minimised,
    moduli_scaled,
)
from pliant.calibration.free_curve import FreeCurves, HomogeneousTests
from pliant.calibration.reading import BenchData, check_modulus
from pliant.calibration.result import Calibration, certainty, hidden_by_model_error, remarks_of, undetermined
from pliant.config.study import Study
from pliant.errors import NotReachedError, UserError
from pliant.interfaces.family import ActuatorFamily
from pliant.interfaces.material import Material, MaterialConfig
from pliant.pipeline.workbench import Workbench
from pliant.records.design import Array

# Finite differences and tolerance in sizes of the constants: closed forms, and curves that cost FEM each.
EXACT_STEP, EXACT_TOLERANCE = 1e-5, 1e-9
FEM_STEP, FEM_TOLERANCE, FEM_LEAST = 2e-3, 1e-3, 1e-3
SPARE_ROWS = 2


# Constants in, the measured column (n,) out, in SI; None where the constants make no sense.
Predict = Callable[[MaterialConfig], Array | None]


def calibrate(
    bench: Workbench, study: Study, data: BenchData, fit: Sequence[str] | None = None
) -> Calibration:
    """Fit constants of the study's material.

    Args:
        bench: plugins and progress.
        study: needs `material`; for a free curve `family` and `fem` too.
        data: see `reading.read_bench_data`.
        fit: names of the constants; all but density and Poisson's ratio by default.

    Raises:
        UserError: blocks or constants are missing, there are too few rows, or the modulus is no rubber's.
        NotReachedError: no constants fit, or FEM finds no curve.
    """
    material: MaterialConfig = study.need("material", "a calibration")
    constants = chosen(material, fit)
    _check_rows(data, constants)
    if data.kind == "free":
        curves = _curves(bench, study, data)
        start = _start_of_curve(curves, material, constants, data)
        alone = [c.name for c in constants_of(material) if c.is_modulus] == [c.name for c in constants]
        cheap = curves.similar and alone and len(constants) == 1
        return _fitted(bench, curves.predict, curves, start, constants, data, cheap)
    tests = HomogeneousTests(lambda config: _built(bench, config), data.x, data.mode)
    start = _start_of_tests(tests, material, constants, data)
    return _fitted(bench, tests.predict, None, start, constants, data, cheap=True)


def _check_rows(data: BenchData, constants: Sequence[MaterialConstant]) -> None:
    rest = 1.0 if data.kind == "tensile" else 0.0
    places = {(mode, x) for mode, x in zip(data.mode.tolist(), data.x.tolist(), strict=True) if x != rest}
    needed = len(constants) + SPARE_ROWS
    if len(data) < needed or len(places) < len(constants):
        names = ", ".join(c.written for c in constants)
        raise UserError(
            f"{data.source}: {len(data)} rows at {len(places)} different {data.x_name} are too few to fit {names} "
            f"with an uncertainty; it takes {needed} rows or more, or fewer constants (--fit)."
        )


def _built(bench: Workbench, config: MaterialConfig) -> Material:
    built: Material = bench.build("material", config)
    return built


def _curves(bench: Workbench, study: Study, data: BenchData) -> FreeCurves:
    what = "a calibration on a free curve"
    family: ActuatorFamily = bench.build("family", study.need("family", what))
    curves = FreeCurves.of(bench, family, study.need("fem", what), data.x)
    output = "extension_m" if curves.problem.joint == "prismatic" else "angle_rad"
    for wanted, given in ((curves.problem.actuation, data.x_name), (output, data.y_name)):
        if wanted != given:
            raise UserError(
                f"{data.source}: family '{study.need('family', what).kind}' needs column '{wanted}', and the file has "
                f"'{given}'."
            )
    return curves


def _scalable(material: MaterialConfig, constants: Sequence[MaterialConstant]) -> bool:
    """Whether all moduli may move, so that a factor on them is part of the search."""
    return {c.name for c in constants_of(material) if c.is_modulus} <= {c.name for c in constants}


def _start_of_tests(
    tests: HomogeneousTests, material: MaterialConfig, constants: Sequence[MaterialConstant], data: BenchData
) -> MaterialConfig:
    """The study's constants, moduli scaled to the data by least squares."""
    stress = tests.predict(material)
    if stress is None or not _scalable(material, constants):
        return material
    weight = 1.0 if data.sigma is None else data.sigma**-2.0
    factor = float(np.sum(weight * stress * data.y) / np.sum(weight * stress**2))
    return moduli_scaled(material, factor) or material


def _start_of_curve(
    curves: FreeCurves, material: MaterialConfig, constants: Sequence[MaterialConstant], data: BenchData
) -> MaterialConfig:
    """The study's constants, moduli scaled so that the curve begins with the data's slope."""
    if not curves.similar or not _scalable(material, constants):
        return material
    low = data.x <= 0.5 * data.x.max()
    terms = np.stack([data.x[low], data.x[low] ** 2], axis=1)
    terms = terms if np.unique(data.x[low & (data.x > 0)]).size >= 3 else terms[:, :1]
    slope = float(np.linalg.lstsq(terms, data.y[low], rcond=None)[0][0])
    if not slope > 0:
        slope = float(data.x @ data.y / (data.x @ data.x))
    first = curves.first_slope(material)
    if first * slope <= 0:
        raise UserError(
            f"{data.source}: {data.y_name} falls where the module's rises; positive angles bend the way actuation does."
        )
    return moduli_scaled(material, first / slope) or material


def _fitted(
    bench: Workbench,
    predict: Predict,
    curves: FreeCurves | None,
    start: MaterialConfig,
    constants: Sequence[MaterialConstant],
    data: BenchData,
    cheap: bool,
) -> Calibration:
    places = {c.name: c.value for c in constants_of(start)}
    first = np.array([places[c.name] for c in constants])
    modulus = _built(bench, start).shear_modulus_pa
    scales = np.array(
        [modulus if c.is_modulus else max(abs(x), 0.1) for c, x in zip(constants, first, strict=True)]
    )
    span = float(np.ptp(np.append(data.y, 0.0)))
    weight = 1 / (data.sigma if data.sigma is not None else np.full(len(data), span))

    def residuals(values: Array) -> Array | None:
        config = changed(start, constants, values.tolist())
        predicted = None if config is None else predict(config)
        return None if predicted is None else weight * (predicted - data.y)

    if cheap:
        problem = BlackBox(residuals, scales, EXACT_STEP, True, EXACT_TOLERANCE)
    else:
        problem = BlackBox(residuals, scales, FEM_STEP, False, FEM_TOLERANCE, FEM_LEAST)
    found, hidden = _found(problem, first, constants, curves, weight, span)
    config = None if found is None else changed(start, constants, found.values.tolist())
    if found is None or config is None:
        cause = f": {curves.failure}" if curves is not None and curves.failure else ""
        raise NotReachedError(
            f"{data.source}: with the study's constants the model has no answer to fit from{cause}; start from others."
        )
    material = _built(bench, config)
    fitted = tuple(replace(c, value=float(v)) for c, v in zip(constants, found.values, strict=True))
    doubts = check_modulus(material.shear_modulus_pa, data.y_name)
    order = np.lexsort((data.x, data.mode, data.specimen))
    sure = certainty(found, scales, order, data.specimen, data.sigma is not None)
    lost = {c.name for c in undetermined(fitted, sure.sd, material.shear_modulus_pa)}
    lost |= {c.name for c, is_hidden in zip(fitted, hidden, strict=True) if is_hidden}
    result = Calibration(
        config=config,
        constants=fitted,
        certainty=sure,
        undetermined=tuple(c for c in fitted if c.name in lost),
        shear_modulus_pa=material.shear_modulus_pa,
        shear_modulus_sd_pa=sure.sd_of(_modulus_gradient(bench, config, fitted, scales)),
        data=data,
        predicted=data.y + found.residuals / weight,
        converged=found.converged,
        fem_states=curves.states if curves else 0,
        remarks=(),
    )
    touching = curves.touching(config) if curves else None
    words = remarks_of(result, scales, touching, any(hidden))
    return replace(result, remarks=(*data.remarks, *doubts, *words, *material.remarks()))


def _found(
    problem: BlackBox,
    first: Array,
    constants: Sequence[MaterialConstant],
    curves: FreeCurves | None,
    weight: Array,
    span: float,
) -> tuple[Fit | None, Sequence[bool]]:
    """The minimum, and which constants a computed curve cannot show; then only their common factor is fitted.

    That is asked before the search, since every trial of several constants costs a curve.
    """
    none = [False] * len(constants)
    if curves is None or len(constants) == 1:
        return minimised(problem, first), none
    here = problem.residuals(first)
    slopes = None if here is None else problem.jacobian(first, here)
    if here is None or slopes is None:
        return None, none
    hidden = hidden_by_model_error(slopes / np.reshape(weight * span, (-1, 1)), problem.scales)
    if not hidden.any():
        return minimised(problem, first), none
    moduli = np.array([c.is_modulus for c in constants])
    common = BlackBox(
        lambda factor: problem.residuals(np.where(moduli, first * factor, first)),
        np.ones(1),
        EXACT_STEP,
        True,
        FEM_TOLERANCE,
    )
    scaled = minimised(common, np.ones(1)) if curves.similar else None
    if scaled is None:
        return Fit(first, here, slopes, True), hidden.tolist()
    values = np.where(moduli, first * scaled.values, first)
    return Fit(values, scaled.residuals, slopes, True), hidden.tolist()


def _modulus_gradient(
    bench: Workbench, config: MaterialConfig, constants: Sequence[MaterialConstant], scales: Array
) -> Array:
    """∂μ₀/∂constants (k,), by differences."""
    values = np.array([c.value for c in constants])
    here = _built(bench, config).shear_modulus_pa
    gradient = np.zeros(len(values))
    for k, scale in enumerate(scales):
        move = np.zeros(len(values))
        move[k] = 1e-6 * scale
        near = changed(config, constants, (values + move).tolist())
        gradient[k] = 0.0 if near is None else (_built(bench, near).shear_modulus_pa - here) / move[k]
    return gradient
