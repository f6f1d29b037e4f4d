"""Quantities of a meta-model for sentences, tables and pictures: held-out scores, bars, learning, cost."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import NamedUnit, number, output_unit, percent, seconds
from pliant.pipeline.surrogate import evaluations_per_second
from pliant.records.design import Array
from pliant.report.document import Column, Table, named_values, optional_table, page_table
from pliant.report.provenance import short_text, words
from pliant.store.store import Artifact
from pliant_designs.cross_validation import AxisScores, LeftOutResiduals, Scores, shares
from pliant_designs.next_design import Proposal
from pliant_designs.records import SolvedDesigns
from pliant_designs.stage import MetaModelStage

PLACES = ("interior", "border")
TIMED = 5  # designs whose law is timed


@dataclass(frozen=True, eq=False)
class MetaFitted:
    """A meta-model with the data of its page.

    Attributes:
        stage: the model with its scores and details.
        learning: of `design_learning_stage`, or None.
        proposals: designs to solve next, if requested.
    """

    stage: MetaModelStage
    learning: Artifact | None = None
    proposals: Sequence[Proposal] = ()

    @property
    def name(self) -> str:
        """The model's name, if several are compared."""
        study = getattr(self.stage.config, "form", None) == "study"
        return f"{self.stage.config.kind}, the published form" if study else self.stage.config.kind

    @property
    def designs(self) -> SolvedDesigns:
        """The designs that it was fitted to."""
        return self.stage.designs

    @cached_property
    def misses(self) -> LeftOutResiduals:
        """The residuals of the laws of held-out designs."""
        return LeftOutResiduals(**self.stage.artifact.value["misses"])

    @cached_property
    def _timed(self) -> tuple[float, float]:
        shares = np.random.default_rng(0).uniform(0.2, 0.8, (TIMED, len(self.designs.names)))
        times = []
        for values in self.designs.box[:, 0] + shares * self.designs.scale:
            started = time.perf_counter()
            law = self.stage.law(values)
            times.append(time.perf_counter() - started)
        return float(np.median(times)), evaluations_per_second(law)

    @property
    def law_s(self) -> float:
        """Seconds from parameters to a law, measured on first access."""
        return self._timed[0]

    @property
    def per_second(self) -> float:
        """Evaluations of such a law with slopes per second, measured on first access."""
        return self._timed[1]

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes of the joint's deformation."""
        return self.designs.data[0].axes

    @cached_property
    def border(self) -> NDArray[np.bool_]:
        """(n,) designs on the border of the range."""
        return self.designs.corners()

    @cached_property
    def shares(self) -> Array:
        """(m, a) misses as shares of each design's own range; NaN where an axis is not scored."""
        return np.where(self.misses.counts, shares(self.misses), np.nan)

    @cached_property
    def worst(self) -> Array:
        """(n,) worst share of each held-out design, over its axes."""
        found = np.full(len(self.designs), np.nan)
        for design in range(len(found)):
            own = np.abs(self.shares[self.misses.design == design])
            found[design] = np.nanmax(own) if np.isfinite(own).any() else np.nan
        return found

    @property
    def fem_s(self) -> float:
        """Solver's seconds for all designs; 0 if not known."""
        return float(sum(np.nansum(one.wall_s) for one in self.designs.data))

    def worst_designs(self, count: int) -> list[int]:
        """Return the rows of the designs with the largest errors, the worst first."""
        order = np.argsort(-np.where(np.isfinite(self.worst), self.worst, -np.inf), kind="stable")
        return [int(i) for i in order[:count]]


def parameter_unit(name: str) -> NamedUnit:
    """Return a parameter's label and display unit: ``average_radius_m`` → average radius, mm."""
    return output_unit(name.removeprefix("material."))


PUBLISHED = (
    "Of each design's own range of effort, and of its largest free angle. Published for the study's meta-models: R² "
    "above 0.99 (coefficients) and above 0.999 (network), both on the designs that they were fitted to; here every "
    "design was left out of the fit that predicts it."
)
WORST = 5
WORTH = {
    "gain": "of the mean squared error that solving it would remove",
    "doubt": "of the largest doubt in the range",
    "distance": "of the range, to the nearest solved design",
}


def share_text(share: float) -> str:
    """Return a share in percent, three digits."""
    return percent(share, 3)


class ScoreRow(NamedTuple):
    """Scores of one axis of a group of designs; `first` for the group's first row."""

    label: str
    scores: Scores
    axis: AxisScores
    first: bool


SCORES: tuple[Column[ScoreRow], ...] = (
    Column("label", head="designs left out", brief="designs left out"),
    Column("scores.n_designs", head="designs", brief="designs"),
    Column("axis.n_states", head="states"),
    Column("axis.r2", head="R²", brief="R²", show=lambda r2: f"{r2:.6f}"),
    Column("axis.rmse_of_range", head="RMS of range", brief="RMS", show=share_text),
    Column("axis.worst_of_range", head="worst of range", brief="worst", show=share_text),
    Column(
        "scores.free_median",
        head="free angle, median",
        brief="free: median",
        text=lambda r: share_text(r.scores.free_median) if r.first else "",
    ),
    Column(
        "scores.free_worst",
        head="free angle, worst",
        brief="worst",
        text=lambda r: _worst_free(r.scores.free_worst, r.scores.free_lost) if r.first else "",
    ),
)


