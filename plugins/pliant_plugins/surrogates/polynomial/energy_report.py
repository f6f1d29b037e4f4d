"""Errors of a law of several axes on states that it has not seen, axis by axis and where several are held."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.fem import COUPLING, ModuleData
from pliant.records.law import FitReport, JointLaw
from pliant_plugins.surrogates.polynomial.energy_states import AxesSplit
from pliant_plugins.surrogates.polynomial.scoring import LEVEL


def report(law: JointLaw, states: AxesSplit, choice: Mapping[str, Any], largest_slope: float) -> FitReport:
    """`details["axes"]` has each axis on the states that explore it, `details["coupling"]` those that hold several.

    Totals are over all check states and axes; `r2` and `worst_of_range` are those of the worst axis.
    """
    check, fit = states.check, states.fit
    missed = law.evaluate(check.actuation, check.deformation).tau - check.tau
    axes: dict[str, Any] = {}
    for k, axis in enumerate(check.axes):
        own = check.explored == axis
        if not own.any():
            own = np.ones(len(check), bool)
        axes[axis] = {
            **scores(missed[own, k], check.tau[own, k], float(states.ranges[k])),
            "n_fitted": int(np.sum(fit.explored == axis)),
            "form": choice["form"],
            "held_out": states.held_out,
            "stable": largest_slope < 0,
            "residuals": _residuals(check, own, k, missed),
        }
    shares = np.abs(missed) / states.ranges
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
        "error_bar": error_bar(law, states),
    }
    if several.any():
        details[COUPLING] = {
            axis: scores(missed[several, k], check.tau[several, k], float(states.ranges[k]))
            for k, axis in enumerate(check.axes)
        }
    return FitReport(
        n_fitted=len(fit),
        n_heldout=len(check),
        rmse=float(np.sqrt(np.mean(missed**2))),
        worst=float(np.abs(missed).max()),
        worst_of_range=float(shares.max()),
        r2=min(one["r2"] for one in axes.values()),
        effort_range=float(states.ranges.max()),
        details=details,
    )


def error_bar(law: JointLaw, states: AxesSplit) -> dict[str, Any] | None:
    """As `scoring.error_bar`: shares of check states in the law's band, each axis where it is explored or held."""
    check = states.check
    band = law.band(check.actuation, check.deformation, LEVEL)
    if band is None:
        return None
    inside = np.abs(law.evaluate(check.actuation, check.deformation).tau - check.tau) <= band
    told = told_axes(check)
    shares = band / states.ranges
    return {
        "level": LEVEL,
        "covered": float(inside[told].mean()),
        "n": int(told.sum()),
        "mean_half_width_of_range": float(shares[told].mean()),
        "axes": {
            axis: {"covered": float(inside[own, k].mean()), "n": int(own.sum())}
            for k, axis in enumerate(check.axes)
            if (own := told[:, k]).any()
        },
    }


def told_axes(data: ModuleData) -> NDArray[np.bool_]:
    """(n, k) marks the axes that a state tells of: the one that it explores, or all where it holds several."""
    told: NDArray[np.bool_] = data.explored[:, None] == np.array(data.axes)
    told |= (data.explored == COUPLING)[:, None]
    return told if told.any() else np.ones_like(told)


def scores(missed: Array, wanted: Array, effort_range: float) -> dict[str, Any]:
    """n_heldout, rmse and worst (N·m), worst_of_range, r2 and effort_range of one axis."""
    spread = float(np.sum((wanted - wanted.mean()) ** 2))
    worst = float(np.abs(missed).max())
    return {
        "n_heldout": len(missed),
        "rmse": float(np.sqrt(np.mean(missed**2))),
        "worst": worst,
        "worst_of_range": worst / effort_range,
        "r2": 1 - float(np.sum(missed**2)) / spread if spread > 0 else float("nan"),
        "effort_range": effort_range,
    }


def _residuals(check: ModuleData, own: NDArray[np.bool_], k: int, missed: Array) -> dict[str, list[float]]:
    return {
        "actuation": check.actuation[own].tolist(),
        "angle_rad": check.deformation[own, k].tolist(),
        "moment_n_m": check.tau[own, k].tolist(),
        "predicted_n_m": (check.tau[own, k] + missed[own, k]).tolist(),
    }
