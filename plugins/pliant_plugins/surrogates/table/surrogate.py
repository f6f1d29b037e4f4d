"""The table surrogate: states from anywhere in, a smooth law with an honest band out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.interfaces.surrogate import FittedLaw, Surrogate
from pliant.records.error_bar import ErrorBar
from pliant.records.fem import FemDataset
from pliant.records.law import JointLaw, LawRecord
from pliant_plugins.surrogates.polynomial import scoring
from pliant_plugins.surrogates.polynomial.axes import AXES, AxesLaw, fit_each
from pliant_plugins.surrogates.polynomial.law import largest_slope
from pliant_plugins.surrogates.polynomial.states import split
from pliant_plugins.surrogates.polynomial.system import joint_of
from pliant_plugins.surrogates.records import require_kind
from pliant_plugins.surrogates.table.config import TableConfig
from pliant_plugins.surrogates.table.fit import Smoothed, fit_table
from pliant_plugins.surrogates.table.law import KIND, TableLaw

MOST_PLACES, SEED = 1500, 0


class Table(Surrogate):
    """Bicubic laws interpolated from scattered states, smoothed as far as states left out ask for (`fit`).

    `FitReport.details` holds what was tried, the residuals and the errors of the study's form on the same states.
    """

    config: TableConfig

    def __init__(self, config: TableConfig) -> None:
        super().__init__(config)

    def tables(self) -> dict[str, Path]:
        """The table of the law, or of each axis that has one."""
        if self.config.axes is None:
            return dict(super().tables())
        each = self.config.axes.each().items()
        return {axis: one.data for axis, one in each if one.data is not None}

    def needs_fem(self) -> bool:
        """Whether the law, or one of its axes, has no table."""
        return len(self.tables()) < (1 if self.config.axes is None else len(AXES))

    def fit_axes(self, data: Mapping[str, FemDataset]) -> FittedLaw:
        """The law of one axis, or of three that do not affect each other."""
        if self.config.axes is None and "" in data:
            return self.fit(data[""])
        return fit_each(dict.fromkeys(AXES, self), data)

    def fit(self, data: FemDataset) -> FittedLaw:
        """Fit the states of role "fit" and score the law on those of role "check" (see `polynomial.states`).

        Raises `UserError`, in one sentence, for too few states, non-finite numbers and contradictions.
        """
        states = split(data, "a table law")
        found = fit_table(states.fit, states.domain)
        box = np.concatenate([states.domain.actuation[None], states.domain.deformation])
        told = _told(len(states.fit))
        angles, misses = states.fit.angle_rad[told, None], found.misses[told, None]
        error = ErrorBar.of(box, states.fit.actuation[told], angles, misses, inner_scores=True)
        law = TableLaw(
            found.coefficients,
            states.domain,
            data.actuation_name,
            (data.axis,),
            joint_of(data),
            error,
        )
        return FittedLaw(law, scoring.report(law, states, _choice(law, found)))

    def load(self, record: LawRecord) -> JointLaw:
        """The law of a record that `TableLaw.record` or `AxesLaw.record` wrote."""
        require_kind(record, KIND)
        if record.values["joint"] == "spherical":
            return AxesLaw.of_record(record, TableLaw.of_record)
        return TableLaw.of_record(record)


def _told(n: int) -> NDArray[np.int64]:
    """The states whose misses make the band: all, or a seeded choice of a long recording."""
    return np.sort(np.random.default_rng(SEED).permutation(n)[:MOST_PLACES])


def _choice(law: TableLaw, found: Smoothed) -> dict[str, Any]:
    slope = largest_slope(law)
    order, in_p, in_u = found.smoothing
    names = ("order", "actuation", "deformation", "rmse_of_range")
    return {
        "form": "table",
        "cells": [size - 3 for size in law.coefficients.shape],
        "smoothing": {"order": order, "actuation": in_p, "deformation": in_u},
        "left_out_rmse_of_range": found.rmse,
        "forced_to_fall": found.forced,
        "tried": [dict(zip(names, one, strict=True)) for one in found.tried],
        "largest_slope": slope,
        "stable": slope < 0,
    }
