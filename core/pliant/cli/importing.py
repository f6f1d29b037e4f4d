"""`pliant import`: how a recording is understood, and a study that reads it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from pliant import api
from pliant.cli.options import check_target, report_folder, verb
from pliant.cli.session import Session, check_writable
from pliant.config.loading import load_study
from pliant.measurements.block import files_and_notes
from pliant.measurements.study_file import write_study

FILES = typer.Argument(metavar="FILE... [KEY=VALUE]...", help="The recording, and notes: rate='25 Hz'.")
BASE = "What --out extends. Where it has a model, the recording has the columns of that model."


@verb(store=False)
def import_(
    session: Session,
    files: Annotated[list[str], FILES],
    study: Annotated[
        Path | None,
        typer.Option(
            metavar="BASE.yaml", help="What --out extends; if it has a model, whose inputs and outputs."
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="NEW.yaml", help="Write a study with it.")] = None,
    report: Annotated[Path | None, report_folder("import", "--report")] = None,
) -> None:
    """Show how a recording is understood, doubts first, and the `measurements` block or a study that reads it."""
    paths, notes = files_and_notes(files)
    if out is not None:
        check_target(study, out)
    base = None if study is None else load_study(study, session.registry, (), note=lambda _: None)
    if base is not None and base.model is not None:
        session.registry = base.registry(session.registry)
        measurement, document = api.read_for_model(api.OpenStudy(base, session.context()), paths, notes)
    else:
        measurement, document = api.read(paths, notes)
    folder = report or Path("runs") / f"{_plain_name(paths[0])}-import"
    check_writable(folder)
    session.show(document, folder)
    if out is not None:
        write_study(out, measurement, document.data["measurements"], study, session.installed)
        session.result["study"] = str(out)
        session.say(f"study    {out}")


def _plain_name(path: Path | str) -> str:
    """Return a file's or pattern's stem without the characters that a shell expands."""
    return re.sub(r"[^\w.-]+", "", Path(path).stem).strip("_-.") or "recording"
