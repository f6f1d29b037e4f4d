"""Quantities of a finished run for sentences, figures and page: the chain's frame and loads, engines, levels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.config.chain import ChainConfig
from pliant.formatting import actuation_unit, small_length
from pliant.pipeline.chain import base_rotation
from pliant.pipeline.run_folder import DesignResult, EngineResult, FinishedRun
from pliant.records.chain import default_base_rotation
from pliant.records.design import Array
from pliant.records.law import JointLaw
from pliant.records.rollout import TaskResult


def chain_config(run: FinishedRun) -> ChainConfig | None:
    """Return the study's chain, without the laws of its segments."""
    chain = run.study.get("chain")
    if not chain:
        return None
    segments = [
        {k: v for k, v in segment.items() if k != "surrogate"} for segment in chain.get("segments") or ()
    ]
    return ChainConfig.model_validate({**chain, "segments": segments})


def base_pose(run: FinishedRun) -> tuple[Array, Array]:
    """Return position (3,) and rotation (3, 3) of the chain's base in the world; on an arm, its final pose."""
    chain = chain_config(run)
    if chain is None:
        return np.zeros(3), default_base_rotation()
    position, rotation = np.array(chain.base.position_m, float), base_rotation(chain.base)
    carrier = run.engines[0].result.final.carrier if run.engines else None
    if carrier is None:
        return position, rotation
    return carrier.in_world(position), carrier.rotation @ rotation


def gravity(run: FinishedRun) -> Array:
    """Return gravity (3,) in m/s²; zeros without a chain."""
    chain = chain_config(run)
    return np.array(chain.gravity_m_s2, float) if chain else np.zeros(3)


def payload_kg(run: FinishedRun) -> float:
    """Return the mass at the tip: the task's, else the chain's."""
    task = run.study.get("task") or {}
    if task.get("payload_kg") is not None:
        return float(task["payload_kg"])
    chain = chain_config(run)
    return float(chain.payload_kg) if chain else 0.0


def actuation(run: FinishedRun) -> tuple[str, float] | None:
    """Return name and full value of the task's actuation, or None without a task."""
    task = run.study.get("task") or {}
    for name, value in sorted(task.items()):
        if name in ("pressure_pa", "tendon_force_n") and value is not None:
            return name, float(value)
    histories = [r.result.rollout for r in run.engines if r.result.rollout is not None]
    if not histories or not len(histories[0].actuation):
        return None
    return run.designs[0].law.actuation_name, float(histories[0].actuation[-1].max())


def actuation_text(run: FinishedRun) -> str:
    """Return `` at 15 kPa``, as the end of a phrase; empty without a task."""
    given = actuation(run)
    return f" at {actuation_unit(given[0]).text(given[1])}" if given else ""


def main_axis(law: JointLaw, data_axis: str = "y") -> int:
    """Return the index of the axis that is plotted: that of the data, else y, else the first."""
    for axis in (data_axis, "y"):
        if axis in law.axes:
            return law.axes.index(axis)
    return 0


def rest_markers(run: FinishedRun) -> Array | None:
    """Return (n + 2, 3) markers of the straight chain, or None where links change their length."""
    if not run.engines or run.designs[0].law.joint == "prismatic":
        return None
    position, rotation = base_pose(run)
    links = np.linalg.norm(np.diff(run.engines[0].markers_m, axis=0), axis=1)
    reach = np.concatenate([[0.0], np.cumsum(links)])
    return np.asarray(position + reach[:, None] * rotation[:, 0])


def history_levels(result: TaskResult, count: int) -> list[tuple[float, Array, Array]]:
    """Return actuation, joint angles and markers at up to `count` steps of the history, without the last one."""
    history = result.rollout
    if history is None or len(history.time_s) < 2:
        return []
    size = np.abs(history.actuation).max(axis=1)
    wanted = np.linspace(0, size[-1], count + 2)[1:-1]
    steps = sorted({int(np.abs(size[:-1] - level).argmin()) for level in wanted})
    return [(float(size[i]), history.joint_angles[i], history.markers_m[i]) for i in steps if size[i] > 0]


def plotted_effort(design: DesignResult, actuation: Array, deformation: Array) -> Array:
    """Return τ (n,) of a design's law on its plotted axis, the other axes at rest."""
    p, u, axis = _at_rest_otherwise(design, actuation, deformation)
    return np.asarray(design.law.evaluate(p, u).tau[:, axis])


def _at_rest_otherwise(
    design: DesignResult, actuation: Array, deformation: Array
) -> tuple[Array, Array, int]:
    """Return actuation (n,), deformation (n, a) and index of the plotted axis, the only one where u is not zero."""
    axis = main_axis(design.law, design.fem.axis if design.fem else "y")
    u = np.zeros((len(actuation), len(design.law.axes)))
    u[:, axis] = deformation
    return np.asarray(actuation, float), u, axis


def plotted_band(design: DesignResult, actuation: Array, deformation: Array) -> Array | None:
    """Return half-width (n,) of the 90 % band on a design's plotted axis, others at rest; None without an error."""
    p, u, axis = _at_rest_otherwise(design, actuation, deformation)
    band = design.law.band(p, u)
    return None if band is None else np.asarray(band[:, axis])


def study_form(design: DesignResult) -> Mapping[str, Any] | None:
    """Return scores and coefficients of the published form fitted to the same states, if it could be fitted."""
    found = design.fit.details.get("study_form") if design.fit else None
    return found if found and "parameters" in found else None


def module_designs(run: FinishedRun) -> tuple[list[int], list[float]] | None:
    """Return for each module its design's index and its turn about the chain axis (rad), or None without a chain."""
    chain = chain_config(run)
    if chain is None:
        return None
    segments = chain.as_segments()
    indices = run.segment_designs or (0,) * len(segments)
    designs = [
        index for index, segment in zip(indices, segments, strict=True) for _ in range(segment.modules or 0)
    ]
    turns = [segment.rotation_rad for segment in segments for _ in range(segment.modules or 0)]
    return designs, turns


def distances_m(engines: Sequence[EngineResult]) -> list[Array]:
    """Return for each engine the distance (n + 2,) of its markers to those of the first engine."""
    first = engines[0].markers_m
    return [np.linalg.norm(e.markers_m - first, axis=1) for e in engines]


def gravity_words(run: FinishedRun) -> str:
    """Return whether weight acts, for captions."""
    chain = chain_config(run)
    return "under gravity" if chain is not None and any(chain.gravity_m_s2) else "without gravity"


def spread_sentence(spread: Mapping[str, Any], engine: str) -> str:
    """Return the uncertainty of the tip caused by the laws' error bars, as a sentence."""
    if "tip_mean_m" not in spread:
        return f"None of {spread['samples']} runs with drawn laws settled, so there is no interval."
    failed = f"; {spread['failed']} of them did not settle" if spread["failed"] else ""
    return (
        f"{100 * float(spread['level']):g} % of {spread['samples']} runs in {engine} with laws drawn from their error "
        f"bars end within {small_length(float(spread['tip_radius_m']))} of their mean tip{failed}."
    )
