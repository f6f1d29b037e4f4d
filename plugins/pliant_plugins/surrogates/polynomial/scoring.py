"""Errors of a law on unseen states: of one axis, or by axis and with several axes deflected."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy  # scipy.spatial only where a law is scored

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.fem import COUPLING, FemDataset, ModuleData
from pliant.records.law import Domain, FitReport, JointLaw
from pliant_plugins.surrogates.polynomial.law import study_law
from pliant_plugins.surrogates.polynomial.states import Mask, Split
from pliant_plugins.surrogates.polynomial.study import energies_known, fit_differences, fit_study

# Of the band that a report checks.
LEVEL = 0.9


def report(
    law: JointLaw, states: Split[FemDataset], details: Mapping[str, Any], odd: bool = False
) -> FitReport:
    """Report errors of a one-axis law on its check states, and those of the published forms, with `odd` or not."""
    check = states.check
    u, given = check.angle_rad[:, None], check.moment_n_m
    predicted = law.evaluate(check.actuation, u).tau[:, 0]
    band = law.band(check.actuation, u, LEVEL)
    size = float(states.ranges[0])
    error_bar = None
    if band is not None:
        error_bar = {
            "level": LEVEL,
            "covered": float(np.mean(np.abs(predicted - given) <= band[:, 0])),
            "n": len(check),
            "mean_half_width_of_range": float(band.mean()) / size,
        }
    return FitReport(
        n_fitted=len(states.fit),
        n_heldout=len(check),
        effort_range=size,
        **errors(predicted - given, given, size),
        details={
            **details,
            "held_out": states.held_out,
            "excluded": states.excluded,
            "in_contact": states.in_contact,
            "coverage": coverage(states.fit, states.domain),
            "error_bar": error_bar,
            "slope_errors": slope_errors(law, check),
            "residuals": _residuals(check.actuation, check.angle_rad, given, predicted),
            **study_beside(states, odd),
        },
    )


def report_axes(
    law: JointLaw, states: Split[ModuleData], choice: Mapping[str, Any], largest_slope: float
) -> FitReport:
    """Report each axis in `details["axes"]`, on the states that explore it, and `details["coupling"]`.

    Totals are over all check states and axes; `r2` and `worst_of_range` are those of the worst axis.
    """
    check, fit = states.check, states.fit
    predicted = law.evaluate(check.actuation, check.deformation).tau
    missed = predicted - check.tau

    def scores(k: int, rows: Mask) -> dict[str, Any]:
        size = float(states.ranges[k])
        found = errors(missed[rows, k], check.tau[rows, k], size)
        return {"n_heldout": int(rows.sum()), **found, "effort_range": size}

    axes: dict[str, Any] = {}
    for k, axis in enumerate(check.axes):
        own = check.explored == axis
        if not own.any():
            own = np.ones(len(check), bool)
        axes[axis] = {
            **scores(k, own),
            "n_fitted": int(np.sum(fit.explored == axis)),
            "form": choice["form"],
            "held_out": states.held_out,
            "stable": largest_slope < 0,
            "residuals": _residuals(
                check.actuation[own], check.deformation[own, k], check.tau[own, k], predicted[own, k]
            ),
        }
    several = check.explored == COUPLING
    details: dict[str, Any] = {
        **choice,
        "held_out": states.held_out,
        "stated_axes": [],
        "excluded": states.excluded,
        "in_contact": states.in_contact,
        "largest_slope": largest_slope,
        "stable": largest_slope < 0,
        "axes": axes,
        "error_bar": _axes_error_bar(law, states, np.abs(missed)),
    }
    if several.any():
        details[COUPLING] = {axis: scores(k, several) for k, axis in enumerate(check.axes)}
    return FitReport(
        n_fitted=len(fit),
        n_heldout=len(check),
        rmse=float(np.sqrt(np.mean(missed**2))),
        worst=float(np.abs(missed).max()),
        worst_of_range=float((np.abs(missed) / states.ranges).max()),
        r2=min(one["r2"] for one in axes.values()),
        effort_range=float(states.ranges.max()),
        details=details,
    )


def errors(missed: Array, given: Array, effort_range: float) -> dict[str, float]:
    """Return rmse and worst (N·m), worst_of_range and r2 of efforts `given` (n,) with errors `missed` (n,)."""
    spread = float(np.sum((given - given.mean()) ** 2))
    worst = float(np.abs(missed).max())
    return {
        "rmse": float(np.sqrt(np.mean(missed**2))),
        "worst": worst,
        "worst_of_range": worst / effort_range,
        "r2": 1 - float(np.sum(missed**2)) / spread if spread > 0 else float("nan"),
    }


def axes_known(data: ModuleData) -> Mask:
    """Return a mask (n, k) of the axes that a state informs: the explored one, or all if several are deflected."""
    known: Mask = data.explored[:, None] == np.array(data.axes)
    known |= (data.explored == COUPLING)[:, None]
    return known if known.any() else np.ones_like(known)


def _axes_error_bar(law: JointLaw, states: Split[ModuleData], missed: Array) -> dict[str, Any] | None:
    """Return shares of check states in the law's band by axis, where it is known; None without a band."""
    check = states.check
    band = law.band(check.actuation, check.deformation, LEVEL)
    if band is None:
        return None
    inside, known = missed <= band, axes_known(check)
    return {
        "level": LEVEL,
        "covered": float(inside[known].mean()),
        "n": int(known.sum()),
        "mean_half_width_of_range": float((band / states.ranges)[known].mean()),
        "axes": {
            axis: {"covered": float(inside[own, k].mean()), "n": int(own.sum())}
            for k, axis in enumerate(check.axes)
            if (own := known[:, k]).any()
        },
    }


