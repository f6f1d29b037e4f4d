"""`pliant diagnose`: which physical effect is missing."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from pliant.cli.bars import fitting_bar
from pliant.cli.compare import DataFile, Workers, diagnose_counts_verb, one_file, refuse_more_counts
from pliant.cli.options import Overrides, StudyFile, verb
from pliant.cli.session import Session, check_writable
from pliant.config.study import Study
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.diagnosis import diagnose as diagnose_with
from pliant.evidence.counts import is_counted
from pliant.evidence.measured import measurement_of_study
from pliant.evidence.prediction import Predictor
from pliant.experiments.planned_run import PlannedRun
from pliant.experiments.protocol_file import write_protocol
from pliant.experiments.protocols import own_runs
from pliant.records.measurement import Measurement
from pliant.report.diagnosis import diagnosis_document

Candidates = Annotated[
    list[str] | None,
    typer.Option("--effect", metavar="KIND", help="Candidate, may be repeated; all effects by default."),
]
ReportFolder = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder of the report; runs/<name>-diagnose by default."),
]


@verb()
def diagnose(
    here: Session,
    study: StudyFile,
    overrides: Overrides = None,
    data: DataFile = None,
    effect: Candidates = None,
    out: ReportFolder = None,
    workers: Workers = 1,
) -> None:
    """Which physical effect is missing, how sure, what to measure next."""
    loaded = here.study(study, overrides)
    folder = out or Path("runs") / f"{loaded.name}-diagnose"
    bench = here.bench()
    alone = one_file(data)
    if is_counted(loaded, alone):
        refuse_more_counts(data)
        diagnose_counts_verb(here, bench, loaded, alone, effect, folder, workers)
        return
    measurement = measurement_of_study(bench, loaded, data)
    predictor = Predictor.of_study(bench, loaded, measurement)
    check_writable(folder)
    kinds = effect or here.registry.kinds("effect")
    own = own_runs(loaded, predictor.chain, measurement)
    with fitting_bar(here.progress, len(kinds)) as bar:
        found = diagnose_with(predictor, kinds=kinds, runs=own, tick=bar.tick)
    file = _next_file(found, folder, study, loaded, measurement, data)
    here.result.update(study=loaded.name, data=measurement.source, data_sha256=measurement.sha256)
    here.show(
        diagnosis_document(
            loaded.name, measurement, found, here.registry, asked=effect or (), next_file=file
        ),
        folder,
    )


def _next_file(
    found: Diagnosis,
    folder: Path,
    study: Path,
    loaded: Study,
    measurement: Measurement,
    data: Sequence[Path] | None,
) -> str | None:
    """The proposed run, ready for the bench; one of an earlier diagnosis is taken away."""
    (folder / NEXT_RUN).unlink(missing_ok=True)
    if found.next_run is None or found.next_run.planned is None:
        return None
    planned = [(NEXT_RUN, found.next_run.planned)]
    (path,) = write_runs(folder, planned, measurement.outputs, study, loaded, measurement, data)
    return str(path)


NEXT_RUN = "next_run.csv"


def write_runs(
    folder: Path,
    runs: Sequence[tuple[str, PlannedRun]],
    outputs: Sequence[str],
    study: Path,
    loaded: Study,
    measurement: Measurement | None = None,
    data: Sequence[Path] | None = None,
) -> list[Path]:
    """Write each run under its file's name; returns the paths. `data`: the measurement's files, if not the study's."""
    notes, paths = loaded.measurements, []
    old = [_from_here(file) for file in data or ([Path(notes.file)] if notes is not None else [])]
    for file, run in runs:
        path = folder / file
        write_protocol(path, run, outputs, measurement=measurement, notes=notes, study=str(study), data=old)
        paths.append(path)
    return paths


def _from_here(file: Path) -> str:
    """The file as one would type it in this folder."""
    here = Path.cwd()
    return str(file.relative_to(here) if file.is_relative_to(here) else file)
