"""Records as columns of a frame, SI, with the unit in the name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.steps import Improvement
from pliant.pipeline.segments import DesignStages
from pliant.pipeline.study import StudyRun
from pliant.records.design import Array
from pliant.records.fem import ModuleData
from pliant.records.measurement import Measurement

Columns = dict[str, Any]
PRESSURES, ANGLES = 5, 21  # points of the grid that a law is shown on


def readings(measurement: Measurement) -> Columns:
    """Return a row per sample: run, time, inputs, loads that are not zero throughout, readings."""
    parts = []
    for run in measurement.runs:
        count, time = len(run), run.history.time_s
        own: Columns = {"run": [run.name] * count}
        own["time_s"] = np.full(count, np.nan) if time is None else time
        parts.append({**own, **run.history.signals(), **run.outputs})
    return _stacked(parts)


def residuals(measurement: Measurement, predicted: Sequence[Mapping[str, Array]]) -> Columns:
    """Return a row per reading: run, time, output, measured, predicted and their difference."""
    parts = []
    for run, model in zip(measurement.runs, predicted, strict=True):
        time = run.history.time_s
        for output, values in model.items():
            if output in run.outputs:
                count, measured = len(run), run.outputs[output]
                parts.append(
                    {
                        "run": [run.name] * count,
                        "time_s": np.full(count, np.nan) if time is None else time,
                        "output": [output] * count,
                        "measured": measured,
                        "predicted": values,
                        "residual": measured - values,
                    }
                )
    return _stacked(parts)


def _stacked(parts: Sequence[Columns]) -> Columns:
    names = list(dict.fromkeys(name for part in parts for name in part))
    columns: Columns = {}
    for name in names:
        cells = [part.get(name, np.full(len(next(iter(part.values()))), np.nan)) for part in parts]
        columns[name] = np.concatenate([np.asarray(c) for c in cells])
    return columns


def markers(run: StudyRun) -> Columns:
    """Return a row per engine and marker of the settled chain: base, joints, tip."""
    rows = [
        (engine.kind, number, *map(float, place))
        for engine in run.engines
        if engine.result is not None
        for number, place in enumerate(engine.result.final.markers_m)
    ]
    names = ("engine", "marker", "x_m", "y_m", "z_m")
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def laws(designs: Sequence[DesignStages]) -> Columns:
    """Return τ and its slopes on a grid over each law's domain, along its first axis."""
    parts = []
    for number, design in enumerate(designs):
        law = design.law.law
        low, high = (side if np.isfinite(side) else 0.0 for side in law.domain.actuation)
        left, right = law.domain.deformation[0]
        p, u = (
            grid.ravel()
            for grid in np.meshgrid(
                np.linspace(low, high, PRESSURES), np.linspace(left, right, ANGLES), indexing="ij"
            )
        )
        deformation = np.zeros((len(p), len(law.axes)))
        deformation[:, 0] = u
        effort = law.evaluate(p, deformation)
        coordinate, unit = (
            ("extension_m", "force_n") if law.joint == "prismatic" else ("angle_rad", "moment_n_m")
        )
        parts.append(
            {
                "design": np.full(len(p), number),
                law.actuation_name: p,
                coordinate: u,
                unit: effort.tau[:, 0],
                f"d{unit.partition('_')[0]}_dp": effort.dtau_dp[:, 0],
                f"d{unit.partition('_')[0]}_du": effort.dtau_du[:, 0, 0],
            }
        )
    return _stacked(parts)


def module_data(data: ModuleData) -> Columns:
    """Return a row per solved state, with a column for each coordinate and effort."""
    slides = data.joint == "prismatic"
    coordinate, effort = ("extension_m", "force_n") if slides else ("angle_rad", "moment_n_m")
    several = len(data.axes) > 1
    columns: Columns = {data.actuation_name: data.actuation}
    for k, axis in enumerate(data.axes):
        end = f"_{axis}" if several else ""
        columns[coordinate + end], columns[effort + end] = data.deformation[:, k], data.tau[:, k]
    return {
        **columns,
        "energy_j": data.energy_j,
        "branch": data.branch,
        "status": data.status,
        "role": data.role,
    }


def hypotheses(diagnosis: Diagnosis) -> Columns:
    """Return a row per hypothesis, the most probable first."""
    probability = diagnosis.judgement.probability
    return {
        "kinds": [" + ".join(kinds) or "nothing missing" for kinds in probability],
        "probability": list(probability.values()),
        "error_over_floor": [diagnosis.left_out_ratio(kinds) for kinds in probability],
    }


def steps(improvement: Improvement) -> Columns:
    """Return a row per step: what was added, and the error after it divided by the noise floor."""
    return {
        "added": [step.named or "the model as it was" for step in improvement.steps],
        "error_over_floor": [step.locked.over_floor for step in improvement.steps],
        "standard_error": [step.locked_se for step in improvement.steps],
        "error_over_floor_left_out": [step.training.over_floor for step in improvement.steps],
    }
