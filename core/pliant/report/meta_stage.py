"""The page of a meta-model: from the store when nothing that it shows has changed, written as `fit.html`."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pliant import __version__
from pliant.pipeline.law_speed import evaluations_per_second
from pliant.pipeline.meta_model.learning import design_learning_stage
from pliant.pipeline.meta_model.leaving_out import Misses
from pliant.pipeline.meta_model.next_design import Proposal
from pliant.pipeline.meta_model.stage import MetaModelStage
from pliant.pipeline.workbench import Workbench
from pliant.report.fit_stage import FIT_PAGE
from pliant.store.fingerprint import versions
from pliant.store.store import Artifact, write_atomically, writing_in

TIMED = 5  # designs whose law is timed


def meta_report_stage(
    bench: Workbench,
    title: str,
    stage: MetaModelStage,
    study: Mapping[str, Any],
    folder: Path,
    *,
    learning: bool = True,
    proposals: Sequence[Proposal] = (),
    compared: Sequence[MetaModelStage] = (),
) -> Path:
    """Render the page of a meta-model, or find it in the store, and write it as `fit.html`; returns its path.

    Args:
        learning: whether the model is fitted again to parts of the designs, for the learning curve.
        proposals: designs that should be solved next, where they were asked for.
        compared: other meta-models of the same designs, such as the study's way, to stand beside this one.
    """
    curve = design_learning_stage(bench, stage) if learning else None
    stages = [stage, *compared]
    artifacts: list[Artifact] = [one.artifact for one in stages] + ([curve] if curve is not None else [])

    def compute(partial: Path) -> dict[str, Any]:
        from pliant.report.meta_page import render_meta  # matplotlib takes a second to import

        own = _fitted(stage, curve.value if curve is not None else None, proposals)
        beside = [_fitted(one, None, ()) for one in compared]
        return {"html": render_meta(title, own, study, [a.manifest for a in artifacts], beside)}

    artifact = bench.make(
        "report",
        compute,
        components=[bench.component("meta_model", one.config) for one in stages],
        modules=["pliant.report.meta_page", "pliant.formatting"],
        config={
            "title": title,
            "study": dict(study),
            "source": stage.solved.source,
            "proposals": [[*one.values, one.gain, one.basis] for one in proposals],
            "libraries": {"pliant": __version__, **versions(["matplotlib", "jinja2"])},
            "provenance": [a.manifest["digest"] for a in artifacts],
        },
        inputs={f"artifact{number}": a.key for number, a in enumerate(artifacts)},
    )
    page = folder / FIT_PAGE
    with writing_in(folder):
        write_atomically(page, artifact.value["html"])
    return page


def _fitted(stage: MetaModelStage, learning: Mapping[str, Any] | None, proposals: Sequence[Proposal]) -> Any:
    from pliant.report.meta_reading import MetaFitted

    designs = stage.designs
    shares = np.random.default_rng(0).uniform(0.2, 0.8, (TIMED, len(designs.names)))
    times = []
    for values in designs.box[:, 0] + shares * designs.scale:
        started = time.perf_counter()
        law = stage.law(values)
        times.append(time.perf_counter() - started)
    study = getattr(stage.config, "form", None) == "study"
    return MetaFitted(
        name=f"{stage.config.kind}, the study's form" if study else stage.config.kind,
        kind=stage.config.kind,
        designs=designs,
        misses=Misses.of_values(stage.artifact.value["misses"]),
        scores=stage.scores,
        coverage=stage.coverage,
        details=stage.details,
        parts=stage.parts,
        fit_s=stage.fit_s,
        scoring_s=stage.scoring_s,
        law_s=float(np.median(times)),
        per_second=evaluations_per_second(law),
        learning=learning,
        proposals=proposals,
        source=stage.solved.source,
    )
