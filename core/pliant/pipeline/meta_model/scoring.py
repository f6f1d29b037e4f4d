"""Scores of a meta-model on designs left out: torque and free angle, inside the range and on its border."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.pipeline.meta_model.cross_validation import LeftOutResiduals
from pliant.records.design import Array
from pliant.records.solved import SolvedDesigns

PLACES = ("all", "interior", "border")


@dataclass(frozen=True)
class AxisScores:
    """Errors of one axis' effort on states of designs left out.

    Attributes:
        n_states: how many.
        r2: over all states together.
        rmse, worst: in the effort's unit.
        rmse_of_range, worst_of_range: as shares of each design's own range of effort (`worst` over all states).
    """

    n_states: int
    r2: float
    rmse: float
    worst: float
    rmse_of_range: float
    worst_of_range: float


@dataclass(frozen=True)
class Scores:
    """Errors on designs left out, of one group of designs.

    Attributes:
        place: all, interior or border of the range of designs.
        n_designs: in the group.
        axes: axis → errors of its effort.
        free_median, free_worst: errors of the free angle, as shares of the design's largest free angle.
        free_states, free_lost: states of the free branch, and those where the law has no equilibrium (worst = ∞).
        check_worst_of_range: worst share on states of role "check" alone, over all axes.
    """

    place: str
    n_designs: int
    axes: Mapping[str, AxisScores]
    free_median: float
    free_worst: float
    free_states: int
    free_lost: int
    check_worst_of_range: float

    @property
    def r2(self) -> float:
        """Of the worst axis."""
        return min((one.r2 for one in self.axes.values()), default=np.nan)

    @property
    def worst_of_range(self) -> float:
        """Of the worst axis."""
        return max((one.worst_of_range for one in self.axes.values()), default=np.nan)

    @property
    def rmse_of_range(self) -> float:
        """Of the worst axis."""
        return max((one.rmse_of_range for one in self.axes.values()), default=np.nan)

    def as_values(self) -> dict[str, Any]:
        """As JSON values."""
        axes = {axis: dict(vars(one)) for axis, one in self.axes.items()}
        summary = {
            "r2": self.r2,
            "worst_of_range": self.worst_of_range,
            "rmse_of_range": self.rmse_of_range,
        }
        return {**vars(self), **summary, "axes": axes}

    @staticmethod
    def of_values(values: Mapping[str, Any]) -> Scores:
        """The scores that `as_values` gave."""
        axes = {axis: AxisScores(**one) for axis, one in values["axes"].items()}
        names = set(Scores.__dataclass_fields__) - {"axes"}
        return Scores(axes=axes, **{name: values[name] for name in names})


def scores_of(designs: SolvedDesigns, misses: LeftOutResiduals) -> dict[str, Scores]:
    """Scores of all designs, of those inside the range and of those on its border; empty groups are left out."""
    border = designs.corners()
    groups = {"all": np.ones(len(designs), bool), "interior": ~border, "border": border}
    return {place: _scores(place, designs, misses, groups[place]) for place in PLACES if groups[place].any()}


def _scores(place: str, designs: SolvedDesigns, misses: LeftOutResiduals, group: NDArray[np.bool_]) -> Scores:
    axes = designs.data[0].axes
    rows = group[misses.design]
    found = {}
    for a, axis in enumerate(axes):
        keep = rows & misses.counts[:, a]
        if keep.any():
            found[axis] = _axis(misses, a, keep)
    free = group[misses.free_design]
    share = np.abs(misses.free_miss) / _largest_free(misses)[misses.free_design]
    share = np.where(np.isnan(share), np.inf, share)[free]
    kept = rows & misses.check
    check = np.abs(shares(misses)[kept])[misses.counts[kept]]
    return Scores(
        place=place,
        n_designs=int(group.sum()),
        axes=found,
        free_median=float(np.median(share)) if len(share) else float("nan"),
        free_worst=float(share.max(initial=0.0)) if len(share) else float("nan"),
        free_states=len(share),
        free_lost=int(np.isinf(share).sum()),
        check_worst_of_range=float(check.max()) if check.size else float("nan"),
    )


def _axis(misses: LeftOutResiduals, a: int, keep: NDArray[np.bool_]) -> AxisScores:
    miss, tau = misses.miss[keep, a], misses.tau[keep, a]
    share = shares(misses)[keep, a]
    spread = float(np.sum((tau - tau.mean()) ** 2))
    return AxisScores(
        n_states=len(miss),
        r2=1.0 - float(np.sum(miss**2)) / spread if spread > 0 else float("nan"),
        rmse=float(np.sqrt(np.mean(miss**2))),
        worst=float(np.abs(miss).max()),
        rmse_of_range=float(np.sqrt(np.mean(share**2))),
        worst_of_range=float(np.abs(share).max()),
    )


def shares(misses: LeftOutResiduals) -> Array:
    """(m, a) misses as shares of the range that the true effort of that design and axis has over its states."""
    found: Array = misses.miss / effort_ranges(misses)[misses.design]
    return found


def effort_ranges(misses: LeftOutResiduals) -> Array:
    """(n, a) range of the true effort of each design and axis."""
    ranges: Array = np.full_like(misses.size, np.nan)
    for design in np.unique(misses.design):
        rows = misses.design == design
        for a in range(misses.size.shape[1]):
            tau = misses.tau[rows & misses.counts[:, a], a]
            width = float(np.ptp(tau)) if len(tau) else 0.0
            ranges[design, a] = width if width > 0 else np.nan
    return ranges


def _largest_free(misses: LeftOutResiduals) -> Array:
    """(n,) largest free angle of each design; NaN without free states."""
    found = np.full(len(misses.size), np.nan)
    for design in np.unique(misses.free_design):
        found[design] = np.abs(misses.free_angle[misses.free_design == design]).max()
    return found
