"""Meta-models for people and as JSON: scores on designs left out, coverage, cost, designs to solve next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.pipeline.meta_model.next_design import Proposal
from pliant.pipeline.meta_model.parameters import shown, spoken
from pliant.pipeline.meta_model.scoring import Scores
from pliant.pipeline.meta_model.stage import MetaModelStage
from pliant.pipeline.study import DesignStages

WORTH = {
    "gain": "of the mean squared error that solving it would remove",
    "doubt": "of the largest doubt in the range (the model states no gain)",
    "distance": "of the range, to the nearest solved design (the model states neither gain nor doubt)",
}


def result(stage: MetaModelStage) -> dict[str, Any]:
    """The `fit` result of a meta-model."""
    every, designs = stage.scores["all"], stage.designs
    return {
        "kind": stage.config.kind,
        "heldout": {
            "rmse": max(one.rmse for one in every.axes.values()),
            "worst": max(one.worst for one in every.axes.values()),
            "worst_of_range": every.worst_of_range,
            "r2": every.r2,
            "n": sum(one.n_states for one in every.axes.values()),
        },
        "parameters": {"names": list(designs.names), "fixed": dict(designs.fixed)},
        "domain": {name: list(limits) for name, limits in zip(designs.names, designs.box, strict=True)},
        "wall_s": stage.artifact.manifest["wall_s"],
        "designs": len(designs),
        "designs_left_out_of_fit": stage.solved.left_out,
        "n_states": sum(len(one) for one in designs.data),
        "scores": {place: one.as_values() for place, one in stage.scores.items()},
        "coverage": {place: dict(one) for place, one in stage.coverage.items()},
        "parts": stage.parts,
        "fit_wall_s": stage.fit_s,
        "scoring_wall_s": stage.scoring_s,
        "fem_wall_s": _fem_wall_s(stage),
        "details": dict(stage.details),
        "stages": [
            {
                "stage": "meta",
                "key": stage.artifact.key,
                "cached": stage.artifact.cached,
                "wall_s": stage.artifact.manifest["wall_s"],
            }
        ],
    }


def lines(stage: MetaModelStage) -> list[str]:
    """The same for people."""
    designs = stage.designs
    left = f", {stage.solved.left_out} without data or twice" if stage.solved.left_out else ""
    told = [
        f"designs  {len(designs)} from {stage.solved.source}{left}: {_ranges(stage)}",
        f"model    {stage.config.kind}, refitted {stage.parts} times without some of the designs "
        f"({_time(stage)})",
    ]
    if regressor := stage.details.get("regressor"):
        told[-1] += f"; {str(regressor).replace('_', ' ')}"
    told.append(
        "         designs left out       R²       worst    RMS of range   free angle: median    worst"
    )
    for place, one in stage.scores.items():
        told += _score_rows(place, one)
    for place, cover in stage.coverage.items():
        shares = ", ".join(
            f"{100 * share:.1f} % in the {100 * float(level):g} % band" for level, share in cover.items()
        )
        told.append(f"bars     {place}: {shares}")
    return told


def _score_rows(place: str, scores: Scores) -> list[str]:
    """One row for a group of designs, with one for each axis below where there are several."""
    free = (
        f"{100 * scores.free_median:>15.2g} %{100 * scores.free_worst:>8.2g} %"
        if np.isfinite(scores.free_worst)
        else f"{100 * scores.free_median:>15.2g} %, {scores.free_lost} of {scores.free_states} without equilibrium"
    )
    head = f"{place} ({scores.n_designs})"
    rows = [
        f"         {head:<16}{scores.r2:>12.6f}{100 * scores.worst_of_range:>8.2g} %"
        f"{100 * scores.rmse_of_range:>12.2g} %{free}"
    ]
    if len(scores.axes) > 1:
        rows += [
            f"         {'  axis ' + axis:<16}{one.r2:>12.6f}{100 * one.worst_of_range:>8.2g} %"
            f"{100 * one.rmse_of_range:>12.2g} %"
            for axis, one in scores.axes.items()
        ]
    return rows


def _ranges(stage: MetaModelStage) -> str:
    designs = stage.designs
    lows = (spoken({name: low}) for name, low in zip(designs.names, designs.box[:, 0], strict=True))
    highs = (shown(name, high) for name, high in zip(designs.names, designs.box[:, 1], strict=True))
    return ", ".join(f"{low} to {high}" for low, high in zip(lows, highs, strict=True))


def _time(stage: MetaModelStage) -> str:
    text = f"one fit {stage.fit_s:.2g} s, all {stage.scoring_s + stage.fit_s:.3g} s"
    fem = _fem_wall_s(stage)
    text += f"; FEM of the designs {fem:.3g} s" if fem else ""
    return f"{text}; from the store" if stage.artifact.cached else text


def _fem_wall_s(stage: MetaModelStage) -> float:
    return float(sum(np.nansum(one.wall_s) for one in stage.designs.data))


def proposals(found: Sequence[Proposal]) -> dict[str, Any]:
    """Designs to solve next, as JSON."""
    return {"next": [{"parameters": one.parameters, one.basis: one.gain} for one in found]}


def proposal_lines(found: Sequence[Proposal]) -> list[str]:
    """The same for people."""
    told = [f"next     share {WORTH[found[0].basis]}:"]
    for one in found:
        told.append(f"         {100 * one.gain:5.1f} %  {spoken(one.parameters)}")
    return told


def of_law(design: DesignStages) -> dict[str, Any]:
    """What the `fit` result of a law says more where a meta-model gave it."""
    assert design.law.report is not None
    details: Mapping[str, Any] = design.law.report.details
    names = ("meta_model", "design", "inside", "n_designs", "scores", "coverage")
    return {name: details[name] for name in names}


def law_lines(design: DesignStages) -> list[str]:
    """A law that a meta-model gave, for people."""
    assert design.law.report is not None
    report, details = design.law.report, design.law.report.details
    told = [
        f"law      of an unseen design, {spoken(details['design'])}, by meta-model '{details['meta_model']}' of "
        f"{details['n_designs']} designs",
        f"         worst error {100 * report.worst_of_range:.2g} % of the range on designs left out, R² "
        f"{report.r2:.6f}",
    ]
    if "interior" in details["scores"]:
        told[-1] += f" (inside the range {100 * details['scores']['interior']['worst_of_range']:.2g} %)"
    if not details["inside"]:
        told.append("         OUTSIDE the range of the solved designs: extrapolated")
    if details.get("stable") is False:
        told.append("         UNSTABLE: ∂τ/∂u ≥ 0 somewhere in its domain, so a joint may snap.")
    return told
