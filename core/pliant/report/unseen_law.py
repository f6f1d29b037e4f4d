"""What a `fit` result says of a law that comes from a model of other designs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pliant.config.design_parameters import spoken
from pliant.formatting import percent
from pliant.records.law import FitReport


def meta_law_json(details: Mapping[str, Any]) -> dict[str, Any]:
    """Return the additional keys of a law's `fit` result if it comes from a meta-model."""
    names = ("meta_model", "design", "inside", "n_designs", "scores", "coverage")
    return {name: details[name] for name in names}


def meta_law_lines(report: FitReport) -> list[str]:
    """Return the lines on a law of a meta-model, for the terminal."""
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
