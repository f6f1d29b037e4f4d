"""Runs that tell hypotheses apart: the reading, the model as it is, and the model with each explanation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pliant.diagnosis.evidence_table import NOTHING
from pliant.diagnosis.verdict import named
from pliant.formatting import unit_of
from pliant.report.chart import Band, Chart, ChartAxis, ChartLine, Panel
from pliant.report.evidence_view import Diagnosed, clock, clock_words, thin
from pliant.report.figures import style
from pliant.report.figures.charts import level
from pliant.report.figures.diagnosis import AS_IT_IS, BAND, BAND_COLOUR, MOST, WITH


def explained_chart(diagnosed: Diagnosed, output: str) -> Chart:
    """Per telling run a panel of the readings and one of the errors in a band of ± 2 floors."""
    words = unit_of(output)
    models = [("model as it is", AS_IT_IS, diagnosed.predicted(NOTHING))]
    for kinds, colour in zip(diagnosed.explanations, WITH, strict=False):
        models.append((f"model with {named(kinds)}", colour, diagnosed.predicted(kinds)))
    half = BAND * diagnosed.floor(output) * words.factor
    panels = []
    for name in diagnosed.telling_runs(MOST):
        index = next(k for k, one in enumerate(diagnosed.measurement.runs) if one.name == name)
        run = diagnosed.measurement.runs[index]
        pick = thin(len(run))
        time, measured = clock(run)[0][pick], words.factor * run.outputs[output][pick]
        lines: list[ChartLine] = []
        errors: list[ChartLine] = []
        for model, colour, predicted in models:
            values = words.factor * predicted[index][output][pick]
            lines.append(ChartLine(model, time, values, name, colour, 1.5))
            errors.append(ChartLine(model, time, measured - values, name, colour, 1.0))
        lines.append(
            ChartLine("measured", time, measured, name, style.INK, 0.9, 3.0 if len(pick) < 40 else 0.0)
        )
        x = ChartAxis(*clock_words(run))
        top = Panel(x, ChartAxis(words.label, words.symbol), tuple(lines), title=name, linked=name)
        bands: tuple[Band, ...] = ()
        if np.isfinite(half):
            ends, high = level(time, half)
            bands = (Band("± 2 noise floors", ends, -high, high, name, BAND_COLOUR),)
        below = replace(
            top,
            y=ChartAxis("error", words.symbol),
            lines=tuple(errors),
            bands=bands,
            title="",
            zero=style.SOFT,
        )
        panels += [top, below]
    return Chart(tuple(panels), pairs=True)
