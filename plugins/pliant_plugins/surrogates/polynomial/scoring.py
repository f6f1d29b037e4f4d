"""Errors of a law on states that it has not seen."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from pliant.errors import UserError
from pliant.records.fem import FemDataset
from pliant.records.law import Domain, JointLaw
from pliant_plugins.surrogates.polynomial.config import StudyCoefficients
from pliant_plugins.surrogates.polynomial.states import Split
from pliant_plugins.surrogates.polynomial.study_differences import energies_known, fit_differences
from pliant_plugins.surrogates.polynomial.study_form import fit_study, study_law

# Of the band that a report checks.
LEVEL = 0.9


def errors(law: JointLaw, data: FemDataset, effort_range: float) -> dict[str, float]:
    """rmse and worst (N·m), worst_of_range and r2 of the moments of `data`."""
    missed = law.evaluate(data.actuation, data.angle_rad[:, None]).tau[:, 0] - data.moment_n_m
    spread = float(np.sum((data.moment_n_m - data.moment_n_m.mean()) ** 2))
    worst = float(np.abs(missed).max())
    return {
        "rmse": float(np.sqrt(np.mean(missed**2))),
        "worst": worst,
        "worst_of_range": worst / effort_range,
        "r2": 1 - float(np.sum(missed**2)) / spread if spread > 0 else float("nan"),
    }


def error_bar(law: JointLaw, data: FemDataset, effort_range: float) -> dict[str, float] | None:
    """Share of the states of `data` that lie in the law's band, and the band's mean half-width; None without one."""
    u = data.angle_rad[:, None]
    band = law.band(data.actuation, u, LEVEL)
    if band is None:
        return None
    missed = np.abs(law.evaluate(data.actuation, u).tau[:, 0] - data.moment_n_m)
    return {
        "level": LEVEL,
        "covered": float(np.mean(missed <= band[:, 0])),
        "n": len(data),
        "mean_half_width_of_range": float(band.mean()) / effort_range,
    }


def slope_errors(law: JointLaw, data: FemDataset) -> dict[str, float]:
    """RMS error of each slope where the data have it, as a share of the slope's largest size."""
    effort = law.evaluate(data.actuation, data.angle_rad[:, None])
    result = {}
    for name, predicted in (("dmoment_dp", effort.dtau_dp[:, 0]), ("dmoment_du", effort.dtau_du[:, 0, 0])):
        given = getattr(data, name)
        known = np.isfinite(given)
        if known.any() and np.any(given[known]):
            missed = predicted[known] - given[known]
            result[name] = float(np.sqrt(np.mean(missed**2)) / np.abs(given[known]).max())
    return result


def residuals(law: JointLaw, data: FemDataset) -> dict[str, list[float]]:
    """What a picture of the fit needs, state by state."""
    return {
        "actuation": data.actuation.tolist(),
        "angle_rad": data.angle_rad.tolist(),
        "moment_n_m": data.moment_n_m.tolist(),
        "predicted_n_m": law.evaluate(data.actuation, data.angle_rad[:, None]).tau[:, 0].tolist(),
    }


def study_beside(split: Split, odd: bool = False) -> dict[str, Any]:
    """The study's forms fitted to the same states and scored on the same states, by the details' names.

    `study_form` is fitted by least squares; `study_finite_differences` is there where strain energies are known.
    """
    found = {"study_form": _scored(split, odd, fit_study)}
    if energies_known(split.fit):
        found["study_finite_differences"] = _scored(split, odd, fit_differences)
    return found


def _scored(
    split: Split, odd: bool, procedure: Callable[[FemDataset, bool], StudyCoefficients]
) -> dict[str, Any]:
    try:
        coefficients = procedure(split.fit, odd)
    except UserError as error:
        return {"problem": str(error)}
    law = study_law(coefficients, odd, split.domain, split.fit.actuation_name, split.fit.axis)
    scores: dict[str, Any] = errors(law, split.check, split.effort_range)
    return {**scores, "parameters": coefficients.canonical(), "odd": odd}


def coverage(data: FemDataset, domain: Domain) -> float:
    """Share of the domain's box inside the convex hull of the fitted states; the rest is extrapolation."""
    points = np.stack(
        [
            (data.actuation - domain.actuation[0]) / np.ptp(domain.actuation),
            (data.angle_rad - domain.deformation[0, 0]) / np.ptp(domain.deformation[0]),
        ],
        axis=1,
    )
    try:
        return float(ConvexHull(points).volume)
    except QhullError:
        return 0.0
