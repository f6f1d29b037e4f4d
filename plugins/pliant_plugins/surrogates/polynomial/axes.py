"""A spherical joint's law from the laws of its axes, and the errors of all of them together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.surrogate import FittedLaw, Surrogate
from pliant.records.fem import FemDataset
from pliant.records.law import FitReport, JointLaw
from pliant_plugins.surrogates.polynomial.axes_law import AXES, AxesLaw

FEM = ""
# Of each axis's own report; the rest of it stands under `axes`.
SCORES = ("n_fitted", "n_heldout", "rmse", "worst", "worst_of_range", "r2", "effort_range")


def axes_law(laws: Mapping[str, JointLaw | None]) -> AxesLaw:
    """The law of laws by axis."""
    x, y, z = (laws[axis] for axis in AXES)
    assert x is not None and y is not None and z is not None
    return AxesLaw((x, y, z))


def fit_each(axes: Mapping[str, Surrogate], data: Mapping[str, FemDataset]) -> FittedLaw:
    """State or fit each axis.

    Raises:
        UserError: the FEM states are of another axis, or an axis cannot be fitted; it is named.
    """
    laws: dict[str, JointLaw] = {}
    reports: dict[str, FitReport] = {}
    for axis, surrogate in axes.items():
        stated = surrogate.stated()
        if stated is not None:
            laws[axis] = stated
            continue
        try:
            fitted = surrogate.fit(_of_axis(axis, data))
        except UserError as error:
            raise UserError(f"axis {axis}: {error}") from None
        laws[axis], reports[axis] = fitted.law, fitted.report
    return FittedLaw(axes_law(laws), _together(reports))


def _of_axis(axis: str, data: Mapping[str, FemDataset]) -> FemDataset:
    """The axis's own table, whatever axis it says, or the FEM states of that axis."""
    if axis in data:
        return replace(data[axis], axis=axis)
    if FEM not in data:
        raise UserError(f"no states of axis {axis}: the data have {', '.join(sorted(data))}")
    if data[FEM].axis != axis:
        raise UserError(
            f"the FEM stage solves axis {data[FEM].axis} only: give 'data' or 'coefficients' for axis {axis}"
        )
    return data[FEM]


def _together(reports: Mapping[str, FitReport]) -> FitReport:
    """Errors over all states of all fitted axes; `worst_of_range` and `r2` are those of the worst axis."""
    each = list(reports.values())
    n = np.array([report.n_heldout for report in each])
    details: dict[str, Any] = {
        "form": " and ".join(f"{axis} {report.details['form']}" for axis, report in reports.items()),
        "held_out": "; ".join(f"{axis}: {report.details['held_out']}" for axis, report in reports.items()),
        "stated_axes": [axis for axis in AXES if axis not in reports],
        "stable": all(report.details["stable"] for report in each),
        "axes": {
            axis: {**{name: getattr(report, name) for name in SCORES}, **report.details}
            for axis, report in reports.items()
        },
    }
    return FitReport(
        n_fitted=sum(report.n_fitted for report in each),
        n_heldout=int(n.sum()),
        rmse=float(np.sqrt(np.sum(n * [report.rmse**2 for report in each]) / n.sum())),
        worst=max(report.worst for report in each),
        worst_of_range=max(report.worst_of_range for report in each),
        r2=min(report.r2 for report in each),
        effort_range=max(report.effort_range for report in each),
        details=details,
    )