def score_rows(fitted: Sequence[MetaFitted]) -> list[ScoreRow]:
    """Return torque and free angle on held-out designs, interior and border apart, one block for each model."""
    rows = []
    for one in fitted:
        for place, scores in one.stage.scores.items():
            label = f"{one.name}: {place}" if len(fitted) > 1 else place
            for count, (axis, of_axis) in enumerate(scores.axes.items()):
                name = f"{label}, axis {axis}" if len(scores.axes) > 1 else label
                rows.append(ScoreRow(name, scores, of_axis, count == 0))
    return rows


def _parameters(fitted: MetaFitted, values: Iterable[float]) -> list[str]:
    """Return the cells of a design's parameters, in their display units."""
    units = map(parameter_unit, fitted.designs.names)
    return [number(float(v) * unit.factor, 4) for v, unit in zip(values, units, strict=True)]


def worst_table(fitted: MetaFitted) -> Table:
    """Return the designs with the largest errors."""
    rows = [
        [
            percent(float(fitted.worst[design]), 3),
            "border" if fitted.border[design] else "interior",
            *_parameters(fitted, fitted.designs.values[design]),
        ]
        for design in fitted.worst_designs(WORST)
    ]
    head = ["worst of range", "place", *(parameter_unit(name).axis for name in fitted.designs.names)]
    return Table("Designs that were missed most", head, rows, numeric=2)


def coverage_table(fitted: MetaFitted) -> Table:
    """Return the coverage of the bars."""
    levels = list(dict.fromkeys(level for found in fitted.stage.coverage.values() for level in found))
    rows = [
        [place, *(percent(found[level], 3) if level in found else "–" for level in levels)]
        for place, found in fitted.stage.coverage.items()
    ]
    head = ["", *(f"in the {100 * float(level):g} % band" for level in levels)]
    note = "Each design's states in bars that the other designs give; each design counts alike."
    return Table("What the error bars hold", head, rows, note)


LEARNING: tuple[Column[Mapping[str, Any]], ...] = (
    Column("n", head="designs"),
    *(
        Column(f"{place}.{key}", head=f"{place}, {label}", show=share_text)
        for place in ("all", "interior")
        for key, label in (("rms", "RMS"), ("worst", "worst"))
    ),
    Column("wall_s", head="fit", show=seconds),
)


def learning_table(learning: Mapping[str, Any]) -> Table:
    """Return errors by number of designs."""
    count, inside = len(learning["test"]), len(learning["interior"])
    note = (
        f"Shares of each design's range at {count} designs that no fit saw, {inside} of them inside the range. "
        "Subsets are nested: corners first, then the design farthest from those before it."
    )
    if learning["left_out"]:
        sizes = ", ".join(str(p["n"]) for p in learning["left_out"])
        note += f" Not fitted: {sizes} ({learning['left_out'][0]['cause']})"
    return page_table("Error by number of designs", LEARNING, learning["points"], note)


def next_table(fitted: MetaFitted) -> Table | None:
    """Return the designs to solve next; None if not requested."""
    rows = [
        [str(count), *_parameters(fitted, one.values), percent(one.gain, 3)]
        for count, one in enumerate(fitted.proposals, start=1)
    ]
    gain = [WORTH.get(one.basis, one.basis) for one in fitted.proposals[:1]]
    head = ["", *(parameter_unit(name).axis for name in fitted.designs.names), *gain]
    return optional_table("Solve these next", head, rows)


def cost_table(fitted: MetaFitted) -> Table:
    """Return the cost of FEM and of the model, per design."""
    n, stage, each = len(fitted.designs), fitted.stage, fitted.fem_s / len(fitted.designs)
    states = sum(len(one) for one in fitted.designs.data)
    values: dict[str, str | None] = {
        "designs solved": f"{n}, {states} states, from {stage.solved.source}",
        "FEM, all designs": seconds(fitted.fem_s) if each else None,
        "FEM, one design": seconds(each) if each else None,
        "fit of the model": seconds(stage.fit_s),
        f"scoring: {stage.parts} refits without some designs": seconds(stage.scoring_s),
        "law of an unseen design, with its error bar": seconds(fitted.law_s),
        "evaluations of it with slopes": f"{number(fitted.per_second / 1e6, 3)} million a second",
    }
    if each:
        ratio = number(float(f"{each / fitted.law_s:.2g}"))
        hours = number(1000 * (each - fitted.law_s) / 3600, 2)
        values["a design by the model instead of FEM"] = f"{ratio} times faster"
        values["FEM saved by every thousand further designs"] = f"{hours} hours of one core"
    note = (
        "The law and its evaluations were timed when this page was made; FEM as measured when it was solved."
    )
    return named_values("Cost", values, note)


def settings_table(fitted: MetaFitted) -> Table | None:
    """Return every detail of the fit that is one word or number."""
    values = {words(name): short_text(value) for name, value in fitted.stage.details.items()}
    return named_values("What the fit tells", values) if any(values.values()) else None


def _worst_free(share: float, lost: int) -> str:
    return f"no equilibrium in {lost} states" if np.isinf(share) else percent(share, 3)
