"""`pliant doctor`: checks of a study that an expert would make by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pliant.cli.options import Overrides, StudyFile, report_folder, verb
from pliant.cli.session import Session, check_writable
from pliant.pipeline.self_check import self_check
from pliant.report.self_check import self_check_document


@verb()
def doctor(
    session: Session,
    study: StudyFile,
    overrides: Overrides = None,
    out: Annotated[Path | None, report_folder("doctor")] = None,
) -> None:
    """Check a study's magnitudes, law, rest pose, engines, keys and defaults; what is doubtful comes first."""
    loaded, context = session.study(study, overrides), session.context()
    folder = out or Path("runs") / f"{loaded.name}-doctor"
    check_writable(folder)
    session.show(self_check_document(loaded.name, self_check(context, loaded)), folder)
