"""`pliant improve`: compare → diagnose → extend, until the noise floor or until no step is justified."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pliant import api
from pliant.cli.bars import fitting_bar
from pliant.cli.evidence import Candidates, DataFile, read_session_measurement
from pliant.cli.options import (
    Fitters,
    Force,
    Full,
    Overrides,
    Scheduler,
    StudyFile,
    check_target,
    report_folder,
    verb,
    workers_or_scheduler,
)
from pliant.cli.session import Session, check_writable
from pliant.diagnosis.extension import write_extended_study
from pliant.report.extension import cited
from pliant.report.improvement import improvement_document, origin, stands_for
from pliant.report.system_picture import with_system

Learned = Annotated[
    bool,
    typer.Option(
        "--learned", help="Let a learned curve be the last step: it describes what no listed effect explains."
    ),
]
NewStudy = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="NEW.yaml", help="The new study; <study>-improved.yaml beside it by default."
    ),
]

NamedOnly = Annotated[
    bool,
    typer.Option("--named-only", help="Add nothing whose cause no verdict names, however well it predicts."),
]


@verb()
def improve(
    session: Session,
    study: StudyFile,
    overrides: Overrides = None,
    data: DataFile = None,
    effect: Candidates = None,
    out: NewStudy = None,
    report: Annotated[Path | None, report_folder("improve", "--report")] = None,
    force: Force = False,
    full: Full = False,
    learned: Learned = False,
    workers: Fitters = None,
    scheduler: Scheduler = None,
    named_only: NamedOnly = False,
) -> None:
    """Compare, diagnose and extend until the noise floor or until no step is justified; errors are on held-out data."""
    loaded = session.study(study, overrides)
    session.leave_out_broken_effects()
    who = loaded.resolve_workers(workers_or_scheduler(workers, scheduler), 1)
    opened = api.OpenStudy(loaded, session.context())
    kinds = api.candidates(opened, effect)
    target = out or study.with_name(f"{study.stem}-improved.yaml")
    folder = report or Path("runs") / f"{loaded.name}-improve"
    check_target(study, target, force)
    measurement = read_session_measurement(session, opened, data)
    check_writable(folder)
    with fitting_bar(session.progress, len(kinds)) as bar:
        found = api.improve(
            opened,
            measurement,
            kinds=kinds,
            learned=learned,
            named_only=named_only,
            tick=bar.tick,
            workers=who,
        )
    session.measured(loaded, measurement)
    session.result["final_study"] = str(study)
    written = found.final is not None or found.learned is not None
    if written:
        notes = {kind: stands_for(step) for step in found.steps for kind in step.added}
        write_extended_study(
            study,
            target,
            loaded,
            session.overrides,
            found.final,
            origin(found, cited(measurement)),
            session.installed,
            notes_by_kind=notes,
            learned=found.learned,
            data=data,
            full=full,
        )
        session.result["final_study"] = str(target)
    session.say(f"study    {target}" if written else "No study was written.")
    document = improvement_document(loaded.name, measurement, found, session.registry, effect or ())
    added = [kind for step in found.steps for kind in step.added]
    model = api.predictor(opened, measurement)
    session.show(with_system(document, model, [*(one.kind for one in loaded.effects), *added]), folder)
