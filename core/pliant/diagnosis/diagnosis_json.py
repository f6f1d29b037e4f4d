"""A diagnosis as JSON values: the keys of `pliant diagnose --json`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.drift import Drift
from pliant.diagnosis.heldout import heldout_residual
from pliant.diagnosis.next_run import next_run_json
from pliant.diagnosis.table import NOTHING, UNKNOWN, Kinds
from pliant.measurements.columns import unit_of
from pliant.records.design import Array


def diagnosis_json(found: Diagnosis) -> dict[str, Any]:
    """Keys of docs/formats.md, and beside them what the verdict rests on."""
    judgement = found.judgement
    return {
        "verdict": judgement.verdict,
        "reasons": list(judgement.reasons),
        "hypotheses": [_hypothesis(found, *entry) for entry in judgement.probability.items()],
        "selected": list(judgement.selected),
        "credible_set": [list(kinds) for kinds in judgement.credible],
        "not_excited": [
            {"kind": kind, "run_that_would_excite_it": run} for kind, run in found.not_excited.items()
        ],
        "indistinguishable": [
            {"a": pair.a, "b": pair.b, "unexplained_share": pair.unexplained_share}
            for pair in found.indistinguishable
        ],
        "classes": [
            {
                "kinds": list(one.kinds),
                "run": one.run,
                "words": one.words,
                "minutes": one.minutes,
                "parts": [list(part) for part in one.parts],
            }
            for one in found.classes
        ],
        "covariates": [
            {"name": name, "importance": value} for name, value in found.depends_on.items() if value > 0.0
        ],
        "next_experiment": next_run_json(found.next_run),
        "smallest_detectable": [
            {"kind": d.kind, "parameter": d.parameter, "value": d.value, "unit": d.unit}
            for d in found.detectable
        ],
        "floor": {
            name: {"value": floor.value, "unit": unit_of(name), "source": floor.source, "se": floor.se}
            for name, floor in found.noise.floors.items()
        },
        "n_samples": found.table.n_readings,
        "n_effective": found.noise.n_effective,
        "slip": found.noise.slip,
        "drift": _drift(found.noise.drift),
        "judged": found.noise.judged,
        "remarks": list(found.remarks),
        "wall_s": found.wall_s,
    }


def _drift(drift: Drift | None) -> dict[str, Any] | None:
    if drift is None:
        return None
    return {"output": drift.output, "share": drift.share, "over_floor": drift.size}


def _hypothesis(found: Diagnosis, kinds: Kinds, probability: float) -> dict[str, Any]:
    if kinds == UNKNOWN:
        return {
            "kinds": list(kinds),
            "probability": probability,
            "parameters": {},
            "heldout": {},
            "rmse_over_floor": found.table.over_floor(found.noise.floor_square),
        }
    fit, row = found.fits[kinds], found.table.rows[kinds]
    left = heldout_residual(fit, found.readings.fold, found.fits[NOTHING].residual)
    return {
        "kinds": list(kinds),
        "probability": probability,
        "parameters": parameters(found, kinds),
        "heldout": heldout_errors(found, left),
        "rmse_over_floor": found.table.over_floor(row.heldout_square),
        "mean_square": row.mean_square,
        "heldout_square": row.heldout_square,
        "unseen_square": row.unseen_square,
        "n_parameters": row.n_parameters,
        "at_limit": list(row.at_limit),
    }


def heldout_errors(found: Diagnosis, left: Array) -> Mapping[str, Any]:
    """RMSE of each output on runs left out, in its unit."""
    errors = {}
    for k, name in enumerate(found.readings.outputs):
        mine = left[found.readings.output == k]
        scale = found.readings.scales[name]
        errors[name] = {"rmse": float(np.sqrt(np.mean(mine**2))) * scale, "unit": unit_of(name)}
    return errors


def parameters(found: Diagnosis, kinds: Kinds) -> dict[str, Any]:
    """Value, standard deviation, 90 % interval and unit of each parameter; empty where nothing was fitted."""
    if kinds not in found.estimates:
        return {}
    return {
        e.name: {
            "value": e.value,
            "sd": e.sd,
            "low": e.low,
            "high": e.high,
            "unit": e.parameter.unit,
            "plausible": e.plausible,
        }
        for e in found.estimates[kinds].estimates
    }
