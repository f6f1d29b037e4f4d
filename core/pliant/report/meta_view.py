"""What sentences, tables and pictures read out of a meta-model's results."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import NamedUnit, percent, unit_of
from pliant.pipeline.meta_model.cross_validation import LeftOutResiduals, Scores, shares
from pliant.pipeline.meta_model.designs import spoken
from pliant.pipeline.meta_model.next_design import Proposal
from pliant.pipeline.surrogate import evaluations_per_second
from pliant.records.design import Array
from pliant.records.law import FitReport, JointLaw
from pliant.records.solved import SolvedDesigns

PLACES = ("interior", "border")
TIMED = 5  # designs whose law is timed


@dataclass(frozen=True, eq=False)
class MetaFitted:
    """A meta-model with all that its page shows.

    Attributes:
        name: of the model, where several are compared.
        kind: of the meta-model.
        designs: that it was fitted to.
        misses: what laws of designs left out miss.
        scores, coverage: by place, as `MetaModelStage` has them.
        details: what the fit tells.
        parts: refits without some designs.
        fit_s, scoring_s: of the fit, and of all refits.
        law_at: from parameters (d,) to a law with its error bar.
        learning: result of `design_learning`, or None.
        proposals: designs that should be solved next, where they were asked for.
        source: where the designs come from, in words.
    """

    name: str
    kind: str
    designs: SolvedDesigns
    misses: LeftOutResiduals
    scores: Mapping[str, Scores]
    coverage: Mapping[str, Mapping[str, float]]
    details: Mapping[str, Any]
    parts: int
    fit_s: float
    scoring_s: float
    law_at: Callable[[Array], JointLaw]
    learning: Mapping[str, Any] | None = None
    proposals: Sequence[Proposal] = ()
    source: str = "the sweep"

    @cached_property
    def _timed(self) -> tuple[float, float]:
        shares = np.random.default_rng(0).uniform(0.2, 0.8, (TIMED, len(self.designs.names)))
        times = []
        for values in self.designs.box[:, 0] + shares * self.designs.scale:
            started = time.perf_counter()
            law = self.law_at(values)
            times.append(time.perf_counter() - started)
        return float(np.median(times)), evaluations_per_second(law)

    @property
    def law_s(self) -> float:
        """Seconds from parameters to a law, measured when a page asks."""
        return self._timed[0]

    @property
    def per_second(self) -> float:
        """Evaluations of such a law with slopes, measured when a page asks."""
        return self._timed[1]

    @property
    def axes(self) -> tuple[str, ...]:
        """Of the joint."""
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
        """(n,) worst share of each design when it was left out, over its axes."""
        found = np.full(len(self.designs), np.nan)
        for design in range(len(found)):
            own = np.abs(self.shares[self.misses.design == design])
            found[design] = np.nanmax(own) if np.isfinite(own).any() else np.nan
        return found

    @property
    def fem_s(self) -> float:
        """Solver's seconds behind all designs; 0 where nobody knows."""
        return float(sum(np.nansum(one.wall_s) for one in self.designs.data))

    def worst_designs(self, count: int) -> list[int]:
        """Rows of the designs that are missed most, the worst first."""
        order = np.argsort(-np.where(np.isfinite(self.worst), self.worst, -np.inf), kind="stable")
        return [int(i) for i in order[:count]]


def law_of_meta_json(details: Mapping[str, Any]) -> dict[str, Any]:
    """What the `fit` result of a law says more where a meta-model gave it."""
    names = ("meta_model", "design", "inside", "n_designs", "scores", "coverage")
    return {name: details[name] for name in names}


def law_of_meta_lines(report: FitReport) -> list[str]:
    """A law that a meta-model gave, for the terminal."""
    details = report.details
    lines = [
        f"law      of an unseen design, {spoken(details['design'])}, by meta-model '{details['meta_model']}' of "
        f"{details['n_designs']} designs",
        f"         worst error {percent(report.worst_of_range)} of the range on designs left out, R² {report.r2:.6f}",
    ]
    if "interior" in details["scores"]:
        inside = percent(float(details["scores"]["interior"]["worst_of_range"]))
        lines[-1] += f" (inside the range {inside})"
    if not details["inside"]:
        lines.append("         OUTSIDE the range of the solved designs: extrapolated")
    return lines


def parameter_unit(name: str) -> NamedUnit:
    """A parameter as people read it, with its unit: ``average_radius_m`` → average radius, mm."""
    return unit_of(name.removeprefix("material."))
