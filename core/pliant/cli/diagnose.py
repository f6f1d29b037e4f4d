"""`pliant diagnose`: which physical effect is missing."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from pliant.cli.compare import DataFile, Workers, one_file, refuse_more_counts
from pliant.cli.counts import diagnose_counts_verb
from pliant.cli.fitting_bar import fitting_bar
from pliant.cli.options import DEFAULT_STORE, JsonFile, Overrides, Quiet, StoreFolder, StudyFile
from pliant.cli.protocol_files import NEXT_RUN, write_runs
from pliant.cli.session import check_writable, session
from pliant.config.study import Study
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.diagnosis import diagnose as diagnose_with
from pliant.evidence.counts import is_counted
from pliant.evidence.prediction import Predictor, measurement_of_study
from pliant.experiments.experiment_catalogue import own_runs
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


def diagnose(
    study: StudyFile,
    overrides: Overrides = None,
    data: DataFile = None,
    effect: Candidates = None,
    out: ReportFolder = None,
    workers: Workers = 1,
    store: StoreFolder = DEFAULT_STORE,
    json: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """Which physical effect is missing, how sure, what to measure next."""
    with session("diagnose", json, quiet) as here:
        loaded = here.study(study, overrides)
        folder = out or Path("runs") / f"{loaded.name}-diagnose"
        bench = here.bench(store)
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
        with fitting_bar(here, len(kinds)) as bar:
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
