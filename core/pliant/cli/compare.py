"""`pliant compare`: the model against measurements."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pliant.cli.counts import compare_counts_verb
from pliant.cli.options import DEFAULT_STORE, JsonFile, Overrides, Quiet, StoreFolder, StudyFile
from pliant.cli.session import check_writable, session
from pliant.errors import UserError
from pliant.evidence.comparison import compare as compare_with
from pliant.evidence.counts import is_counted
from pliant.evidence.prediction import Predictor, measurement_of_study
from pliant.formatting import listed
from pliant.report.comparison import comparison_document

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
        here.result.update(study=loaded.name, data=measurement.source, data_sha256=measurement.sha256)
        here.show(comparison_document(loaded.name, measurement, predicted, comparison), folder)


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
