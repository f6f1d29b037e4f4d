"""Fit of a material's constants to laboratory data: start, search, uncertainty, objections to the result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pliant.config.study import Study
from pliant.errors import NotReachedError, UserError
from pliant.interfaces.family import ActuatorFamily
from pliant.interfaces.material import Material, MaterialConfig
from pliant.mechanics.homogeneous import INCOMPRESSIBLE_RATIO
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant_calibrate.checks import check_modulus
from pliant_calibrate.fitting import (
    RATIO,
    BlackBox,
    Fit,
    MaterialConstant,
    changed,
    chosen,
    is_incompressible,
    material_constants,
    minimised,
    moduli_scaled,
)
from pliant_calibrate.free_curve import FreeCurves, HomogeneousTests
from pliant_calibrate.nearest import nearest_materials
from pliant_calibrate.reading import BenchData, read_bench_data
from pliant_calibrate.result import (
    Calibration,
    calibration_remarks,
    certainty,
    hidden_by_model_error,
    undetermined,
)
from pliant_calibrate.starts import best_start
from pliant_calibrate.volume import assess_volume

# Finite differences and tolerance relative to the constants: for closed forms, and for curves by FEM.
EXACT_STEP, EXACT_TOLERANCE = 1e-5, 1e-9
FEM_STEP, FEM_TOLERANCE, FEM_LEAST = 2e-3, 1e-3, 1e-3
SPARE_ROWS = 2
# Limit of powers, since a term that fits a single reading would grow without bound; tissues reach powers of 25.
MOST_POWER = 30.0
# A fitted modulus at rest below this share of the start's, which is scaled to the data, is on the bound μ₀ > 0.
LEAST_MODULUS = 1e-4


# Constants → the measured column (n,) in SI; None for invalid constants.
Predict = Callable[[MaterialConfig], Array | None]


def calibrate_file(
    context: RunContext, study: Study, file: Path, test: str | None = None, fit: Sequence[str] | None = None
) -> Calibration:
    """Fit constants of the study's material to a table of a test; arguments and errors as `calibrate`."""
    return calibrate(context, study, read_bench_data(file, test), fit)


def calibrate(
    context: RunContext, study: Study, data: BenchData, fit: Sequence[str] | None = None
) -> Calibration:
    """Fit constants of the study's material.

    Args:
        context: plugins and progress.
        study: needs `material`; for a free curve `family` and `fem` too.
        data: see `reading.read_bench_data`.
        fit: names of the constants; all but density and Poisson's ratio by default.

    Raises:
        UserError: blocks or constants are missing, there are too few rows, or the modulus is impossible for rubber.
        NotReachedError: no constants fit, or FEM finds no curve.
    """
    material: MaterialConfig = study.need("material", "a calibration")
    constants = chosen(material, fit)
    _check_rows(data, constants)
    if data.kind == "free":
        curves = _curves(context, study, data)
        start = _initial_from_curve(curves, material, constants, data)
        alone = [c.name for c in material_constants(material) if c.is_modulus] == [c.name for c in constants]
        cheap = curves.similar and alone and len(constants) == 1
        return _fitted(context, curves.predict, curves, start, constants, data, material, cheap)
    incompressible = is_incompressible(material, constants)
    tests = HomogeneousTests(lambda config: _built(context, config), data.x, data.mode, incompressible)
    ratio = [MaterialConstant(RATIO, None, RATIO, INCOMPRESSIBLE_RATIO)] if incompressible else []
    held = changed(material, ratio, [one.value for one in ratio])  # None if a kind does not allow this ν
    start = _initial_from_tests(tests, held or material, constants, data)
    return _fitted(context, tests.predict, None, start, constants, data, material, cheap=True)


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


def _built(context: RunContext, config: MaterialConfig) -> Material:
    built: Material = context.build("material", config)
    return built


def _curves(context: RunContext, study: Study, data: BenchData) -> FreeCurves:
    what = "a calibration on a free curve"
    family: ActuatorFamily = context.build("family", study.need("family", what))
    curves = FreeCurves.from_module(context, family, study.need("fem", what), data.x)
    output = "extension_m" if curves.problem.joint == "prismatic" else "angle_rad"
    for wanted, given in ((curves.problem.actuation, data.x_name), (output, data.y_name)):
        if wanted != given:
            raise UserError(
                f"{data.source}: family '{study.need('family', what).kind}' needs column '{wanted}', and the file has "
                f"'{given}'."
            )
    return curves


def _scalable(material: MaterialConfig, constants: Sequence[MaterialConstant]) -> bool:
    """Return whether all moduli are fitted, so that a common factor is part of the search."""
    return {c.name for c in material_constants(material) if c.is_modulus} <= {c.name for c in constants}


def _initial_from_tests(
    tests: HomogeneousTests, material: MaterialConfig, constants: Sequence[MaterialConstant], data: BenchData
) -> MaterialConfig:
    """Return the study's constants, moduli scaled by least squares; for powers the best of several starts."""
    stress = tests.predict(material)
    if stress is not None and _scalable(material, constants):
        weight = 1.0 if data.sigma is None else data.sigma**-2.0
        factor = float(np.sum(weight * stress * data.y) / np.sum(weight * stress**2))
        material = moduli_scaled(material, factor) or material
    moduli = np.array([c.is_modulus for c in constants])
    powers = np.array([c.is_power for c in constants])
    if not (powers.any() and moduli.any() and np.all(moduli | powers)):
        return material
    linear = replace(tests, incompressible=True)
    first, problem = _problem(tests.build, linear.predict, material, constants, data)
    values = best_start(problem, -_weight(data) * data.y, first, moduli)
    return changed(material, constants, values.tolist()) or material


