"""A comparison as a document: the model against a measurement, for terminal, page and JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from pliant.evidence.comparison import Comparison, interpret
from pliant.evidence.places import Place
from pliant.evidence.scores import GroupError, OutputError
from pliant.formatting import number, unit_of, whole_percent
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.report.comparison_view import Compared
from pliant.report.document import (
    Column,
    Document,
    Drawn,
    Picture,
    Section,
    Table,
    Warned,
    as_json,
    brief_table,
    capital,
    page_table,
)
from pliant.units import si_unit

OUTPUTS_DRAWN = 2
ROWS = 60  # of a page's table
WORST_BRIEF = 5  # of the terminal's
Named = tuple[str, OutputError]

OUTPUT_COLUMNS: tuple[Column[Named], ...] = (
    Column(
        lambda o: o[0],
        head="output",
        brief="output",
        text=lambda o: unit_of(o[0]).axis,
        brief_text=lambda o: unit_of(o[0]).label,
    ),
    Column(
        lambda o: o[1].rmse,
        "rmse",
        "rms error",
        "rms error",
        lambda o: _with_interval(o, "rmse"),
        lambda o: unit_of(o[0]).text(o[1].rmse, 3),
    ),
    Column(lambda o: list(o[1].rmse_interval), "rmse_interval"),
    Column(lambda o: o[1].unit, "unit"),
    Column(
        lambda o: o[1].noise_floor,
        "noise_floor",
        "noise floor",
        "floor",
        lambda o: number(o[1].noise_floor * unit_of(o[0]).factor, 3),
        lambda o: _floor(o),
    ),
    Column(
        lambda o: o[1].source,
        "floor_source",
        "floor from",
        "from",
        brief_text=lambda o: {"high-frequency residual": "neighbours"}.get(o[1].source, o[1].source),
    ),
    Column(
        lambda o: o[1].ratio_to_floor,
        "ratio_to_floor",
        "ratio",
        "ratio",
        lambda o: number(o[1].ratio_to_floor, 2),
    ),
    Column(
        lambda o: o[1].bias,
        "bias",
        "mean error",
        "mean",
        lambda o: _with_interval(o, "bias"),
        lambda o: unit_of(o[0]).text(o[1].bias, 3),
    ),
    Column(lambda o: list(o[1].bias_interval), "bias_interval"),
    Column(lambda o: o[1].noise.within, "noise_within"),
    Column(lambda o: o[1].noise.between, "noise_between"),
    Column(lambda o: o[1].n, "n", "readings", "readings"),
    Column(
        lambda o: o[1].n_effective,
        "n_effective",
        "independent",
        "worth",
        lambda o: number(o[1].n_effective, 3),
        lambda o: f"{o[1].n_effective:.0f}",
    ),
)
PLACE_COLUMNS: tuple[Column[Place], ...] = (
    Column(lambda p: p.condition, "condition", "condition", "worst places"),
    Column(lambda p: p.covariate, "covariate"),
    Column(
        lambda p: p.share_of_error,
        "share_of_error",
        "of the squared error",
        "of error",
        lambda p: whole_percent(p.share_of_error),
    ),
    Column(
        lambda p: p.share_of_samples,
        "share_of_samples",
        "of the readings",
        "of data",
        lambda p: whole_percent(p.share_of_samples),
    ),
    Column(
        lambda p: p.outputs[p.output].mean,
        "",
        "mean error there",
        "mean",
        lambda p: _mean_there(p, " in"),
        lambda p: _mean_there(p, ""),
    ),
    Column(
        lambda p: p.z,
        "z",
        "z",
        "z",
        lambda p: number(p.z, 2),
        lambda p: f"{number(p.z, 2)}{'*' if p.significant else ' '}",
    ),
    Column(lambda p: p.output, "output"),
    Column(
        lambda p: p.significant,
        "significant",
        "more than noise",
        text=lambda p: "yes" if p.significant else "no",
    ),
    Column(lambda p: p.rms_over_floor, "rmse_over_floor"),
    Column(lambda p: p.centre, "centre"),
)


def comparison_document(
    title: str, measurement: Measurement, predicted: Sequence[Mapping[str, Array]], comparison: Comparison
) -> Document:
    """The document of `pliant compare`.

    Args:
        title: the study's name.
        measurement: what was compared with.
        predicted: outputs by run, as the comparison had them.
        comparison: what came of it.
    """
    return Document(
        kind="Pliant: model against measurement",
        title=title,
        sentence=interpret(comparison),
        data=comparison_json(comparison),
        brief=_brief(comparison),
        warnings=tuple(Warned(remark) for remark in comparison.remarks),
        draw=lambda: _drawn(Compared(measurement, predicted, comparison)),
        footer=f"Measurement: {measurement.source or 'given in memory'}. Errors are measured − model",
    )


def comparison_json(comparison: Comparison) -> dict[str, Any]:
    """Plain values by the keys of docs/compare.md; numbers SI, what is not known NaN."""
    return {
        "outputs": {
            name: as_json(OUTPUT_COLUMNS, (name, error)) for name, error in comparison.outputs.items()
        },
        "rmse_over_floor": comparison.rmse_over_floor,
        "rmse_over_floor_interval": list(comparison.rmse_over_floor_interval),
        "interpretation": interpret(comparison),
        "judged": comparison.judged,
        "runs": [_group_json(run, "run") for run in comparison.runs],
        "conditions": [_group_json(condition, "condition") for condition in comparison.conditions],
        "worst": [as_json(PLACE_COLUMNS, place) for place in comparison.worst],
        "covariates": [{"name": name, "importance": share} for name, share in comparison.depends_on.items()],
        "bins": [
            {**as_json(PLACE_COLUMNS, place), "outputs": _outputs_there(place)} for place in comparison.places
        ],
        "n_places": comparison.n_places,
        "n_samples": comparison.n_samples,
        "n_effective": comparison.n_effective,
        "remarks": list(comparison.remarks),
    }


def _brief(comparison: Comparison) -> tuple[Table | str, ...]:
    blocks: list[Table | str] = [brief_table(OUTPUT_COLUMNS, list(comparison.outputs.items()))]
    if comparison.worst:
        stars = f"* more than noise, corrected for looking at {comparison.n_places} places"
        rows = comparison.worst[:WORST_BRIEF]
        blocks.append(brief_table(PLACE_COLUMNS, rows, stars if comparison.significant else ""))
    return tuple(blocks)


def _drawn(compared: Compared) -> Drawn:
    drawn = compared.outputs_by_error()[:OUTPUTS_DRAWN]
    made = (
        _where(compared, drawn),
        _loops(compared, drawn),
        _map(compared),
        _more_runs(compared, drawn),
        _numbers(compared),
    )
    return Drawn(_runs(compared, drawn[0], "runs"), tuple(section for section in made if section is not None))


def _runs(compared: Compared, output: str, name: str) -> Picture:
    from pliant.report.figures.runs_in_time import MOST, runs_in_time

    return Picture(name, _runs_caption(compared, output, MOST), runs_in_time(compared, output))


def _runs_caption(compared: Compared, output: str, most: int) -> str:
    _, whole = compared.worst_runs(most)
    which = "all runs" if whole else "one run of each condition, the worst first"
    floor = compared.comparison.outputs[output].noise_floor
    band = (
        f"; the band is ± 2 noise floors (one is {unit_of(output).text(floor, 2)})"
        if np.isfinite(floor)
        else ""
    )
    return (
        f"{capital(unit_of(output).label)}, {which}: measured in black, model in blue{band}. Below each run its error, "
        "measured − model; what leaves the band is filled. A model that lacks nothing leaves it one time in twenty, "
        "anywhere."
    )


def _where(compared: Compared, drawn: Sequence[str]) -> Section | None:
    from pliant.report.figures.residual_places import residual_places

    pictures = []
    for k, output in enumerate(drawn):
        png = residual_places(compared, output)
        if png is None:
            return None
        caption = (
            f"Error in {unit_of(output).label} against everything that varied. Dots: mean error in a bin with the 95 % "
            "interval that noise of this colour gives it; filled: more than noise, corrected for looking at "
            f"{compared.comparison.n_places} places. “Tells 40 %”: this circumstance alone predicts 40 % of the "
            "error's variance in runs that it was not fitted to."
        )
        pictures.append(Picture(f"where_{k + 1}", caption, png))
    return Section("Where the error is", tuple(pictures), (_worst_table(compared.comparison),))


def _loops(compared: Compared, drawn: Sequence[str]) -> Section | None:
    from pliant.report.figures.loops import loops

    pictures = []
    for k, output in enumerate(drawn):
        png = loops(compared, output)
        if png is None:
            return None
        caption = (
            f"{capital(unit_of(output).label)} over what drives it; below, the error over the same, coloured by what "
            "the actuation does. A gap between rising and falling is hysteresis that the model lacks or has too much; "
            "a common slope a wrong gain or stiffness; a common shift an offset; a vertical stroke in a hold a drift."
        )
        pictures.append(Picture(f"loops_{k + 1}", caption, png))
    return Section("Loops", tuple(pictures))


def _map(compared: Compared) -> Section | None:
    from pliant.report.figures.condition_map import MOST_RUNS, condition_map

    png = condition_map(compared)
    if png is None:
        return None
    cut = f" The {MOST_RUNS} worst runs." if len(compared.comparison.runs) > MOST_RUNS else ""
    caption = f"Rms error of each run in units of the noise: white is noise, red more, blue less, grey no data.{cut}"
    return Section("Map of conditions", (Picture("map", caption, png),))


def _more_runs(compared: Compared, drawn: Sequence[str]) -> Section | None:
    pictures = [_runs(compared, output, f"runs_{k + 2}") for k, output in enumerate(drawn[1:])]
    return Section("Further outputs in time", tuple(pictures)) if pictures else None


def _numbers(compared: Compared) -> Section:
    comparison = compared.comparison
    tables = [outputs_table(comparison), _groups_table("Run by run", "run", comparison.runs)]
    if len(comparison.conditions) < len(comparison.runs):
        tables.append(_groups_table("By condition, repeats together", "runs", comparison.conditions))
    note = (
        f"{comparison.n_samples} readings, worth {number(comparison.n_effective, 3)} independent ones. Intervals: "
        "95 %, bootstrap of whole runs, or of stretches of runs where there are fewer than eight."
    )
    return Section("Numbers", (), tuple(tables), note)


def outputs_table(comparison: Comparison) -> Table:
    """Errors per output in display units."""
    return page_table("Errors by output", OUTPUT_COLUMNS, list(comparison.outputs.items()))


def _worst_table(comparison: Comparison) -> Table:
    note = (
        "Places that hold more of the error than of the readings. They overlap: the falling branch, fast rates and "
        "late times may be the same readings. z: mean error over what noise would give it."
    )
    found = any(place.significant for place in comparison.worst)
    return page_table(
        "The worst places" if found else "The largest shares; none is more than noise",
        PLACE_COLUMNS,
        comparison.worst,
        note if comparison.worst else "No place holds more than its part of the error.",
    )


def _groups_table(title: str, head: str, groups: Sequence[GroupError]) -> Table:
    names = list(dict.fromkeys(name for group in groups for name in group.outputs))[:6]
    rows = []
    for group in groups[:ROWS]:
        row = [group.name, group.words]
        for name in names:
            values = group.outputs.get(name, {})
            row += [number(values.get(key, np.nan) * unit_of(name).factor, 3) for key in ("rmse", "bias")]
        rows.append(
            [*row, number(group.rmse_over_floor, 2), whole_percent(group.share_of_error), str(group.n)]
        )
    columns = [f"{part} {unit_of(name).axis}" for name in names for part in ("rms", "mean")]
    cut = f"The first {ROWS} of {len(groups)}." if len(groups) > ROWS else ""
    return Table(
        title, [head, "condition", *columns, "in floors", "of the squared error", "readings"], rows, cut, 2
    )


def _group_json(group: GroupError, key: str) -> dict[str, Any]:
    return {
        key: group.name,
        "words": group.words,
        **({"runs": list(group.runs)} if key == "condition" else {}),
        "outputs": {name: {**values, "unit": si_unit(name)} for name, values in group.outputs.items()},
        "rmse_over_floor": group.rmse_over_floor,
        "share_of_error": group.share_of_error,
        "n_samples": group.n,
    }


def _outputs_there(place: Place) -> dict[str, Any]:
    return {
        name: {**asdict(entry), "interval": list(entry.interval), "unit": si_unit(name)}
        for name, entry in place.outputs.items()
    }


def _mean_there(place: Place, joined: str) -> str:
    words = unit_of(place.output)
    return f"{words.text(place.outputs[place.output].mean, 2)}{joined} {words.label}"


def _floor(named: Named) -> str:
    name, error = named
    return unit_of(name).text(error.noise_floor, 3) if np.isfinite(error.noise_floor) else "–"


def _with_interval(named: Named, of: str) -> str:
    name, error = named
    factor = unit_of(name).factor
    low, high = getattr(error, f"{of}_interval")
    text = number(getattr(error, of) * factor, 3)
    return f"{text} ({number(low * factor, 3)} to {number(high * factor, 3)})" if np.isfinite(low) else text
