"""A comparison as one self-contained HTML page: measured over predicted, loops, where the error is, tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pliant import __version__
from pliant.evidence.comparison import Comparison
from pliant.evidence.interpretation import interpret
from pliant.evidence.scores import GroupError
from pliant.evidence.words import number, percent, shown
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.report.comparison_reading import Compared
from pliant.report.facts import Table
from pliant.report.figures.condition_map import MOST_RUNS, condition_map
from pliant.report.figures.loops import loops
from pliant.report.figures.residual_places import residual_places
from pliant.report.figures.runs_in_time import MOST, runs_in_time
from pliant.report.layout import Page, Picture, Section
from pliant.report.template import page_template
from pliant.report.words import Warned

OUTPUTS_DRAWN = 2
ROWS = 60  # of a table


def comparison_page(
    title: str, measurement: Measurement, predicted: Sequence[Mapping[str, Array]], comparison: Comparison
) -> Page:
    """Draw and write the page. The same comparison gives the same bytes."""
    compared = Compared(measurement, predicted, comparison)
    drawn = compared.outputs_by_error()[:OUTPUTS_DRAWN]
    hero = Picture("runs", _runs_caption(compared, drawn[0]), runs_in_time(compared, drawn[0]))
    made = (
        _where(compared, drawn),
        _loops(compared, drawn),
        _map(compared),
        _more_runs(compared, drawn),
        _numbers(compared),
    )
    sections = [section for section in made if section is not None]
    text = page_template().render(
        kind="Pliant: model against measurement",
        title=title,
        sentence=interpret(comparison),
        hero=hero,
        warnings=[Warned(remark) for remark in comparison.remarks],
        sections=sections,
        version=__version__,
        footer=f"Measurement: {measurement.source or 'given in memory'}. Errors are measured − model",
    )
    pictures = {p.name: p.png for p in (hero, *(p for s in sections for p in s.pictures))}
    return Page(text, pictures)


def _runs_caption(compared: Compared, output: str) -> str:
    _, whole = compared.worst_runs(MOST)
    which = "all runs" if whole else "one run of each condition, the worst first"
    floor = compared.comparison.outputs[output].noise_floor
    band = (
        f"; the band is ± 2 noise floors (one is {shown(output).text(floor, 2)})"
        if np.isfinite(floor)
        else ""
    )
    return (
        f"{_capital(shown(output).label)}, {which}: measured in black, model in blue{band}. Below each run its error, "
        "measured − model; what leaves the band is filled. A model that lacks nothing leaves it one time in twenty, "
        "anywhere."
    )


def _where(compared: Compared, drawn: Sequence[str]) -> Section | None:
    pictures = []
    for k, output in enumerate(drawn):
        png = residual_places(compared, output)
        if png is None:
            return None
        caption = (
            f"Error in {shown(output).label} against everything that varied. Dots: mean error in a bin with the 95 % "
            "interval that noise of this colour gives it; filled: more than noise, corrected for looking at "
            f"{compared.comparison.n_places} places. “Tells 40 %”: this circumstance alone predicts 40 % of the "
            "error's variance in runs that it was not fitted to."
        )
        pictures.append(Picture(f"where_{k + 1}", caption, png))
    return Section("Where the error is", tuple(pictures), (_worst_table(compared.comparison),))


def _loops(compared: Compared, drawn: Sequence[str]) -> Section | None:
    pictures = []
    for k, output in enumerate(drawn):
        png = loops(compared, output)
        if png is None:
            return None
        caption = (
            f"{_capital(shown(output).label)} over what drives it; below, the error over the same, coloured by what "
            "the actuation does. A gap between rising and falling is hysteresis that the model lacks or has too much; "
            "a common slope a wrong gain or stiffness; a common shift an offset; a vertical stroke in a hold a drift."
        )
        pictures.append(Picture(f"loops_{k + 1}", caption, png))
    return Section("Loops", tuple(pictures))


def _map(compared: Compared) -> Section | None:
    png = condition_map(compared)
    if png is None:
        return None
    cut = f" The {MOST_RUNS} worst runs." if len(compared.comparison.runs) > MOST_RUNS else ""
    caption = f"Rms error of each run in units of the noise: white is noise, red more, blue less, grey no data.{cut}"
    return Section("Map of conditions", (Picture("map", caption, png),))


def _more_runs(compared: Compared, drawn: Sequence[str]) -> Section | None:
    pictures = [
        Picture(f"runs_{k + 2}", _runs_caption(compared, output), runs_in_time(compared, output))
        for k, output in enumerate(drawn[1:])
    ]
    return Section("Further outputs in time", tuple(pictures)) if pictures else None


def _numbers(compared: Compared) -> Section:
    comparison = compared.comparison
    tables = [outputs_table(comparison), _groups_table("Run by run", "run", comparison.runs)]
    if len(comparison.conditions) < len(comparison.runs):
        tables.append(_groups_table("By condition, repeats together", "runs", comparison.conditions))
    note = (
        f"{comparison.n_samples} readings, worth {number(comparison.n_effective)} independent ones. Intervals: 95 %, "
        "bootstrap of whole runs, or of stretches of runs where there are fewer than eight."
    )
    return Section("Numbers", (), tuple(tables), note)


def outputs_table(comparison: Comparison) -> Table:
    """Errors per output in display units."""
    rows = []
    for name, error in comparison.outputs.items():
        words = shown(name)
        rows.append(
            [
                words.axis,
                _with_interval(error.rmse, error.rmse_interval, words.factor),
                number(error.noise_floor * words.factor),
                error.source,
                number(error.ratio_to_floor, 2),
                _with_interval(error.bias, error.bias_interval, words.factor),
                str(error.n),
                number(error.n_effective, 3),
            ]
        )
    head = [
        "output",
        "rms error",
        "noise floor",
        "floor from",
        "ratio",
        "mean error",
        "readings",
        "independent",
    ]
    return Table("Errors by output", head, rows)


def _worst_table(comparison: Comparison) -> Table:
    rows = [
        [
            place.condition,
            percent(place.share_of_error),
            percent(place.share_of_samples),
            shown(place.output).text(place.outputs[place.output].mean, 2)
            + f" in {shown(place.output).label}",
            number(place.z, 2),
            "yes" if place.significant else "no",
        ]
        for place in comparison.worst
    ]
    head = [
        "condition",
        "of the squared error",
        "of the readings",
        "mean error there",
        "z",
        "more than noise",
    ]
    note = (
        "Places that hold more of the error than of the readings. They overlap: the falling branch, fast rates and "
        "late times may be the same readings. z: mean error over what noise would give it."
    )
    found = any(place.significant for place in comparison.worst)
    return Table(
        "The worst places" if found else "The largest shares; none is more than noise",
        head,
        rows,
        note if rows else "No place holds more than its part of the error.",
    )


def _groups_table(title: str, head: str, groups: Sequence[GroupError]) -> Table:
    names = list(dict.fromkeys(name for group in groups for name in group.outputs))[:6]
    rows = []
    for group in groups[:ROWS]:
        row = [group.name, group.words]
        for name in names:
            values = group.outputs.get(name, {})
            row += [number(values.get(key, np.nan) * shown(name).factor, 3) for key in ("rmse", "bias")]
        rows.append([*row, number(group.rmse_over_floor, 2), percent(group.share_of_error), str(group.n)])
    columns = [f"{part} {shown(name).axis}" for name in names for part in ("rms", "mean")]
    cut = f"The first {ROWS} of {len(groups)}." if len(groups) > ROWS else ""
    return Table(
        title, [head, "condition", *columns, "in floors", "of the squared error", "readings"], rows, cut, 2
    )


def _with_interval(value: float, interval: tuple[float, float], factor: float) -> str:
    low, high = interval
    text = number(value * factor)
    return f"{text} ({number(low * factor)} to {number(high * factor)})" if np.isfinite(low) else text


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]
