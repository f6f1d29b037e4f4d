"""A comparison as a document: the model against a measurement, for terminal, page and JSON."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from pliant.evidence.comparison import Comparison, interpret
from pliant.evidence.places import Place
from pliant.evidence.scores import GroupError, OutputError
from pliant.formatting import number, unit_of, whole_percent
from pliant.records.design import Array
from pliant.records.measurement import Measurement
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
from pliant.report.evidence_view import Compared
from pliant.units import si_unit

OUTPUTS_DRAWN = 2
ROWS = 60  # of a page's table or picture
WORST_BRIEF = 5  # of the terminal's tables
Named = tuple[str, OutputError]


def yes(value: bool) -> str:
    """A switch in a table."""
    return "yes" if value else "no"


def _unit(named: Named) -> Any:
    return unit_of(named[0])


def _with_interval(of: str) -> Callable[[Named], str]:
    def text(named: Named) -> str:
        factor = unit_of(named[0]).factor
        low, high = getattr(named[1], f"{of}_interval")
        found = number(getattr(named[1], of) * factor, 3)
        span = f" ({number(low * factor, 3)} to {number(high * factor, 3)})"
        return found + (span if np.isfinite(low) else "")

    return text


def _floor(named: Named) -> str:
    floor = named[1].noise_floor
    return unit_of(named[0]).text(floor, 3) if np.isfinite(floor) else "–"


def _mean_there(joined: str) -> Callable[[Place], str]:
    def text(place: Place) -> str:
        words = unit_of(place.output)
        return f"{words.text(place.outputs[place.output].mean, 2)}{joined} {words.label}"

    return text


def starred(z: float, star: bool) -> str:
    """A normal score, with a star where it is more than chance."""
    return f"{number(z, 2)}{'*' if star else ' '}"


OUTPUT_COLUMNS: tuple[Column[Named], ...] = (
    Column(
        "0", "", "output", "output", show=lambda o: unit_of(o).axis, brief_show=lambda o: unit_of(o).label
    ),
    Column(
        "1.rmse", head="rms error", brief="rms error", text=_with_interval("rmse"), brief_show=3, unit=_unit
    ),
    Column("1.rmse_interval"),
    Column("1.unit"),
    Column("1.noise_floor", head="noise floor", brief="floor", brief_text=_floor, show=3, unit=_unit),
    Column(
        "1.source",
        "floor_source",
        "floor from",
        "from",
        brief_show=lambda source: "neighbours" if source == "high-frequency residual" else source,
    ),
    Column("1.ratio_to_floor", head="ratio", brief="ratio", show=2),
    Column("1.bias", head="mean error", brief="mean", text=_with_interval("bias"), brief_show=3, unit=_unit),
    Column("1.bias_interval"),
    Column("1.noise.within", "noise_within"),
    Column("1.noise.between", "noise_between"),
    Column("1.n", head="readings", brief="readings"),
    Column("1.n_effective", head="independent", brief="worth", show=3, brief_show=lambda n: f"{n:.0f}"),
)
PLACE_COLUMNS: tuple[Column[Place], ...] = (
    Column("condition", head="condition", brief="worst places"),
    Column("covariate"),
    Column("share_of_error", head="of the squared error", brief="of error", show=whole_percent),
    Column("share_of_samples", head="of the readings", brief="of data", show=whole_percent),
    Column("output", "", "mean error there", "mean", _mean_there(" in"), _mean_there("")),
    Column("z", head="z", brief="z", show=2, brief_text=lambda p: starred(p.z, p.significant)),
    Column("output"),
    Column("significant", head="more than noise", show=yes),
    Column("rms_over_floor", "rmse_over_floor"),
    Column("centre"),
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
    brief = [brief_table(OUTPUT_COLUMNS, list(comparison.outputs.items()))]
    if comparison.worst:
        stars = f"* more than noise, corrected for looking at {comparison.n_places} places"
        rows = comparison.worst[:WORST_BRIEF]
        brief.append(brief_table(PLACE_COLUMNS, rows, stars if comparison.significant else ""))
    return Document(
        kind="Pliant: model against measurement",
        title=title,
        sentence=interpret(comparison),
        data=comparison_json(comparison),
        brief=tuple(brief),
        warnings=tuple(map(Warned, comparison.remarks)),
        draw=lambda: _drawn(Compared(measurement, predicted, comparison)),
        footer=f"Measurement: {measurement.source or 'given in memory'}. Errors are measured − model",
    )


def comparison_json(comparison: Comparison) -> dict[str, Any]:
    """Plain values by the keys of docs/compare.md; numbers SI, what is not known NaN."""
    bins = [
        {
            **as_json(PLACE_COLUMNS, place),
            "outputs": {
                name: {**asdict(entry), "interval": list(entry.interval), "unit": si_unit(name)}
                for name, entry in place.outputs.items()
            },
        }
        for place in comparison.places
    ]
    outputs = comparison.outputs.items()
    return {
        "outputs": {name: as_json(OUTPUT_COLUMNS, (name, error)) for name, error in outputs},
        "rmse_over_floor": comparison.rmse_over_floor,
        "rmse_over_floor_interval": list(comparison.rmse_over_floor_interval),
        "interpretation": interpret(comparison),
        "judged": comparison.judged,
        "runs": [_group_json(run, "run") for run in comparison.runs],
        "conditions": [_group_json(condition, "condition") for condition in comparison.conditions],
        "worst": [as_json(PLACE_COLUMNS, place) for place in comparison.worst],
        "covariates": [{"name": name, "importance": share} for name, share in comparison.depends_on.items()],
        "bins": bins,
        "n_places": comparison.n_places,
        "n_samples": comparison.n_samples,
        "n_effective": comparison.n_effective,
        "remarks": list(comparison.remarks),
    }


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


def _drawn(compared: Compared) -> Drawn:
    drawn = compared.outputs_by_error()[:OUTPUTS_DRAWN]
    more = tuple(_runs(compared, output, f"runs_{k}") for k, output in enumerate(drawn[1:], start=2))
    made = (
        _where(compared, drawn),
        _loops(compared, drawn),
        _map(compared),
        Section("Further outputs in time", more) if more else None,
        _numbers(compared.comparison),
    )
    return Drawn(_runs(compared, drawn[0], "runs"), tuple(section for section in made if section is not None))


def _runs(compared: Compared, output: str, name: str) -> Picture:
    from pliant.report.figures.comparison import MOST, runs_in_time

    _, whole = compared.worst_runs(MOST)
    which = "all runs" if whole else "one run of each condition, the worst first"
    words, floor = unit_of(output), compared.comparison.outputs[output].noise_floor
    band = f"; the band is ± 2 noise floors (one is {words.text(floor, 2)})" if np.isfinite(floor) else ""
    caption = (
        f"{capital(words.label)}, {which}: measured in black, model in blue{band}. Below each run its error, "
        "measured − model; what leaves the band is filled. A model that lacks nothing leaves it one time in twenty, "
        "anywhere."
    )
    return Picture(name, caption, runs_in_time(compared, output))


def _where(compared: Compared, drawn: Sequence[str]) -> Section | None:
    from pliant.report.figures.comparison import residual_places

    comparison = compared.comparison
    caption = (
        "Error in {label} against everything that varied. Dots: mean error in a bin with the 95 % interval that noise "
        "of this colour gives it; filled: more than noise, corrected for looking at "
        f"{comparison.n_places} places. “Tells 40 %”: this circumstance alone predicts 40 % of the error's variance in "
        "runs that it was not fitted to."
    )
    pictures = _pictures("where", caption, residual_places, compared, drawn)
    found = any(place.significant for place in comparison.worst)
    note = (
        "Places that hold more of the error than of the readings. They overlap: the falling branch, fast rates and "
        "late times may be the same readings. z: mean error over what noise would give it."
    )
    table = page_table(
        "The worst places" if found else "The largest shares; none is more than noise",
        PLACE_COLUMNS,
        comparison.worst,
        note if comparison.worst else "No place holds more than its part of the error.",
    )
    return Section("Where the error is", pictures, (table,)) if pictures else None


def _loops(compared: Compared, drawn: Sequence[str]) -> Section | None:
    from pliant.report.figures.comparison import loops

    caption = (
        "{capital} over what drives it; below, the error over the same, coloured by what the actuation does. A gap "
        "between rising and falling is hysteresis that the model lacks or has too much; a common slope a wrong gain "
        "or stiffness; a common shift an offset; a vertical stroke in a hold a drift."
    )
    pictures = _pictures("loops", caption, loops, compared, drawn)
    return Section("Loops", pictures) if pictures else None


def _pictures(
    name: str, caption: str, draw: Callable[[Compared, str], Any], compared: Compared, drawn: Sequence[str]
) -> tuple[Picture, ...]:
    """One picture of each output; none where nothing varies."""
    made = []
    for k, output in enumerate(drawn, start=1):
        png, label = draw(compared, output), unit_of(output).label
        if png is None:
            return ()
        made.append(Picture(f"{name}_{k}", caption.format(label=label, capital=capital(label)), png))
    return tuple(made)


def _map(compared: Compared) -> Section | None:
    from pliant.report.figures.comparison import MOST_RUNS, condition_map

    png = condition_map(compared)
    if png is None:
        return None
    cut = f" The {MOST_RUNS} worst runs." if len(compared.comparison.runs) > MOST_RUNS else ""
    caption = f"Rms error of each run in units of the noise: white is noise, red more, blue less, grey no data.{cut}"
    return Section("Map of conditions", (Picture("map", caption, png),))


def _numbers(comparison: Comparison) -> Section:
    outputs = page_table("Errors by output", OUTPUT_COLUMNS, list(comparison.outputs.items()))
    tables = [outputs, _groups_table("Run by run", "run", comparison.runs)]
    if len(comparison.conditions) < len(comparison.runs):
        tables.append(_groups_table("By condition, repeats together", "runs", comparison.conditions))
    note = (
        f"{comparison.n_samples} readings, worth {number(comparison.n_effective, 3)} independent ones. Intervals: "
        "95 %, bootstrap of whole runs, or of stretches of runs where there are fewer than eight."
    )
    return Section("Numbers", (), tuple(tables), note)


def _groups_table(title: str, head: str, groups: Sequence[GroupError]) -> Table:
    names = list(dict.fromkeys(name for group in groups for name in group.outputs))[:6]

    def error(name: str, part: str, key: str) -> Column[GroupError]:
        factor = unit_of(name).factor
        cell: Callable[[GroupError], float] = lambda g: g.outputs.get(name, {}).get(key, np.nan) * factor  # noqa: E731
        return Column(cell, head=f"{part} {unit_of(name).axis}", show=3)

    columns: list[Column[GroupError]] = [Column("name", head=head), Column("words", head="condition")]
    columns += [error(name, *part) for name in names for part in (("rms", "rmse"), ("mean", "bias"))]
    columns.append(Column("rmse_over_floor", head="in floors", show=2))
    columns.append(Column("share_of_error", head="of the squared error", show=whole_percent))
    columns.append(Column("n", head="readings"))
    cut = f"The first {ROWS} of {len(groups)}." if len(groups) > ROWS else ""
    return page_table(title, columns, groups[:ROWS], cut, 2)
