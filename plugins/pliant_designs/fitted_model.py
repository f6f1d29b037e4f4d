"""A fitted meta-model with the quantities of its page: misses of designs left out, times, proposals."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pliant.pipeline.surrogate import evaluations_per_second
from pliant.records.design import Array
from pliant.store.store import Artifact
from pliant_designs.cross_validation import LeftOutResiduals, shares
from pliant_designs.next_design import Proposal
from pliant_designs.records import SolvedDesigns
from pliant_designs.stage import MetaModelStage

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
