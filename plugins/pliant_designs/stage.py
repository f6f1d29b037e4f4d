"""Artifacts of meta-models: one of the fitted model with its scores and bars, one of each design's law."""

from __future__ import annotations

import copy
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from pliant.config.design_parameters import design_parameters
from pliant.config.study import Study
from pliant.interfaces.family import FamilyConfig
from pliant.interfaces.material import MaterialConfig
from pliant.pipeline.surrogate import LawStage
from pliant.pipeline.unread import unread_sentence
from pliant.pipeline.workbench import RunContext, content
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.law import FitReport, JointLaw, LawRecord
from pliant.store.store import Artifact
from pliant_designs.cross_validation import (
    Scores,
    axis_grids,
    cross_validation_folds,
    effort_size,
    misses_left_out,
    scores_by_place,
)
from pliant_designs.error_bars import Bars
from pliant_designs.meta_model import DesignLaws, MetaModel, MetaModelConfig
from pliant_designs.records import SolvedDesigns
from pliant_designs.solved_designs import SourcedDesigns, design_values, solved_designs, trusted

# Keys of the config that affect neither fit nor scores.
NOT_FITTED = ("data", "extrapolate")
STABLE_GRID = 7  # grid for the check that ∂τ/∂u is negative definite, along each direction of the box


@dataclass(frozen=True, eq=False)
class MetaModelStage:
    """A fitted meta-model with its scores and error bars.

    Attributes:
        config: the study's block.
        solved: the designs that it was fitted to.
        laws: map design parameters to laws; without error bars, see `law`.
        scores: place (all, interior, border) → errors on designs left out.
        coverage: place → level → share of states inside bars made from the other designs.
        bars: give the error bar of any design.
        details: of the fit.
        parts: number of refits without some of the designs.
        fit_s, scoring_s: time of the fit, and of the refits.
        artifact: of the stage.
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
        """The designs that the meta-model was fitted to."""
        return self.solved.designs

    def values(self, family: FamilyConfig, material: MaterialConfig | None) -> Array:
        """Return (d,) parameters of a design; raise `UserError` if it is outside the model's range."""
        designs = self.designs
        return design_values(
            designs.names, designs.box, designs.fixed, family, material, self.config.extrapolate
        )

    def law(self, values: Array) -> JointLaw:
        """Return the law of a design (d,), with its error bar."""
        doubt = float(self.laws.doubt(np.asarray(values, float)[None])[0])
        law = self.laws.law(values)
        return with_error(law, self.bars.bar(law, values, doubt).arrays())


def meta_model_stage(
    context: RunContext, study: Study, solved: SourcedDesigns | None = None
) -> MetaModelStage:
    """Fit the study's meta-model, or load it from the store; unsolved designs are solved first.

    Raises:
        UserError: too few designs, or designs that do not belong together; see `solved_designs`.
    """
    config: MetaModelConfig = study.need("meta_model", "a meta-model")
    solved = solved_designs(context, study) if solved is None else solved
    model: MetaModel = context.build("meta_model", config)
    designs = solved.designs
    unread = unread_by_meta_model(
        designs, solved.source, study.need("family", "a meta-model"), study.material
    )
    if unread:
        context.progress.note(unread)
    parts = cross_validation_folds(designs, config.folds, model.fewest, "folds" in config.model_fields_set)

    def compute(partial: Path) -> dict[str, Any]:
        misses = misses_left_out(model, designs, parts, partial, context.progress)
        started = time.perf_counter()
        fitted = model.fit(designs)
        fit_s = time.perf_counter() - started
        bars = Bars.from_residuals(designs, misses)
        return {
            "record": fitted.laws.record(),
            "details": dict(fitted.details),
            "scores": {place: one.as_values() for place, one in scores_by_place(designs, misses).items()},
            "coverage": bars.coverage(designs.corners()),
            "misses": dict(vars(misses)),
            "bars": {field.name: getattr(bars, field.name) for field in fields(bars)},
            "parts": len(parts),
            "fit_s": fit_s,
            "scoring_s": misses.wall_s,
        }

    settings = {name: value for name, value in content(config).items() if name not in NOT_FITTED}
    artifact = context.make(
        "meta",
        compute,
        components=[context.component("meta_model", config)],
        modules=["pliant_designs.stage"],
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
        scores={place: Scores.from_values(one) for place, one in value["scores"].items()},
        coverage=value["coverage"],
        bars=Bars(**value["bars"]),
        details=value["details"],
        parts=int(value["parts"]),
        fit_s=float(value["fit_s"]),
        scoring_s=float(value["scoring_s"]),
        artifact=artifact,
    )


def unread_by_meta_model(
    designs: SolvedDesigns, source: str, family: FamilyConfig, material: MaterialConfig | None
) -> str:
    """Return a sentence about constants that no solved design states; "" if all are stated."""
    known = {*designs.names, *designs.fixed}
    unread = [name for name in design_parameters(family, material) if name not in known]
    return unread_sentence(unread, family, material, source)


def unseen_laws(context: RunContext, study: Study, families: Sequence[FamilyConfig]) -> list[LawStage]:
    """Return the laws of designs by the study's meta-model, their range being checked before it is fitted."""
    solved = solved_designs(context, study)
    d, config = solved.designs, study.need("meta_model", "a meta-model")
    for family in families:
        design_values(d.names, d.box, d.fixed, family, study.material, config.extrapolate)
    stage = meta_model_stage(context, study, solved)
    return [meta_model_law(context, stage, family, study.material) for family in families]


def meta_model_law(
    context: RunContext, stage: MetaModelStage, family: FamilyConfig, material: MaterialConfig | None
) -> LawStage:
    """Return the law of a design from its parameters only.

    The artifact contains the model, the design and its error bar, so that `read_law` can rebuild the law.

    Raises:
        UserError: the design is outside the model's range.
    """
    values = stage.values(family, material)

    def compute(partial: Path) -> dict[str, Any]:
        law = stage.law(values)
        assert isinstance(law.error, ErrorBar)  # of `MetaModelStage.law`
        return {
            "model": stage.laws.record(),
            "values": values,
            "error": law.error.arrays(),
            "report": left_out_report(stage, law, values),
        }

    artifact = context.make(
        "unseen",
        compute,
        components=[context.component("meta_model", stage.config)],
        modules=["pliant_designs.stage"],
        config={"values": values.tolist()},
        inputs={"meta": stage.artifact.key},
    )
    law = read_law(context.build("meta_model", stage.config), artifact.value)
    return LawStage(law, artifact.value["report"], artifact, None)


def read_law(model: MetaModel, value: Mapping[str, Any]) -> JointLaw:
    """Return the law from the artifact of `meta_model_law`."""
    record: LawRecord = value["model"]
    return with_error(model.load(record).law(np.asarray(value["values"], float)), value["error"])


def with_error(law: JointLaw, arrays: Mapping[str, Array]) -> JointLaw:
    """Return a copy of the law with the error bar that `ErrorBar.arrays` wrote."""
    changed = copy.copy(law)
    object.__setattr__(
        changed, "error", ErrorBar.from_arrays(arrays)
    )  # laws are frozen; this copy is not shared yet
    return changed


def left_out_report(stage: MetaModelStage, law: JointLaw, values: Array) -> FitReport:
    """Return the errors on left-out designs as the report of a law; its details identify the design."""
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
