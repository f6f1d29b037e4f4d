"""`pliant diagnose`: which physical effect is missing."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.table import Table

from pliant.cli.compare import DataFile, Workers, one_file, refuse_more_counts
from pliant.cli.diagnose_counts import diagnose_counts_verb
from pliant.cli.fitting_bar import fitting_bar
from pliant.cli.options import DEFAULT_STORE, JsonFile, Overrides, Quiet, StoreFolder, StudyFile
from pliant.cli.protocol_files import NEXT_RUN, write_runs
from pliant.cli.remarks import say_remarks
from pliant.cli.session import Session, check_writable, session
from pliant.config.study import Study
from pliant.diagnosis.diagnosis import Diagnosis
from pliant.diagnosis.diagnosis import diagnose as diagnose_with
from pliant.diagnosis.diagnosis_json import diagnosis_json
from pliant.diagnosis.verdict import UNKNOWN, Kinds
from pliant.diagnosis.words import explanation, headline, named
from pliant.evidence.counts import is_counted
from pliant.evidence.measured import measurement_of_study
from pliant.evidence.prediction import Predictor
from pliant.experiments.protocols import own_runs
from pliant.records.measurement import Measurement
from pliant.report.diagnosis_words import parameter_texts, probability_text
from pliant.report.stage import write_page

Candidates = Annotated[
    list[str] | None,
    typer.Option("--effect", metavar="KIND", help="Candidate, may be repeated; all effects by default."),
]
ReportFolder = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder of the report; runs/<name>-diagnose by default."),
]
MOST_SHOWN = 6


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
        here.result.update(
            {
                "study": loaded.name,
                "data": measurement.source,
                "data_sha256": measurement.sha256,
                **diagnosis_json(found),
                "out": str(folder),
            }
        )
        _say(here, found, effect or ())
        _next_file(here, found, folder, study, loaded, measurement, data)
        from pliant.report.diagnosis import diagnosis_page  # matplotlib takes a second to import

        made = diagnosis_page(loaded.name, measurement, found, here.registry)
        page = write_page(folder, made.html, made.pictures)
        here.result["report"] = str(page)
        here.say(f"report   {page}")


def _next_file(
    here: Session,
    found: Diagnosis,
    folder: Path,
    study: Path,
    loaded: Study,
    measurement: Measurement,
    data: Sequence[Path] | None,
) -> None:
    """The proposed run, ready for the bench; one of an earlier diagnosis is taken away."""
    (folder / NEXT_RUN).unlink(missing_ok=True)
    if found.next_run is None or found.next_run.planned is None:
        return
    planned = [(NEXT_RUN, found.next_run.planned)]
    (path,) = write_runs(folder, planned, measurement.outputs, study, loaded, measurement, data)
    here.result["next_experiment"]["file"] = str(path)
    here.say(f"next run {path}")


def _say(here: Session, found: Diagnosis, asked: Sequence[str]) -> None:
    here.say(_hypotheses(found))
    for kinds in _leading(found):
        here.say(f"{named(kinds)}: {', '.join(parameter_texts(found, kinds))}")
    if found.not_excited:
        here.say("not shown by these runs, and the run that would show it:")
        for kind, run in found.not_excited.items():
            here.say(f"  {kind}: {run}" if run else f"  {kind}")
    say_remarks(here, found.remarks, asked)
    here.say(headline(found))
    for line in explanation(found, here.registry):
        here.say(line)


def _hypotheses(found: Diagnosis) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("hypothesis")
    for name in ("probability", "left-out error / floor"):
        table.add_column(name, justify="right", no_wrap=True)
    for kinds in list(found.judgement.probability)[:MOST_SHOWN]:
        table.add_row(
            named(kinds), probability_text(found.judgement.probability[kinds]), _ratio(found, kinds)
        )
    return table


def _leading(found: Diagnosis) -> list[Kinds]:
    """Hypotheses that hold 90 %, those with parameters: their numbers are printed below the table."""
    return [kinds for kinds in found.judgement.credible[:MOST_SHOWN] if parameter_texts(found, kinds)]


def _ratio(found: Diagnosis, kinds: Kinds) -> str:
    if kinds == UNKNOWN:
        return "any form"
    ratio = found.table.over_floor(found.table.rows[kinds].heldout_square)
    return f"{ratio:.2f}" if np.isfinite(ratio) else "–"
