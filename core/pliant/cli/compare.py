"""`pliant compare`: the model against measurements or counts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from pliant.cli.options import Overrides, StudyFile, verb
from pliant.cli.session import Session, check_writable
from pliant.config.study import Study
from pliant.diagnosis.counts_candidates import effect_parameters, task_parameters
from pliant.diagnosis.counts_diagnosis import count_evidence, judge_counts
from pliant.errors import UserError
from pliant.evidence.comparison import compare as compare_with
from pliant.evidence.counts import CountedStudy, compare_counted, counted_study, is_counted
from pliant.evidence.measured import measurement_of_study
from pliant.evidence.prediction import Predictor
from pliant.execution.executors import checked_workers
from pliant.formatting import listed
from pliant.pipeline.workbench import Workbench
from pliant.report.comparison import comparison_document
from pliant.report.counts import counts_document
from pliant.report.counts_diagnosis import counts_diagnosis_document

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


@verb()
def compare(
    here: Session,
    study: StudyFile,
    overrides: Overrides = None,
    data: DataFile = None,
    out: ReportFolder = None,
    workers: Workers = 1,
) -> None:
    """Model against measurements: errors, noise floor, where it fails."""
    loaded = here.study(study, overrides)
    folder = out or Path("runs") / f"{loaded.name}-compare"
    bench = here.bench()
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


def compare_counts_verb(
    here: Session, bench: Workbench, study: Study, data: Path | None, folder: Path, workers: int
) -> None:
    """Every condition simulated and compared."""
    counted = _counted(here, study, data, workers)
    check_writable(folder)
    found = compare_counted(bench, counted, workers)
    here.show(counts_document(study.name, counted.counts, found), folder)


def diagnose_counts_verb(
    here: Session,
    bench: Workbench,
    study: Study,
    data: Path | None,
    kinds: Sequence[str] | None,
    folder: Path,
    workers: int,
) -> None:
    """The effects and the study's plausible ranges scanned and weighed."""
    counted = _counted(here, study, data, workers)
    ranges = study.measurements.plausible if study.measurements else ()
    parameters = [*effect_parameters(bench.registry, kinds), *task_parameters(counted, ranges)]
    if not parameters:
        raise UserError(
            "nothing to try: no effect has a strength, and 'measurements.plausible' names no number."
        )
    check_writable(folder)
    found = count_evidence(bench, counted, [(parameter,) for parameter in parameters], workers)
    judged = judge_counts(found)
    here.show(counts_diagnosis_document(study.name, counted.counts, found, judged, bench.registry), folder)


def _counted(here: Session, study: Study, data: Path | None, workers: int) -> CountedStudy:
    checked_workers(workers)
    counted = counted_study(study, data)
    here.result.update(study=study.name, data=counted.counts.source, data_sha256=counted.counts.sha256)
    return counted
