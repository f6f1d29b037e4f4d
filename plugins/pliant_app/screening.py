"""Screening of all effects: an upper bound of what each could explain of the residual, without a fit.

Near its plausible end an effect changes the readings along its change and its slopes (`excitations`). The share of the
residual's squares along these directions is what it could explain to first order (Rao's score test, 1948). It is an
upper bound, because a fit stays within the effect's bounds.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.diagnosis.candidates import EffectSet, candidate_kinds
from pliant.diagnosis.classes import connected
from pliant.diagnosis.evidence_table import NOTHING, THRESHOLDS
from pliant.diagnosis.excitation import Excitation, applicable, confounded_with, excitations, not_excited
from pliant.diagnosis.fitting import Fitter
from pliant.diagnosis.noise import noise_view
from pliant.diagnosis.readings import readings_over_floor
from pliant.evidence.error_bins import run_residuals
from pliant.evidence.opening import measured_model
from pliant.formatting import display_unit
from pliant.interfaces.effect import EffectParameter
from pliant.measurements.thinning import downsample
from pliant.records.design import Array
from pliant.units import strip_unit_suffix
from pliant_app.open_model import OpenModel
from pliant_app.own_files import defining_file
from pliant_app.page_state import Effects

SHORT = 1e-6  # shorter directions, relative to the longest, are dropped


def screened(model: OpenModel, effects: Effects) -> dict[str, Any]:
    """Return by kind of effect what it could explain of this model's residual, and its confounders.

    Args:
        model: the open model.
        effects: those of the model.
    """
    registry = model.context.registry
    study = model.study.model_copy(update={"effects": model.effects(effects)})
    predictor = measured_model(model.context, study, model.split.training)
    short, _ = downsample(model.split.training, predictor.spatial)
    predictor = predictor if short is model.split.training else predictor.for_runs(short)
    plain = predictor.predict()
    readings, _ = readings_over_floor(short, run_residuals(short, plain))
    fitter = Fitter(predictor, readings)
    kinds, left_out = applicable(registry, fitter, candidate_kinds(registry))
    nothing = fitter.fit(EffectSet.from_kinds(registry, NOTHING))
    shown = excitations(registry, fitter, nothing, kinds)
    noise = noise_view(short, readings.unpack(nothing.residual), readings.scales, model.ground.groups)
    unexcited = set(not_excited(shown, THRESHOLDS))
    pairs = confounded_with(
        {kind: one for kind, one in shown.items() if kind not in unexcited}, {}, noise.n_effective
    )
    groups = connected([kind for kind in kinds if kind not in unexcited], pairs)
    return {
        "kinds": {
            kind: {
                "explains": 0.0 if kind in unexcited else _share(nothing.residual, shown[kind]),
                "shown": kind not in unexcited,
                "excited_by": registry.get("effect", kind).implementation_class().notes.excitation,
                "alike": next((list(group) for group in groups if kind in group and len(group) > 1), []),
            }
            for kind in kinds
        },
        "left_out": left_out,
        "alike": [list(group) for group in groups if len(group) > 1],
    }


def catalogue(model: OpenModel) -> list[dict[str, Any]]:
    """Return every effect that can be fitted, with its words and its sliders."""
    registry = model.context.registry
    found = []
    for kind in candidate_kinds(registry):
        component = registry.get("effect", kind)
        notes = component.implementation_class().notes
        one = EffectSet.from_kinds(registry, (kind,))
        begun = one.configs(one.starts()[0])[0].canonical()
        found.append(
            {
                "kind": kind,
                "summary": component.summary,
                "file": defining_file(registry, kind),
                "signature": notes.signature,
                "on_the_bench": notes.inspection,
                "look_alike": notes.confounder,
                "told_apart": notes.distinguishing_test,
                "begun": begun,
                "sliders": [_slider(parameter.declared) for parameter in one.parameters],
            }
        )
    return found


def _share(residual: Array, one: Excitation) -> float:
    """Return the share of the residual's squares along an effect's directions, less that of random directions."""
    columns = np.column_stack([one.change, one.slopes])
    there = np.isfinite(residual) & np.isfinite(columns).all(axis=1)
    rest, columns = residual[there], columns[there]
    left, size, _ = np.linalg.svd(columns, full_matrices=False)
    basis = left[:, size > SHORT * size.max(initial=0.0)]
    total = float(rest @ rest)
    if not total > 0.0 or not basis.shape[1]:
        return 0.0
    along = basis.T @ rest
    chance = basis.shape[1] / len(rest)
    return float(np.clip((along @ along) / total - chance, 0.0, 1.0))


def _slider(declared: EffectParameter) -> dict[str, Any]:
    """Return a slider's ends, SI: the plausible range extended by half, within the bounds, neutral value included."""
    low, high = declared.plausible
    if declared.prior == "log_normal":
        reach = (low / 3.0, high * 3.0)
    else:
        low, high = min(low, declared.neutral), max(high, declared.neutral)
        reach = (low - 0.5 * (high - low), high + 0.5 * (high - low))
    unit = display_unit("dimensionless" if declared.unit == "1" else declared.unit)
    return {
        "name": declared.name,
        "words": strip_unit_suffix(declared.name).replace("_", " "),
        "role": declared.role,
        "unit": unit.symbol,
        "factor": unit.factor,
        "low": max(reach[0], declared.bounds[0]),
        "high": min(reach[1], declared.bounds[1]),
        "neutral": declared.neutral,
        "plausible": list(declared.plausible),
        "log": declared.prior == "log_normal",
    }
