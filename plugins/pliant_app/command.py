"""`pliant app`: the evidence page in the browser."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from pliant.cli.options import verb
from pliant.cli.session import Session, check_writable
from pliant.errors import MissingDependencyError, UserError

NEEDED = ("starlette", "uvicorn")


@verb(json=False)
def app(
    session: Session,
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[STUDY.yaml] [FILE]...", help="A study, and recordings instead of those that it names."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder of the session; runs/<study>-app by default."),
    ] = None,
    experiment: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Follow an experiment live instead: its folder."),
    ] = None,
    port: Annotated[int, typer.Option(help="Port on loopback; a free one by default.")] = 0,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
) -> None:
    """Compare, localise errors, diagnose and add effects on a page in the browser, on this machine alone."""
    if missing := [name for name in NEEDED if find_spec(name) is None]:
        raise MissingDependencyError(f"the page needs {' and '.join(missing)}: pip install 'pliant[app]'.")
    if experiment is not None:
        if files or out is not None:
            raise UserError("--experiment follows a folder; leave files and --out away.")
        from pliant_app.experiment import experiment_folder
        from pliant_app.server import serve_experiment  # the extra

        serve_experiment(experiment_folder(experiment), port, browser, session.say)
        return
    study, data = _sorted(files or [])
    from pliant_app.controller import SessionController  # the extra
    from pliant_app.folder import SessionFolder
    from pliant_app.server import serve, session_folder

    folder = SessionFolder(session_folder(study, out).absolute())
    check_writable(folder.path)
    with folder.alone():
        controller = SessionController(folder, session.store.expanduser())
        controller.begin(study, data)
        serve(controller, port, browser, session.say)


def _sorted(files: list[Path]) -> tuple[Path | None, list[Path]]:
    """Return the study and the recordings among the named files."""
    studies = [file for file in files if file.suffix.lower() in (".yaml", ".yml")]
    if len(studies) > 1:
        raise UserError(f"one study at a time: {studies[0]} or {studies[1]}.")
    for file in files:
        if not file.exists():
            raise UserError(f"{file}: no such file.")
    return (studies[0] if studies else None), [file for file in files if file not in studies]
