"""`pliant extend`: fit an effect and write a study that contains it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pliant import api
from pliant.cli.evidence import DataFile, read_session_measurement
from pliant.cli.options import Force, Full, Overrides, StudyFile, check_target, verb
from pliant.cli.session import Session
from pliant.config.study import Study
from pliant.diagnosis.candidates import candidate_kinds
from pliant.diagnosis.extension import write_extended_study
from pliant.errors import UserError
from pliant.interfaces.effect import AT
from pliant.report.extension import extension_document, origin

Effects = Annotated[
    list[str] | None,
    typer.Option("--effect", metavar="KIND", help="Effect to fit; repeat the option for several."),
]
NewStudy = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="NEW.yaml", help="The new study; <study>+<kind>.yaml beside it by default."
    ),
]
Refit = Annotated[bool, typer.Option("--refit", help="Fit the effects that the study has already anew, too.")]
NOT_REACHED = 3


@verb()
def extend(
    session: Session,
    study: StudyFile,
    overrides: Overrides = None,
    effect: Effects = None,
    data: DataFile = None,
    out: NewStudy = None,
    refit: Refit = False,
    force: Force = False,
    full: Full = False,
) -> None:
    """Fit an effect and write a new study that contains it, with its uncertainty; comments are kept."""
    loaded = session.study(study, overrides)
    kinds = _kinds(session, loaded, effect, refit)
    target = out or study.with_name(f"{study.stem}+{'+'.join(effect or [])}.yaml")
    check_target(study, target, force)
    opened = api.OpenStudy(loaded, session.context())
    measurement = read_session_measurement(session, opened, data)
    found = api.extend(opened, kinds, measurement)
    session.measured(loaded, measurement)
    session.result["out"] = None
    session.show(extension_document(loaded.name, measurement, found, session.registry))
    if found.absent:
        session.exit_code = NOT_REACHED
        return
    note = origin(found, measurement)
    write_extended_study(
        study, target, loaded, session.overrides, found, note, session.installed, data=data, full=full
    )
    session.result["out"] = str(target)
    session.say(f"study    {target}")


def _kinds(session: Session, study: Study, effect: list[str] | None, refit: bool) -> list[str]:
    if not effect:
        raise UserError(
            f"name the effect: pliant extend STUDY.yaml --effect KIND. 'pliant diagnose' says which; there are "
            f"{', '.join(candidate_kinds(session.registry))}."
        )
    fitted = candidate_kinds(session.registry)
    return [
        *(one.kind for one in study.effects if refit and one.kind.partition(AT)[0] in fitted),
        *candidate_kinds(session.registry, effect),
    ]
