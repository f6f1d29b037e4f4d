"""What benchmarks of laws share: surrogates by kind, shipped designs, scores of meta-models that are fitted already."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import ROOT, component

from pliant.errors import UserError
from pliant.execution.progress import Silent
from pliant.interfaces.surrogate import Surrogate
from pliant.records.law import LawRecord
from pliant_designs.cross_validation import (
    LeftOutResiduals,
    Scores,
    cross_validation_folds,
    misses_left_out,
    scores_by_place,
)
from pliant_designs.meta_model import DesignLaws, FittedMetaModel, MetaModel, MetaModelConfig
from pliant_designs.records import SolvedDesigns
from pliant_designs.solved_designs import from_table

TABLES = ROOT / "examples/designs"
FAMILIES = {"bending": "bellow_bending", "helical": "bellow_helical", "chambers": "two_chamber"}
# What laws of one axis are compared: name → kind and config.
FORMS: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "polynomial, adaptive": ("polynomial", {}),
    "polynomial, study, least squares": ("polynomial", {"form": "study"}),
    "polynomial, study, differences": ("polynomial", {"form": "study", "procedure": "finite_differences"}),
    "table": ("table", {}),
    "neural": ("neural", {}),
}


def surrogate(name: str) -> Surrogate | None:
    """Return the surrogate of one of `FORMS`; None if its kind is not installed."""
    kind, config = FORMS[name]
    try:
        return component("surrogate", kind, **config)
    except UserError:
        return None


class Fitted(MetaModel):
    """A fitted model for the scores of `cross_validation`, whose left-out designs were never part of the fit."""

    def __init__(self, laws: DesignLaws) -> None:
        super().__init__(MetaModelConfig(kind="fitted"))
        self.laws = laws

    def fit(self, designs: SolvedDesigns) -> FittedMetaModel:
        return FittedMetaModel(self.laws)

    def load(self, record: LawRecord) -> DesignLaws:
        raise NotImplementedError


def table(name: str) -> SolvedDesigns:
    """Return the designs of examples/designs/NAME.csv, e.g. `bending_grid`."""
    return from_table(TABLES / f"{name}.csv", FAMILIES[name.split("_")[0]]).designs


def design_misses(laws: DesignLaws, designs: SolvedDesigns) -> LeftOutResiduals:
    """Return the residuals of a fitted model on designs."""
    with tempfile.TemporaryDirectory() as folder:
        whole = [np.arange(len(designs))]
        return misses_left_out(Fitted(laws), designs, whole, Path(folder), Silent())


def scored(laws: DesignLaws, designs: SolvedDesigns) -> Scores:
    """Return scores of a fitted model on all of some designs."""
    return scores_by_place(designs, design_misses(laws, designs))["all"]


def left_out(model: MetaModel, designs: SolvedDesigns, folds: int) -> dict[str, Scores]:
    """Return scores on the designs of each of some seeded parts, left out in turn."""
    with tempfile.TemporaryDirectory() as folder:
        parts = cross_validation_folds(designs, folds, model.fewest, stated=False)
        return scores_by_place(designs, misses_left_out(model, designs, parts, Path(folder), Silent()))


def line(name: str, scores: Scores) -> str:
    """Return the scores as a printed row."""
    r2 = " ".join(f"{axis} {one.r2:.6f}" for axis, one in scores.axes.items())
    worst = " ".join(f"{100 * one.worst_of_range:.2f}" for one in scores.axes.values())
    # laws of several inputs have no one free angle
    known = np.isfinite(scores.free_median)
    free = (
        f"free angle {100 * scores.free_median:.2f} % median, {100 * scores.free_worst:.2f} % worst" * known
    )
    lost = f", {scores.free_lost} lost" if scores.free_lost else ""
    return f"  {name:30} {scores.n_designs:3d} designs  R² {r2}  worst {worst} % of range  {free}{lost}"


def as_json(scores: dict[str, Scores]) -> dict[str, Any]:
    """Return the scores as JSON for benchmarks/out."""
    return {place: one.as_values() for place, one in scores.items()}
