"""Charts of an experiment: probabilities after each run, and readings with the bands of the models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.formatting import output_unit
from pliant.records.design import Array
from pliant.report.chart import Band, Chart, ChartAxis, ChartLine, ChartRule, Panel
from pliant.report.chart_colours import INK, SERIES
from pliant_bench.loop.compared import ModelBand, read_bands
from pliant_bench.loop.folder import OWN_COLUMNS, RoundFolder, read_columns

NOTHING = "nothing missing"
# The study's model as it is, and with the explanation.
MODEL_COLOURS = (SERIES[1], SERIES[0])
MOST_HYPOTHESES, MOST_POINTS = 6, 400


def hypothesis(kinds: Sequence[str]) -> str:
    """Return the name of an explanation."""
    return " + ".join(kinds) or NOTHING


def probability_chart(verdicts: Mapping[int, Mapping[str, Any]]) -> Chart | None:
    """Return the probabilities of the explanations over the runs; `verdicts` are those after the runs, by number."""
    if not verdicts:
        return None
    tables = [
        {hypothesis(h["kinds"]): float(h["probability"]) for h in verdict["hypotheses"]}
        for verdict in verdicts.values()
    ]
    best = {name: max(t.get(name, 0.0) for t in tables) for table in tables for name in table}
    names = sorted(best, key=lambda name: -best[name])[:MOST_HYPOTHESES]
    x = np.array([float(number) for number in verdicts])
    lines = tuple(
        ChartLine(
            name,
            x,
            100.0 * np.array([t.get(name, 0.0) for t in tables]),
            "",
            SERIES[k % len(SERIES)],
            1.8,
            6.0,
        )
        for k, name in enumerate(names)
    )
    axis = ChartAxis("probability", "%", ends=(-2.0, 102.0))
    return Chart((Panel(ChartAxis("run"), axis, lines),), cell=(1200, 520))


def runs_chart(rounds: Sequence[RoundFolder], output: str) -> Chart | None:
    """Return per run the readings of an output with the band of each model, and below what each model misses."""
    panels: list[Panel] = []
    for one in rounds:
        samples, bands = read_columns(one.samples), read_bands(one).get(output, ())
        if output not in samples:
            continue
        panels += _run_panels((one.read("plan") or {})["name"], samples, output, bands)
    return Chart(tuple(panels), column=2, heights=(3.0, 2.0), across=3, cell=(560, 560)) if panels else None


def _run_panels(
    name: str, samples: Mapping[str, Array], output: str, bands: Sequence[ModelBand]
) -> tuple[Panel, Panel]:
    """Return the panel of the readings and the panel of the residuals of a run."""
    unit, pick = output_unit(output), _thin(len(samples["read_s"]))
    clock, measured = samples["read_s"][pick], samples[output][pick]
    upper: list[Band | ChartLine] = []
    lower: list[Band | ChartLine | ChartRule] = []
    for model, colour in zip(bands, MODEL_COLOURS, strict=False):
        upper += _model_marks(model, colour, unit.factor)
        mean, sd = (np.interp(clock, model.time_s, values) for values in (model.mean, model.sd))
        if np.isfinite(sd).any():
            wide = 2.0 * unit.factor * sd
            lower.append(Band(f"{model.name} ± 2 sd", clock, -wide, wide, "", f"{colour}2e"))
        lower.append(ChartLine(model.name, clock, unit.factor * (measured - mean), "", colour, 0.0, 2.5))
    upper.append(ChartLine("measured", clock, unit.factor * measured, "", INK, 0.0, 2.5))
    lower.append(ChartRule(0.0))
    time = ChartAxis("time", "s")
    return (
        Panel(time, ChartAxis(unit.label, unit.symbol), tuple(upper), name, linked=name),
        Panel(time, ChartAxis("error", unit.symbol), tuple(lower), linked=name),
    )


def _model_marks(model: ModelBand, colour: str, factor: float) -> list[Band | ChartLine]:
    """Return a model's line, and its band where it has one."""
    pick = _thin(len(model.time_s))
    clock, mean, wide = model.time_s[pick], factor * model.mean[pick], 2.0 * factor * model.sd[pick]
    band = [Band(f"{model.name} ± 2 sd", clock, mean - wide, mean + wide, "", f"{colour}2e")]
    line = ChartLine(model.name, clock, mean, "", colour, 1.2)
    return [*(band if np.isfinite(wide).any() else []), line]


def read_outputs(rounds: Sequence[RoundFolder]) -> list[str]:
    """Return the outputs that were read in the runs."""
    names: dict[str, None] = {}
    for one in rounds:
        inputs = one.read_protocol().commands
        own = (*OWN_COLUMNS, *inputs)
        names |= dict.fromkeys(name for name in read_columns(one.samples) if name not in own)
    return list(names)


def _thin(n: int) -> np.ndarray[Any, np.dtype[np.intp]]:
    return np.unique(np.linspace(0, n - 1, min(n, MOST_POINTS)).astype(np.intp))
