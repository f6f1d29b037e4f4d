"""A comparison as the JSON object of `pliant compare` (docs/compare.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from pliant.evidence.comparison import Comparison
from pliant.evidence.interpretation import interpret
from pliant.evidence.places import Place
from pliant.evidence.scores import GroupError, OutputError
from pliant.evidence.words import si_unit


def comparison_json(comparison: Comparison) -> dict[str, Any]:
    """Plain values by the keys of docs/compare.md; numbers SI, what is not known NaN."""
    return {
        "outputs": {name: _output(error) for name, error in comparison.outputs.items()},
        "rmse_over_floor": comparison.rmse_over_floor,
        "rmse_over_floor_interval": list(comparison.rmse_over_floor_interval),
        "interpretation": interpret(comparison),
        "judged": comparison.judged,
        "runs": [_group(run, "run") for run in comparison.runs],
        "conditions": [_group(condition, "condition") for condition in comparison.conditions],
        "worst": [_place(place) for place in comparison.worst],
        "covariates": [{"name": name, "importance": share} for name, share in comparison.depends_on.items()],
        "bins": [{**_place(place), "outputs": _place_outputs(place)} for place in comparison.places],
        "n_places": comparison.n_places,
        "n_samples": comparison.n_samples,
        "n_effective": comparison.n_effective,
        "remarks": list(comparison.remarks),
    }


def _output(error: OutputError) -> dict[str, Any]:
    return {
        "rmse": error.rmse,
        "unit": error.unit,
        "noise_floor": error.noise_floor,
        "floor_source": error.source,
        "ratio_to_floor": error.ratio_to_floor,
        "bias": error.bias,
        "rmse_interval": list(error.rmse_interval),
        "bias_interval": list(error.bias_interval),
        "noise_within": error.noise.within,
        "noise_between": error.noise.between,
        "n": error.n,
        "n_effective": error.n_effective,
    }


def _group(group: GroupError, key: str) -> dict[str, Any]:
    outputs: Mapping[str, Mapping[str, float]] = group.outputs
    return {
        key: group.name,
        "words": group.words,
        **({"runs": list(group.runs)} if key == "condition" else {}),
        "outputs": {name: {**values, "unit": si_unit(name)} for name, values in outputs.items()},
        "rmse_over_floor": group.rmse_over_floor,
        "share_of_error": group.share_of_error,
        "n_samples": group.n,
    }


def _place(place: Place) -> dict[str, Any]:
    return {
        "condition": place.condition,
        "covariate": place.covariate,
        "share_of_error": place.share_of_error,
        "share_of_samples": place.share_of_samples,
        "z": place.z,
        "output": place.output,
        "significant": place.significant,
        "rmse_over_floor": place.rms_over_floor,
        "centre": place.centre,
    }


def _place_outputs(place: Place) -> dict[str, Any]:
    return {
        name: {**asdict(entry), "interval": list(entry.interval), "unit": si_unit(name)}
        for name, entry in place.outputs.items()
    }
