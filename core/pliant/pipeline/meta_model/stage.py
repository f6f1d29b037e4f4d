"""Artifacts of meta-models: one for the fitted model with its scores and bars, one for each design's law."""

from __future__ import annotations

import copy
import time
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from pliant.config.study import Study
from pliant.interfaces.family import FamilyConfig
from pliant.interfaces.material import MaterialConfig
from pliant.interfaces.meta_model import DesignLaws, MetaModel, MetaModelConfig
from pliant.pipeline.meta_model.cross_validation import (
    Scores,
    axis_grids,
    effort_size,
    misses_left_out,
    parts_of,
    scores_of,
)
from pliant.pipeline.meta_model.designs import SourcedDesigns, solved_designs, trusted, values_of
from pliant.pipeline.meta_model.error_bars import Bars
from pliant.pipeline.surrogate import LawStage
from pliant.pipeline.workbench import Workbench, content
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.law import FitReport, JointLaw, LawRecord
from pliant.records.solved import SolvedDesigns
from pliant.store.store import Artifact

# Keys of the config that change no fit and no score.
NOT_FITTED = ("data", "extrapolate")
STABLE_GRID = 7  # whether ∂τ/∂u stays negative (definite), the directions of the box one by one


@dataclass(frozen=True, eq=False)
class MetaModelStage:
    """A fitted meta-model with all that was found about it.

    Attributes:
        config: the study's block.
        solved: the designs that it was fitted to.
        laws: design parameters in, law out; without error bars, see `law`.
        scores: place (all, interior, border) → errors on designs left out.
        coverage: place → level → share of states inside bars that the other designs give.
        bars: of any design.
        details: what the fit tells.
        parts: how often it was refitted without some of the designs.
        fit_s, scoring_s: what the fit, and those without some designs, took.
        artifact: holds it all.
    """

    config: MetaModelConfig
    solved: SourcedDesigns
    laws: DesignLaws
    scores: Mapping[str, Scores]
    coverage: Mapping[str, Mapping[str, float]]
    bars: Bars
    details: Mapping[str, Any]
    parts: int
    fit_s: float
    scoring_s: float
    artifact: Artifact

    @property
    def designs(self) -> SolvedDesigns:
        """The designs that the meta-model learned from."""
        return self.solved.designs

    def values(self, family: FamilyConfig, material: MaterialConfig | None) -> Array:
        """(d,) parameters of a design; raises `UserError` where the model does not hold for it."""
        designs = self.designs
        return values_of(designs.names, designs.box, designs.fixed, family, material, self.config.extrapolate)

    def law(self, values: Array) -> JointLaw:
        """The law of a design (d,), with its error bar."""
        doubt = float(self.laws.doubt(np.asarray(values, float)[None])[0])
        law = self.laws.law(values)
        return with_error(law, self.bars.bar(law, values, doubt).arrays())


def meta_model_stage(bench: Workbench, study: Study, solved: SourcedDesigns | None = None) -> MetaModelStage:
    """Fit the study's meta-model, or find it in the store; its designs are solved first where they must be.

    Raises:
        UserError: too few designs, or designs that do not belong together; see `solved_designs`.
    """
    config: MetaModelConfig = study.need("meta_model", "a meta-model")
    solved = solved_designs(bench, study) if solved is None else solved
    model: MetaModel = bench.build("meta_model", config)
    designs = solved.designs
    parts = parts_of(designs, config.folds, model.fewest, "folds" in config.model_fields_set)

    def compute(partial: Path) -> dict[str, Any]:
        misses = misses_left_out(model, designs, parts, partial, bench.progress)
        started = time.perf_counter()
        fitted = model.fit(designs)
        fit_s = time.perf_counter() - started
        bars = Bars.of(designs, misses)
        return {
            "record": fitted.laws.record(),
            "details": dict(fitted.details),
            "scores": {place: one.as_values() for place, one in scores_of(designs, misses).items()},
            "coverage": bars.coverage(designs.corners()),
            "misses": dict(vars(misses)),
            "bars": {field.name: getattr(bars, field.name) for field in fields(bars)},
            "parts": len(parts),
            "fit_s": fit_s,
            "scoring_s": misses.wall_s,
        }

    settings = {name: value for name, value in content(config).items() if name not in NOT_FITTED}
    artifact = bench.make(
        "meta",
        compute,
        components=[bench.component("meta_model", config)],
        modules=["pliant.pipeline.meta_model.stage"],
        config={
            "meta_model": settings,
            "family": designs.family,
            "names": list(designs.names),
            "fixed": dict(designs.fixed),
        },
        inputs=solved.inputs,
    )
    value = artifact.value
    return MetaModelStage(
        config=config,
        solved=solved,
        laws=model.load(value["record"]),
        scores={place: Scores.of_values(one) for place, one in value["scores"].items()},
        coverage=value["coverage"],
        bars=Bars(**value["bars"]),
        details=value["details"],
        parts=int(value["parts"]),
        fit_s=float(value["fit_s"]),
        scoring_s=float(value["scoring_s"]),
        artifact=artifact,
    )


