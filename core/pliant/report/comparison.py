"""A comparison as a document: the model against a measurement, for terminal, page and JSON."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Literal

import numpy as np

from pliant.diagnosis.bands import Bands
from pliant.evidence.comparison import Comparison
from pliant.evidence.comparison_sentences import interpret
from pliant.evidence.error_bins import ErrorBin
from pliant.evidence.scores import GroupError, OutputError
from pliant.formatting import number, output_unit, whole_percent
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.report.answers import comparison_answers
from pliant.report.bookkeeping import mistakes_json, mistakes_warned, not_repeated
from pliant.report.chart import Chart
from pliant.report.comparison_charts import (
    MOST,
    MOST_RUNS,
    condition_map,
    loops_chart,
    places_chart,
    runs_chart,
)
from pliant.report.document import (
    Column,
    Document,
    Drawn,
    Picture,
    Section,
    Table,
    as_json,
    brief_table,
    capital,
    drawn,
    page_table,
    picture,
    section,
)
from pliant.report.evidence_view import Compared
from pliant.report.fitted import caveat
from pliant.report.posterior import bands_json, bands_words
from pliant.units import si_unit

OUTPUTS_DRAWN, OUTPUTS_OF_GROUPS = 2, 6
ROWS = 60  # rows of a page's table or picture
WORST_BRIEF = 5  # rows of the terminal's tables
Named = tuple[str, OutputError]


def yes(value: bool) -> str:
    """Return a boolean as a table cell."""
    return "yes" if value else "no"


def _unit(named: Named) -> Any:
    return output_unit(named[0])


def _with_interval(of: str) -> Callable[[Named], str]:
    def text(named: Named) -> str:
        factor = output_unit(named[0]).factor
        low, high = getattr(named[1], f"{of}_interval")
        found = number(getattr(named[1], of) * factor, 3)
        span = f" ({number(low * factor, 3)} to {number(high * factor, 3)})"
        return found + (span if np.isfinite(low) else "")

    return text


def _floor(named: Named) -> str:
    floor = named[1].noise_floor
    return output_unit(named[0]).text(floor, 3) if np.isfinite(floor) else "–"


def _mean_there(joined: str) -> Callable[[ErrorBin], str]:
    def text(place: ErrorBin) -> str:
        words = output_unit(place.output)
        return f"{words.text(place.outputs[place.output].mean, 2)}{joined} {words.label}"

    return text


def starred(z: float, star: bool) -> str:
    """Return a normal score, with a star if it exceeds chance."""
    return f"{number(z, 2)}{'*' if star else ' '}"


# Columns of a comparison for one output, read or counted: a row is the output's name and its errors.
SCORE_COLUMNS: tuple[Column[tuple[str, Any]], ...] = (
    Column(
        "1.rmse", head="rms error", brief="rms error", text=_with_interval("rmse"), brief_show=3, unit=_unit
    ),
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
    Column("1.unit"),
)
OUTPUT_COLUMNS: tuple[Column[Named], ...] = (
    Column(
        "0",
        "",
        "output",
        "output",
        show=lambda o: output_unit(o).axis,
        brief_show=lambda o: output_unit(o).label,
    ),
    *SCORE_COLUMNS,
    Column("1.n", head="readings", brief="readings"),
    Column("1.n_effective", head="independent", brief="effective", show=3, brief_show=lambda n: f"{n:.0f}"),
    Column("1.rmse_interval"),
    Column("1.bias_interval"),
    Column("1.noise.within", "noise_within"),
    Column("1.noise.between", "noise_between"),
)
PLACE_COLUMNS: tuple[Column[ErrorBin], ...] = (
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
    title: str,
    measurement: Measurement,
    predicted: Sequence[Mapping[str, Array]],
    comparison: Comparison,
    bands: Bands | None = None,
    remark: str = "",
) -> Document:
    """Return the document of `pliant compare`.

    Args:
        title: the study's name.
        measurement: the one compared with.
        predicted: outputs by run, as the comparison had them.
        comparison: its result.
        bands: of the model, if the study has a posterior of its effects.
        remark: the reason for missing bands although the study has such a block.
    """
    brief: list[Table | str] = [brief_table(OUTPUT_COLUMNS, list(comparison.outputs.items()))]
    if comparison.worst:
        stars = f"* more than noise, corrected for looking at {comparison.n_places} places"
        rows = comparison.worst[:WORST_BRIEF]
        brief.append(brief_table(PLACE_COLUMNS, rows, stars if comparison.significant else ""))
    if bands is not None and (
        held := bands_words(bands, measurement, "all runs", comparison.rmse_over_floor)
    ):
        brief.append(held)
    remarks = (*comparison.remarks, *([remark] if remark else []))
    return Document(
        kind="Pliant: model against measurement",
        title=title,
        sentence=interpret(comparison),
        data={
            **comparison_json(comparison),
            "band": None if bands is None else bands_json(bands, measurement),
        },
        brief=tuple(brief),
        answers=comparison_answers(comparison),
        warnings=(
            *mistakes_warned(comparison.bookkeeping),
            *map(caveat, not_repeated(remarks, measurement, comparison.bookkeeping)),
        ),
        draw=lambda: _drawn(Compared(measurement, predicted, comparison, bands)),
        footer=f"Measurement: {measurement.source or 'given in memory'}. Errors are measured − model",
    )


def comparison_json(comparison: Comparison) -> dict[str, Any]:
    """Return plain values by the keys of docs/compare.md; numbers SI, unknown values NaN."""
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
    outputs, runs, conditions = comparison.outputs.items(), comparison.runs, comparison.conditions
    return {
        "outputs": {name: as_json(OUTPUT_COLUMNS, (name, error)) for name, error in outputs},
        "rmse_over_floor": comparison.rmse_over_floor,
        "bookkeeping": mistakes_json(comparison.bookkeeping),
        "rmse_over_floor_interval": list(comparison.rmse_over_floor_interval),
        "interpretation": interpret(comparison),
        "judged": comparison.judged,
        "runs": [as_json(group_columns("run", runs), run) for run in runs],
        "conditions": [as_json(group_columns("condition", conditions), one) for one in conditions],
        "worst": [as_json(PLACE_COLUMNS, place) for place in comparison.worst],
        "covariates": [{"name": name, "importance": share} for name, share in comparison.depends_on.items()],
        "bins": bins,
        "n_places": comparison.n_places,
        "n_samples": comparison.n_samples,
        "n_effective": comparison.n_effective,
        "remarks": list(comparison.remarks),
    }


def group_columns(
    kind: Literal["run", "condition"], groups: Sequence[GroupError]
) -> tuple[Column[GroupError], ...]:
    """Return the columns of the errors of runs, or of conditions; the page shows the first outputs only."""
    names = list(dict.fromkeys(name for group in groups for name in group.outputs))[:OUTPUTS_OF_GROUPS]

    def outputs(group: GroupError) -> dict[str, Any]:
        return {name: {**values, "unit": si_unit(name)} for name, values in group.outputs.items()}

    def error(name: str, part: str, key: str) -> Column[GroupError]:
        value: Callable[[GroupError], float] = lambda g: g.outputs.get(name, {}).get(key, np.nan)  # noqa: E731
        return Column(
            value, head=f"{part} {output_unit(name).axis}", show=3, unit=lambda _: output_unit(name)
        )

    return (
        Column("name", kind, "run" if kind == "run" else "runs"),
        Column("words", head="condition"),
        Column("runs", None if kind == "condition" else ""),
        Column(outputs, "outputs"),
        *(error(name, *part) for name in names for part in (("rms", "rmse"), ("mean", "bias"))),
        Column("rmse_over_floor", head="in floors", show=2),
        Column("share_of_error", head="of the squared error", show=whole_percent),
        Column("n", "n_samples", "readings"),
    )


def _drawn(compared: Compared) -> Drawn:
    comparison, shown = compared.comparison, compared.outputs_by_error()[:OUTPUTS_DRAWN]

    def runs(output: str, name: str) -> Picture:
        _, whole = compared.worst_runs(MOST)
        which = "all runs" if whole else "one run of each condition, the worst first"
        words, floor = output_unit(output), comparison.outputs[output].noise_floor
        band = f"; the band is ± 2 noise floors (one is {words.text(floor, 2)})" if np.isfinite(floor) else ""
        chance = "one time in twenty"
        if compared.bands is not None and output in compared.bands.half_width():
            band = (
                f"; the {whole_percent(compared.bands.level)} band holds the doubt about the fitted parameters and the "
                "laws, and the noise"
            )
            chance = f"with a probability of {whole_percent(1 - compared.bands.level)}"
        caption = (
            f"{capital(words.label)}, {which}: measured in black, model in blue{band}. Below each run its error, "
            f"measured − model; what leaves the band is filled. A model that lacks nothing leaves it {chance}, "
            "anywhere."
        )
        return Picture(name, caption, runs_chart(compared, output))

    def draw_outputs(
        name: str,
        caption: str,
        chart: Callable[[Compared, str], Chart | None],
    ) -> list[Picture]:
        """Return one picture of each output; empty where nothing varies."""
        labels = [output_unit(output).label for output in shown]
        made = [
            picture(
                f"{name}_{k}",
                caption.format(label=label, capital=capital(label)),
                chart(compared, output),
            )
            for k, (output, label) in enumerate(zip(shown, labels, strict=True), start=1)
        ]
        return [one for one in made if one is not None]

    where = draw_outputs(
        "where",
        "Error in {label} against everything that varied. Dots: mean error in a bin with the 95 % interval that noise "
        "of this colour gives it; filled: more than noise, corrected for looking at "
        f"{comparison.n_places} places. “Tells 40 %”: this circumstance alone predicts 40 % of the error's variance in "
        "runs that it was not fitted to.",
        places_chart,
    )
    loops = draw_outputs(
        "loops",
        "{capital} over what drives it; below, the error over the same, coloured by what the actuation does. A gap "
        "between rising and falling is hysteresis that the model lacks or has too much; a common slope a wrong gain "
        "or stiffness; a common shift an offset; a vertical stroke in a hold a drift.",
        loops_chart,
    )
    cut = f" The {MOST_RUNS} worst runs." if len(comparison.runs) > MOST_RUNS else ""
    caption = f"Rms error of each run in units of the noise: white is noise, red more, blue less, grey no data.{cut}"
    title = "Map of conditions"
    return drawn(
        runs(shown[0], "runs"),
        section("Where the error is", *where, _places_table(comparison), open=True) if where else None,
        section("Loops", *loops),
        section(title, picture("map", caption, condition_map(compared))),
        section(
            "Further outputs in time", *(runs(output, f"runs_{k}") for k, output in enumerate(shown[1:], 2))
        ),
        _numbers(comparison),
    )


def _places_table(comparison: Comparison) -> Table:
    found = any(place.more_than_noise for place in comparison.worst)
    note = (
        "Places that hold more of the error than of the readings. They overlap: the falling branch, fast rates and "
        "late times may be the same readings. z: mean error over what noise would give it."
    )
    return page_table(
        "The worst places" if found else "The largest shares; none is more than noise",
        PLACE_COLUMNS,
        comparison.worst,
        note if comparison.worst else "No place holds more than its part of the error.",
    )


def _numbers(comparison: Comparison) -> Section | None:
    def groups(title: str, kind: Literal["run", "condition"], of: Sequence[GroupError]) -> Table:
        cut = f"The first {ROWS} of {len(of)}." if len(of) > ROWS else ""
        return page_table(title, group_columns(kind, of), of[:ROWS], cut, 2)

    repeated = len(comparison.conditions) < len(comparison.runs)
    return section(
        "Numbers",
        page_table("Errors by output", OUTPUT_COLUMNS, list(comparison.outputs.items())),
        groups("Run by run", "run", comparison.runs),
        groups("By condition, repeats together", "condition", comparison.conditions) if repeated else None,
        note=f"{comparison.n_samples} readings, effective sample size {number(comparison.n_effective, 3)}. Intervals: "
        "95 %, bootstrap of whole runs, or of stretches of runs where there are fewer than eight.",
    )
