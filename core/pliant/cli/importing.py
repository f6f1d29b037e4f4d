"""`pliant import`: how a recording is understood, and a study that reads it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from pliant import api
from pliant.cli.options import check_target, report_folder, verb
from pliant.cli.session import Session, check_writable
from pliant.config.loading import load_study
from pliant.errors import UserError
from pliant.measurements.block import files_and_notes
from pliant.measurements.header import HalfError
from pliant.measurements.study_file import write_study
from pliant.records.measurement import Measurement
from pliant.report.document import Document

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
        measurement, document = _read_for_chain(paths, notes)
    folder = report or Path("runs") / f"{_plain_name(paths[0])}-import"
    check_writable(folder)
    session.show(document, folder)
    if out is not None:
        write_study(out, measurement, document.data["measurements"], study, session.installed)
        session.result["study"] = str(out)
        session.say(f"study    {out}")


def _read_for_chain(paths: Sequence[str], notes: Mapping[str, Any]) -> tuple[Measurement, Document]:
    """Return a recording of a chain; raise `UserError` with what else it may be."""
    try:
        return api.read(list(paths), notes)
    except HalfError as error:
        if error.lacks != "inputs":
            raise
        raise UserError(
            f"{error}\nA recording for a model of your own has the columns of its study: "
            f"pliant import {paths[0]} --study STUDY.yaml"
        ) from None


def _plain_name(path: Path | str) -> str:
    """Return a file's or pattern's stem without the characters that a shell expands."""
    return re.sub(r"[^\w.-]+", "", Path(path).stem).strip("_-.") or "recording"