def law_of_design(
    bench: Workbench, stage: MetaModelStage, family: FamilyConfig, material: MaterialConfig | None
) -> LawStage:
    """The law of a design by nothing but its parameters.

    The artifact holds the model, the design and its error bar, so that `read_law` makes the law anywhere.

    Raises:
        UserError: the model does not hold for the design.
    """
    values = stage.values(family, material)

    def compute(partial: Path) -> dict[str, Any]:
        law = stage.law(values)
        assert law.error is not None
        return {
            "model": stage.laws.record(),
            "values": values,
            "error": law.error.arrays(),
            "report": report_of(stage, law, values),
        }

    artifact = bench.make(
        "unseen",
        compute,
        components=[bench.component("meta_model", stage.config)],
        modules=["pliant.pipeline.meta_model.stage"],
        config={"values": values.tolist()},
        inputs={"meta": stage.artifact.key},
    )
    law = read_law(bench.build("meta_model", stage.config), artifact.value)
    return LawStage(law, artifact.value["report"], artifact, None)


def read_law(model: MetaModel, value: Mapping[str, Any]) -> JointLaw:
    """The law that the artifact of `law_of_design` holds."""
    record: LawRecord = value["model"]
    return with_error(model.load(record).law(np.asarray(value["values"], float)), value["error"])


def with_error(law: JointLaw, arrays: Mapping[str, Array]) -> JointLaw:
    """A copy of the law with the error bar that `ErrorBar.arrays` wrote."""
    changed = copy.copy(law)
    object.__setattr__(
        changed, "error", ErrorBar.of_arrays(arrays)
    )  # laws are frozen, this one is still ours
    return changed


def report_of(stage: MetaModelStage, law: JointLaw, values: Array) -> FitReport:
    """Errors on designs left out, as the report of a law shows them; its details say whose law it is."""
    every, designs = stage.scores["all"], stage.designs
    states = [int(np.sum((one.role == "fit") & trusted(one))) for one in designs.data]
    slopes = [law.evaluate(p, u).dtau_du for p, u in axis_grids(law, STABLE_GRID, STABLE_GRID)]
    stable = all(np.linalg.eigvalsh((K + np.swapaxes(K, 1, 2)) / 2).max() < 0 for K in slopes)
    return FitReport(
        n_fitted=sum(states),
        n_heldout=sum(one.n_states for one in every.axes.values()),
        rmse=max(one.rmse for one in every.axes.values()),
        worst=max(one.worst for one in every.axes.values()),
        worst_of_range=every.worst_of_range,
        r2=every.r2,
        effort_range=float(effort_size(law).max()),
        details={
            "form": f"meta-model '{stage.config.kind}'",
            "meta_model": stage.config.kind,
            "design": dict(zip(designs.names, np.asarray(values, float).tolist(), strict=True)),
            "inside": bool(np.all(stage.laws.excess(values) == 0)),
            "n_designs": len(designs),
            "scores": {place: one.as_values() for place, one in stage.scores.items()},
            "coverage": {place: dict(one) for place, one in stage.coverage.items()},
            "stable": stable,
        },
    )