def _initial_from_curve(
    curves: FreeCurves, material: MaterialConfig, constants: Sequence[MaterialConstant], data: BenchData
) -> MaterialConfig:
    """Return the study's constants, moduli scaled so that the curve has the data's initial slope."""
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
            f"{data.source}: {data.y_name} falls where the module's rises; positive angles bend in the "
            "direction of actuation."
        )
    return moduli_scaled(material, first / slope) or material


def _fitted(
    context: RunContext,
    predict: Predict,
    curves: FreeCurves | None,
    start: MaterialConfig,
    constants: Sequence[MaterialConstant],
    data: BenchData,
    study_material: MaterialConfig,
    cheap: bool,
) -> Calibration:
    first, problem = _problem(lambda config: _built(context, config), predict, start, constants, data, cheap)
    scales, weight = problem.scales, _weight(data)
    found, hidden = _found(problem, first, constants, curves, weight, _span(data))
    config = None if found is None else changed(start, constants, found.values.tolist())
    if found is None or config is None:
        cause = f": {curves.failure}" if curves is not None and curves.failure else ""
        raise NotReachedError(
            f"{data.source}: with the study's constants the model has no answer to fit from{cause}; start from others."
        )
    material = _built(context, config)
    if material.shear_modulus_pa < LEAST_MODULUS * _built(context, start).shear_modulus_pa:
        others = ", ".join(kind for kind in ("yeoh", "ogden") if kind != config.kind)
        raise UserError(
            f"{data.source}: law '{config.kind}' follows these data best with no stiffness at rest, so it is no law "
            f"for {data.x_name} up to {data.x.max():.3g}; use another ({others}), or leave the largest out."
        )
    fits_ratio = any(c.field == RATIO for c in constants)
    incompressible = curves is None and is_incompressible(study_material, constants)
    volume = assess_volume(study_material, material, data, fits_ratio, incompressible, curves)
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
        shear_modulus_sd_pa=sure.standard_deviation(_modulus_gradient(context, config, fitted, scales)),
        data=data,
        predicted=data.y + found.residuals / weight,
        converged=found.converged,
        fem_states=curves.states if curves else 0,
        volume=volume,
        nearest=nearest_materials(context, material, data),
        remarks=(),
    )
    touching = curves.touching(config) if curves else None
    words = [*calibration_remarks(result, scales, touching, any(hidden)), *_at_limit(problem, fitted)]
    return replace(result, remarks=(*data.remarks, *doubts, *words, *volume.remarks(), *material.remarks()))


def _at_limit(problem: BlackBox, fitted: Sequence[MaterialConstant]) -> list[str]:
    limit = np.full(len(fitted), np.inf) if problem.limit is None else problem.limit
    return [
        f"{one.written} ended at {one.value:g}, the largest power that is searched: its term affects only the "
        "outermost rows. Use fewer terms, or another law."
        for one, most in zip(fitted, limit, strict=True)
        if abs(one.value) >= most * (1 - 1e-9)
    ]


def _span(data: BenchData) -> float:
    return float(np.ptp(np.append(data.y, 0.0)))


def _weight(data: BenchData) -> Array:
    return 1 / (data.sigma if data.sigma is not None else np.full(len(data), _span(data)))


def _problem(
    build: Callable[[MaterialConfig], Material],
    predict: Predict,
    start: MaterialConfig,
    constants: Sequence[MaterialConstant],
    data: BenchData,
    cheap: bool = True,
) -> tuple[Array, BlackBox]:
    """Return the constants (k,) of a start, and the weighted misfit to minimise."""
    places = {c.name: c.value for c in material_constants(start)}
    first = np.array([places[c.name] for c in constants])
    modulus, weight = build(start).shear_modulus_pa, _weight(data)
    scales = np.array(
        [modulus if c.is_modulus else max(abs(x), 0.1) for c, x in zip(constants, first, strict=True)]
    )

    def residuals(values: Array) -> Array | None:
        config = changed(start, constants, values.tolist())
        predicted = None if config is None else predict(config)
        return None if predicted is None else weight * (predicted - data.y)

    if cheap:
        sizes = np.where(np.abs(first) <= MOST_POWER, MOST_POWER, 10 * np.abs(first))
        limit = np.where([c.is_power for c in constants], sizes, np.inf)
        return first, BlackBox(residuals, scales, EXACT_STEP, True, EXACT_TOLERANCE, limit=limit)
    return first, BlackBox(residuals, scales, FEM_STEP, False, FEM_TOLERANCE, FEM_LEAST)


def _found(
    problem: BlackBox,
    first: Array,
    constants: Sequence[MaterialConstant],
    curves: FreeCurves | None,
    weight: Array,
    span: float,
) -> tuple[Fit | None, Sequence[bool]]:
    """Return the minimum, and which constants a computed curve cannot identify; their common factor is fitted.

    This is determined before the search, since every trial of several constants costs a curve.
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
    context: RunContext, config: MaterialConfig, constants: Sequence[MaterialConstant], scales: Array
) -> Array:
    """Return ∂μ₀/∂constants (k,), by differences."""
    values = np.array([c.value for c in constants])
    here = _built(context, config).shear_modulus_pa
    gradient = np.zeros(len(values))
    for k, scale in enumerate(scales):
        move = np.zeros(len(values))
        move[k] = 1e-6 * scale
        near = changed(config, constants, (values + move).tolist())
        gradient[k] = 0.0 if near is None else (_built(context, near).shear_modulus_pa - here) / move[k]
    return gradient
