"""What the page of a meta-model reads out of its results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import Unit, unit_of_field
from pliant.pipeline.meta_model.leaving_out import Misses
from pliant.pipeline.meta_model.next_design import Proposal
from pliant.pipeline.meta_model.scoring import Scores, shares
from pliant.records.design import Array
from pliant.records.solved import SolvedDesigns

PLACES = ("interior", "border")


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
        law_s: seconds from parameters to a law with its error bar, measured when the page was made.
        per_second: evaluations of such a law with slopes, measured then too.
        learning: result of `design_learning`, or None.
        proposals: designs that should be solved next, where they were asked for.
        source: where the designs come from, in words.
    """

    name: str
    kind: str
    designs: SolvedDesigns
    misses: Misses
    scores: Mapping[str, Scores]
    coverage: Mapping[str, Mapping[str, float]]
    details: Mapping[str, Any]
    parts: int
    fit_s: float
    scoring_s: float
    law_s: float
    per_second: float
    learning: Mapping[str, Any] | None = None
    proposals: Sequence[Proposal] = ()
    source: str = "the sweep"

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


def parameter_words(name: str) -> tuple[str, Unit]:
    """A parameter as people read it, and its unit: ``average_radius_m`` → average radius, mm."""
    label, unit = unit_of_field(name)
    return label.replace("material.", "").replace("_", " "), unit