def slope_errors(law: JointLaw, data: FemDataset) -> dict[str, float]:
    """Return the RMS error of each slope in the data, as a share of the slope's largest size."""
    effort = law.evaluate(data.actuation, data.angle_rad[:, None])
    result = {}
    for name, predicted in (("dmoment_dp", effort.dtau_dp[:, 0]), ("dmoment_du", effort.dtau_du[:, 0, 0])):
        given = getattr(data, name)
        known = np.isfinite(given)
        if known.any() and np.any(given[known]):
            missed = predicted[known] - given[known]
            result[name] = float(np.sqrt(np.mean(missed**2)) / np.abs(given[known]).max())
    return result


def _residuals(actuation: Array, angle: Array, given: Array, predicted: Array) -> dict[str, list[float]]:
    """Return the data of a residual plot, state by state."""
    return {
        "actuation": actuation.tolist(),
        "angle_rad": angle.tolist(),
        "moment_n_m": given.tolist(),
        "predicted_n_m": predicted.tolist(),
    }


def study_beside(split: Split[FemDataset], odd: bool = False) -> dict[str, Any]:
    """Fit the published forms to the same states and score them, by the details' names.

    `study_form` is fitted by least squares; `study_finite_differences` is there where strain energies are known.
    """
    procedures = {"study_form": fit_study}
    if energies_known(split.fit):
        procedures["study_finite_differences"] = fit_differences
    found: dict[str, Any] = {}
    check = split.check
    for name, procedure in procedures.items():
        try:
            coefficients = procedure(split.fit, odd)
        except UserError as error:
            found[name] = {"problem": str(error)}
            continue
        law = study_law(coefficients, odd, split.domain, split.fit.actuation_name, split.fit.axis)
        missed = law.evaluate(check.actuation, check.angle_rad[:, None]).tau[:, 0] - check.moment_n_m
        scores = errors(missed, check.moment_n_m, float(split.ranges[0]))
        found[name] = {**scores, "parameters": coefficients.canonical(), "odd": odd}
    return found


def coverage(data: FemDataset, domain: Domain) -> float:
    """Share of the domain's box inside the convex hull of the fitted states; the rest is extrapolation."""
    box = np.vstack([domain.actuation, domain.deformation])
    points = (np.column_stack([data.actuation, data.angle_rad]) - box[:, 0]) / np.ptp(box, axis=1)
    try:
        return float(scipy.spatial.ConvexHull(points).volume)
    except scipy.spatial.QhullError:
        return 0.0
