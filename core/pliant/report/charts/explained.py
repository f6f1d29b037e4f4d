"""What a diagnosis rests on: how probable each hypothesis is; runs with the model as it is and with explanations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pliant.diagnosis.evidence_table import NOTHING
from pliant.diagnosis.verdict import named
from pliant.formatting import unit_of
from pliant.report.chart import Band, Chart, ChartAxis, ChartLine, Panel
from pliant.report.evidence_view import Diagnosed, abscissa, clock, clock_words, input_of, thin
from pliant.report.figures import style
from pliant.report.figures.charts import level
from pliant.report.figures.diagnosis import AS_IT_IS, BAND, BAND_COLOUR, FIRST, MOST, OTHER, WITH, name_of


def explained_chart(diagnosed: Diagnosed, output: str) -> Chart:
    """Per telling run a panel of the readings, one of the errors in a band of ± 2 floors, one of the loop."""
    driver = abscissa(diagnosed.before)
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
        over = None if driver is None else driver[1].factor * input_of(run, driver[0])[pick]
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
        if driver is not None and over is not None:
            loops = tuple(replace(line, x=over) for line in lines)
            x = ChartAxis(driver[1].label, driver[1].symbol)
            panels.append(replace(top, x=x, lines=loops, title="", linked=""))
    return Chart(tuple(panels), column=2 if driver is None else 3)


def hypotheses_chart(diagnosed: Diagnosed) -> Chart:
    """Bars of probability, and of the rms error on runs left out over the noise floor where it is known."""
    shown = diagnosed.hypotheses()
    names = tuple(name_of(kinds).replace("\n", " ") for kinds in shown)
    credible = set(diagnosed.found.judgement.credible)
    y, ends = ChartAxis("explanation", names=names), (-len(shown) + 0.4, 0.6)
    shares = [100 * diagnosed.found.judgement.probability.get(kinds, 0.0) for kinds in shown]
    errors = [diagnosed.left_out_error(kinds) for kinds in shown]

    def bars(values: list[float]) -> tuple[ChartLine, ...]:
        return tuple(
            ChartLine(
                name,
                np.array([0.0, v]),
                np.full(2, -float(k)),
                "",
                FIRST if kinds in credible else OTHER,
                7.0,
            )
            for k, (name, kinds, v) in enumerate(zip(names, shown, values, strict=True))
            if np.isfinite(v)
        )

    panels = [Panel(ChartAxis("probability", "%"), y, bars(shares), title="How probable", y_range=ends)]
    if np.isfinite(errors).any():
        floor = ChartLine("noise floor", np.ones(2), np.array(ends), "", style.WARN, 1.2)
        x = ChartAxis("rms error on runs left out of the fit, in noise floors")
        panels.append(Panel(x, y, (*bars(errors), floor), title="How much error it leaves", y_range=ends))
    return Chart(tuple(panels))
