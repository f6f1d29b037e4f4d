"""A meta-model as a document: scores on held-out designs, error bars, what to solve next; terminal, page and JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.config.design_parameters import shown, spoken
from pliant.formatting import percent, seconds, units_footer
from pliant.pipeline.workbench import RunContext
from pliant.report.document import Document, Table, Warned, answers, brief, brief_table, capital
from pliant.report.provenance import made_by, stage_json
from pliant.report.stage import StoredPage
from pliant_designs.fitted_model import MetaFitted
from pliant_designs.report.meta_page import SCORES, coverage_table, meta_drawn, next_table, score_rows
from pliant_designs.stage import MetaModelStage

PAGE = "fit.html"
FAR = 0.05  # of the range: a larger worst error gives a warning


def meta_document(title: str, fitted: Sequence[MetaFitted], study: Mapping[str, Any]) -> Document:
    """Return the document of `pliant fit` for a meta-model.

    Args:
        title: the study's name.
        fitted: the model, then others of the same designs for a comparison, such as the published form.
        study: inputs to list.
    """
    own, manifests = fitted[0], _manifests(fitted)

    data = meta_json(own.stage)
    if own.proposals:
        data["next"] = [{"parameters": one.parameters, one.basis: one.gain} for one in own.proposals]
    limits = tuple(meta_warnings(own))
    return Document(
        kind="Pliant fit: meta-model",
        title=title,
        sentence=meta_sentence(own),
        data=data,
        brief=_blocks(fitted),
        answers=answers(
            f"Torques of designs left out within {percent(own.stage.scores['all'].worst_of_range)} of their range.",
            limits[0].sentence if limits else "",
            meta_sure(own),
            "Solve the proposed designs, then compute the law of a new one: pliant fit, pliant simulate.",
        ),
        warnings=limits,
        draw=lambda: meta_drawn(fitted, study, manifests),
        footer=units_footer(lengths="m", pressures="Pa", moments="N*m", angles="rad"),
        page=PAGE,
        version=made_by(manifests),
    )


def stored_meta_page(
    context: RunContext, document: Document, fitted: Sequence[MetaFitted], study: Mapping[str, Any]
) -> StoredPage:
    """Return the page of a meta-model with the data that it depends on; arguments as those of `meta_document`."""
    config = {
        "title": document.title,
        "study": dict(study),
        "source": fitted[0].stage.solved.source,
        "proposals": [[*one.values, one.gain, one.basis] for one in fitted[0].proposals],
    }
    components = [context.component("meta_model", one.stage.config) for one in fitted]
    return StoredPage(context, _manifests(fitted), components, "pliant_designs.report.meta_page", config)


def _manifests(fitted: Sequence[MetaFitted]) -> list[Mapping[str, Any]]:
    curves = [one.learning.manifest for one in fitted if one.learning is not None]
    return [*(one.stage.artifact.manifest for one in fitted), *curves]


def meta_json(stage: MetaModelStage) -> dict[str, Any]:
    """Return the `fit` result of a meta-model."""
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
        "fem_wall_s": float(sum(np.nansum(one.wall_s) for one in designs.data)),
        "details": dict(stage.details),
        "stages": [stage_json(stage.artifact)],
    }


def _blocks(fitted: Sequence[MetaFitted]) -> tuple[Table | str, ...]:
    own, stage = fitted[0], fitted[0].stage
    left = f", {stage.solved.left_out} without data or twice" if stage.solved.left_out else ""
    spans = zip(own.designs.names, own.designs.box, strict=True)
    ranges = ", ".join(f"{spoken({name: low})} to {shown(name, high)}" for name, (low, high) in spans)
    times = f"one fit {seconds(stage.fit_s)}, all {seconds(stage.scoring_s + stage.fit_s)}"
    times += f"; FEM of the designs {seconds(own.fem_s)}" if own.fem_s else ""
    times += "; from the store" if stage.artifact.cached else ""
    regressor = stage.details.get("regressor")
    blocks: list[Table | str] = [
        f"designs  {len(own.designs)} from {stage.solved.source}{left}: {ranges}",
        f"model    {stage.config.kind}, refitted {stage.parts} times without some of the designs ({times})"
        + (f"; {str(regressor).replace('_', ' ')}" if regressor else ""),
    ]
    for one in fitted:
        blocks += [f"beside   {one.name}:"] if one is not own else []
        blocks.append(brief_table(SCORES, score_rows([one])))
        blocks += [brief(coverage_table(one))] if one.stage.coverage else []
    asked = next_table(own)
    return (*blocks, *([brief(asked)] if asked else []))


def meta_sentence(fitted: MetaFitted) -> str:
    """Return a sentence on the errors of laws of unseen designs."""
    inner = fitted.stage.scores.get("interior", fitted.stage.scores["all"])
    where = "inside the range" if "interior" in fitted.stage.scores else "left out"
    parts = [
        f"laws of designs {where} that the model has not seen miss torques by at most "
        f"{percent(inner.worst_of_range)} of the range, R² {inner.r2:.5f}"
    ]
    if np.isfinite(inner.free_median):
        parts.append(f"free angles by {percent(inner.free_median)} at the median")
    if "border" in fitted.stage.scores:
        parts.append(
            f"on the border of the range by up to {percent(fitted.stage.scores['border'].worst_of_range)}"
        )
    if (band := fitted.stage.coverage.get("all", {}).get("0.9")) is not None:
        parts.append(f"the 90 % band holds {percent(band, 3)}")
    return capital("; ".join(parts)) + "."


def meta_sure(fitted: MetaFitted) -> str:
    """Return the coverage of the band on held-out designs; empty without one."""
    band = fitted.stage.coverage.get("all", {}).get("0.9")
    return (
        "" if band is None else f"The 90 % band holds {percent(band, 3)} of the states of designs left out."
    )


def meta_warnings(fitted: MetaFitted) -> list[Warned]:
    """Return the limits of the model."""
    found = []
    for place, scores in fitted.stage.scores.items():
        if place != "all" and scores.worst_of_range > FAR:
            text = (
                f"Designs {'on the border' if place == 'border' else 'inside the range'} are missed by up to "
            )
            found.append(Warned(f"{text}{percent(scores.worst_of_range)} of their range of torque."))
    if lost := fitted.stage.scores["all"].free_lost:
        found.append(Warned(f"In {lost} states the law of a design left out has no free equilibrium."))
    return found
