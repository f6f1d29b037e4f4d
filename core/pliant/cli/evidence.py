"""The verbs that compare a model with measurements, readings or another kind of data: compare, diagnose."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from pliant import api
from pliant.cli.bars import fitting_bar
from pliant.cli.options import (
    Fitters,
    Overrides,
    Scheduler,
    StudyFile,
    report_folder,
    verb,
    workers_or_scheduler,
)
from pliant.cli.session import Session, check_writable
from pliant.config.study import Study
from pliant.diagnosis.bands import study_bands
from pliant.evidence.compared import compare_model
from pliant.experiments.planned_run import PlannedRun
from pliant.experiments.protocol_file import write_protocol
from pliant.formatting import displayed_in
from pliant.measurements.files import expand_sources
from pliant.measurements.written_units import units_as_written
from pliant.records.measurement import Measurement
from pliant.registry.data_kind import MeasuredData, open_data
from pliant.report.comparison import comparison_document
from pliant.report.diagnosis import diagnosis_document, leading
from pliant.report.document import Document
from pliant.report.stored_answer import Question, stored_answer
from pliant.report.system_picture import with_system
from pliant.store.store import write_atomically

DataFile = Annotated[
    list[Path] | None,
    typer.Option(
        "--data",
        metavar="CSV",
        help="The measurement, instead of the one that the study names; several are read as one, in their order.",
    ),
]
Candidates = Annotated[
    list[str] | None,
    typer.Option("--effect", metavar="KIND", help="Candidate, may be repeated; all effects by default."),
]
NEXT_RUN = "next_run.csv"
# Modules that a diagnosis and its page are computed with, besides effects and engine.
MODULES = ("pliant.report.diagnosis", "pliant.report.system_picture", "pliant.diagnosis.diagnosis", __name__)


@verb()
def compare(
    session: Session,
    study: StudyFile,
    overrides: Overrides = None,
    data: DataFile = None,
    out: Annotated[Path | None, report_folder("compare")] = None,
    workers: Fitters = None,
    scheduler: Scheduler = None,
) -> None:
    """Compare the model with measurements: errors, noise floor, where it fails."""
    loaded = session.study(study, overrides)
    opened = api.OpenStudy(loaded, session.context())
    who = loaded.resolve_workers(workers_or_scheduler(workers, scheduler), 1)
    folder = out or Path("runs") / f"{loaded.name}-compare"
    if (other := _other_data(session, loaded, data)) is not None:
        check_writable(folder)
        session.show(other.compare(opened.context, who)[1](), folder)
        return
    measurement = read_session_measurement(session, opened, data)
    predictor = api.predictor(opened, measurement)
    check_writable(folder)
    predicted, comparison = compare_model(predictor)
    session.measured(loaded, measurement)
    bands, remark = study_bands(opened.context, loaded, measurement)
    document = comparison_document(loaded.name, measurement, predicted, comparison, bands, remark)
    session.show(with_system(document, predictor, [effect.kind for effect in loaded.effects]), folder)


@verb()
def diagnose(
    session: Session,
    study: StudyFile,
    overrides: Overrides = None,
    data: DataFile = None,
    effect: Candidates = None,
    out: Annotated[Path | None, report_folder("diagnose")] = None,
    page: Annotated[
        bool, typer.Option("--page/--no-page", help="Write the page, or the result alone.")
    ] = True,
    workers: Fitters = None,
    scheduler: Scheduler = None,
) -> None:
    """Diagnose which physical effect is missing, with its probability, and what to measure next."""
    loaded = session.study(study, overrides)
    session.leave_out_broken_effects()
    opened = api.OpenStudy(loaded, session.context())
    context = opened.context
    who = loaded.resolve_workers(workers_or_scheduler(workers, scheduler), 1)
    name, folder = loaded.name, out or Path("runs") / f"{loaded.name}-diagnose"
    if (other := _other_data(session, loaded, data)) is not None:
        candidates = other.candidates(context.registry, effect)
        check_writable(folder)
        session.show(other.diagnose(context, candidates, who)[1](), folder if page else None)
        return
    kinds = api.candidates(opened, effect)
    measurement = read_session_measurement(session, opened, data)
    check_writable(folder)

    def answer() -> tuple[Document, dict[str, str]]:
        with fitting_bar(session.progress, len(kinds)) as bar:
            found = api.diagnose(opened, measurement, kinds=kinds, tick=bar.tick, workers=who)
        planned = found.next_run.planned if found.next_run is not None else None
        runs = [(NEXT_RUN, planned)] if planned is not None else []
        files = write_runs(folder, runs, measurement.outputs, study, loaded, measurement, data)
        file = files[0] if files else None
        document = diagnosis_document(
            name, measurement, found, session.registry, asked=effect or (), next_file=file
        )
        document = with_system(document, api.predictor(opened, measurement), leading(found))
        return document, {NEXT_RUN: Path(file).read_text(encoding="utf-8")} if file else {}

    # The file of the next run names the study, the data and the folder by their paths.
    paths = [str(path) for path in (Path.cwd(), study, folder, *(data or ()))]
    options = {"kinds": kinds, "asked": effect or [], "paths": paths}
    stored = stored_answer(Question(context, loaded, measurement, options, MODULES), answer, page)
    (folder / NEXT_RUN).unlink(missing_ok=True)  # of an earlier diagnosis
    for file, text in stored.files.items():
        write_atomically(folder / file, text)
    session.measured(loaded, measurement)
    session.show(stored.document, folder if page else None, stored)


def read_session_measurement(
    session: Session, opened: api.OpenStudy, data: Sequence[Path] | None
) -> Measurement:
    """Return the study's measurement, or that of `data`; from here on quantities are shown in its file's units."""
    measurement = api.read_measurement(opened, data)
    session.until_end.enter_context(displayed_in(units_as_written(measurement)))
    return measurement


def _other_data(session: Session, study: Study, data: Sequence[Path] | None) -> MeasuredData | None:
    """Return the study's data if a package compares and diagnoses their kind; None for readings."""
    other = open_data(study, data or None)
    if other is not None:
        session.measured(study, other)
    return other


def write_runs(
    folder: Path,
    runs: Sequence[tuple[str, PlannedRun]],
    outputs: Sequence[str],
    study: Path,
    loaded: Study,
    measurement: Measurement | None = None,
    data: Sequence[Path] | None = None,
) -> list[str]:
    """Write each run under its file's name and return the paths; `data`: files read instead of the study's."""
    notes, here = loaded.measurements, Path.cwd()
    named = data or (notes.file if notes is not None else ())
    files = expand_sources(named) if named else []
    old = [str(file.relative_to(here) if file.is_relative_to(here) else file) for file in files]
    for name, run in runs:
        write_protocol(
            folder / name, run, outputs, measurement=measurement, notes=notes, study=str(study), data=old
        )
    return [str(folder / name) for name, _ in runs]
