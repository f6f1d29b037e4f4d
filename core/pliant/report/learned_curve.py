"""A learned term as JSON, and its curve over one covariate in display units: what its pictures are drawn from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.diagnosis.law_off import LawOff
from pliant.diagnosis.learned_term import LearnedTerm
from pliant.diagnosis.learned_words import covariate_words, described, quantity
from pliant.mechanics.learned_curve import MARGIN, CurveAxis, basis
from pliant.records.design import Array
from pliant.report.chart import Band, Chart, ChartAxis, ChartLine, Panel
from pliant.report.document import capital

# Half-width of a central 90 % band in standard deviations.
NINETY = 1.6449
POINTS = 400


@dataclass(frozen=True, eq=False)
class LearnedCurve:
    """Attributes:
    over, what: covariate, and quantity that the term changes, with their display units.
    x, value, half: (n,) places, values, half-widths of the 90 % band.
    knots_x, knots: where the term has values, and which.
    ends: where the data end; beyond them the term dies out.
    """

    over: ChartAxis
    what: ChartAxis
    x: Array
    value: Array
    half: Array
    knots_x: Array
    knots: Array
    ends: tuple[float, float]

    @property
    def chart(self) -> Chart:
        """The curve that moves; lines mark where the data end."""
        low, high = self.value - self.half, self.value + self.half
        height = np.array([low.min(), high.max()])
        ends = [ChartLine("data end", np.full(2, at), height, colour="#5c6577") for at in self.ends]
        lines = (
            *ends,
            ChartLine("learned term", self.x, self.value, colour="#0072b2", width=2.2),
            ChartLine("knots", self.knots_x, self.knots, colour="#0072b2", width=0.0, dot=4.0),
        )
        bands = (Band("90 % band", self.x, low, high),)
        return Chart(
            (Panel(self.over, self.what, lines, bands, "What the learned term adds", zero="#5c6577"),)
        )


def law_error_json(found: LawOff | None) -> dict[str, Any] | None:
    """Return how far the law is off, SI; the surface as `learned` has it."""
    if found is None:
        return None
    plain = {
        key: getattr(found, key)
        for key in ("size", "effort", "output", "change", "drive", "actuation", "reading", "share")
    }
    return {**plain, "surface": learned_json(found.term)}


def beyond(axis: CurveAxis, count: int) -> Array:
    """Places over the range and a little more than the margins in which the curve dies out."""
    more = 1.5 * MARGIN * (axis.high - axis.low)
    return np.linspace(axis.low - more, axis.high + more, count)


def curve_of(found: LearnedTerm) -> LearnedCurve | None:
    """Over one covariate; None for a term over two."""
    if len(found.form.axes) != 1:
        return None
    (axis,) = found.form.axes
    label, unit = quantity(found)
    words = covariate_words(axis, found.drive)
    x = beyond(axis, POINTS)
    weights = basis(found.form.axes, [x])
    sd = np.sqrt(np.einsum("tk,kl,tl->t", weights, found.covariance, weights))
    return LearnedCurve(
        ChartAxis(words.label, words.symbol),
        ChartAxis(label, unit.symbol),
        x * words.factor,
        weights @ found.value * unit.factor,
        NINETY * sd * unit.factor,
        np.asarray(axis.at) * words.factor,
        found.value * unit.factor,
        (axis.low * words.factor, axis.high * words.factor),
    )


def learned_json(found: LearnedTerm | None) -> dict[str, Any] | None:
    """What it is as a study's block, how far the error falls on runs left out, how sure that is."""
    if found is None:
        return None
    return {
        "effect": found.effect.canonical(),
        "depends_on": [axis.name for axis in found.form.axes],
        "acts_on": found.form.acts_on,
        "rmse_over_floor": {"without": found.before, "with": found.after},
        "left_out": found.on,
        "standard_errors": found.sure,
        "effective_values": found.freedom,
        "forms_tried": found.tried,
        "description": capital(described(found)),
    }
