"""`pliant compare`: the model against measurements."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.table import Table

from pliant.cli.counts import compare_counts_verb
from pliant.cli.options import DEFAULT_STORE, JsonFile, Overrides, Quiet, StoreFolder, StudyFile
from pliant.cli.session import Session, check_writable, session
from pliant.errors import UserError
from pliant.evidence.comparison import Comparison
from pliant.evidence.comparison import compare as compare_with
from pliant.evidence.comparison_json import comparison_json
from pliant.evidence.counted_study import is_counted
from pliant.evidence.interpretation import interpret
from pliant.evidence.measured import measurement_of_study
from pliant.evidence.prediction import Predictor
from pliant.evidence.words import listed, number, percent, shown
from pliant.report.stage import write_page

DataFile = Annotated[
    list[Path] | None,
    typer.Option(
        "--data",
        metavar="CSV",
        help="The measurement, instead of the one that the study names; several are read as one, in their order.",
    ),
]
ReportFolder = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder of the report; runs/<name>-compare by default."),
]
Workers = Annotated[
    int,
    typer.Option(
        "--workers", metavar="N", help="Processes that simulate the conditions of a file of counts."
    ),
]
WORST_SHOWN = 5


def compare(
    study: StudyFile,
    overrides: Overrides = None,
    data: DataFile = None,
    out: ReportFolder = None,
    workers: Workers = 1,
    store: StoreFolder = DEFAULT_STORE,
    json: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """Model against measurements: errors, noise floor, where it fails."""
    with session("compare", json, quiet) as here:
        loaded = here.study(study, overrides)
        folder = out or Path("runs") / f"{loaded.name}-compare"
        bench = here.bench(store)
        alone = one_file(data)
        if is_counted(loaded, alone):
            refuse_more_counts(data)
            compare_counts_verb(here, bench, loaded, alone, folder, workers)
            return
        measurement = measurement_of_study(bench, loaded, data)
        predictor = Predictor.of_study(bench, loaded, measurement)
        check_writable(folder)
        predicted = predictor.predict()
        comparison = compare_with(measurement, predicted)
        here.result.update(
            {
                "study": loaded.name,
                "data": measurement.source,
                "data_sha256": measurement.sha256,
                **comparison_json(comparison),
                "out": str(folder),
            }
        )
        _say(here, comparison)
        from pliant.report.comparison import comparison_page  # matplotlib takes a second to import

        made = comparison_page(loaded.name, measurement, predicted, comparison)
        page = write_page(folder, made.html, made.pictures)
        here.result["report"] = str(page)
        here.say(f"report   {page}")


def one_file(data: list[Path] | None) -> Path | None:
    """The first of `--data`, which alone says what kind of file it is."""
    return data[0] if data else None


def refuse_more_counts(data: list[Path] | None) -> None:
    """Raise `UserError` for files beside a file of counts, which would not be read."""
    if data and len(data) > 1:
        raise UserError(
            f"{data[0]} is a file of counts, and {listed([str(file) for file in data[1:]])} would not be read; counts "
            "come in one file: put the rows together, or give one --data."
        )


def _say(here: Session, comparison: Comparison) -> None:
    here.say(_outputs(comparison))
    if comparison.worst:
        here.say(_worst(comparison))
        if comparison.significant:
            here.say(f"* more than noise, corrected for looking at {comparison.n_places} places")
    for remark in comparison.remarks:
        here.say(f"note: {remark}")
    here.say(interpret(comparison))


def _outputs(comparison: Comparison) -> Table:
    table = _table("output", "rms error", "floor", "from", "ratio", "mean", "readings", "worth")
    for name, error in comparison.outputs.items():
        words = shown(name)
        table.add_row(
            words.label,
            words.text(error.rmse),
            words.text(error.noise_floor) if np.isfinite(error.noise_floor) else "–",
            {"high-frequency residual": "neighbours"}.get(error.source, error.source),
            number(error.ratio_to_floor, 2),
            words.text(error.bias),
            str(error.n),
            f"{error.n_effective:.0f}",
        )
    return table


def _worst(comparison: Comparison) -> Table:
    table = _table("worst places", "of error", "of data", "mean", "z")
    for place in comparison.worst[:WORST_SHOWN]:
        words = shown(place.output)
        mean = words.text(place.outputs[place.output].mean, 2)
        table.add_row(
            place.condition,
            percent(place.share_of_error),
            percent(place.share_of_samples),
            mean if len(comparison.outputs) == 1 else f"{mean} {words.label}",
            f"{number(place.z, 2)}{'*' if place.significant else ' '}",
        )
    return table


def _table(first: str, *others: str) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column(first, no_wrap=True, overflow="ellipsis")
    for other in others:
        table.add_column(other, justify="right", no_wrap=True, min_width=max(len(other), 6))
    return table
