"""Options that several verbs share (docs/command_line.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pliant.errors import UserError
from pliant.execution.executors import checked_workers

StudyFile = Annotated[Path, typer.Argument(metavar="STUDY.yaml", help="The study file.")]
Overrides = Annotated[
    list[str] | None,
    typer.Argument(metavar="[KEY=VALUE]...", help="Changes to the study, e.g. physics.kind=mujoco."),
]
JsonFile = Annotated[
    str | None,
    typer.Option("--json", metavar="FILE", help="Write the result as JSON; '-' is standard output."),
]
Quiet = Annotated[bool, typer.Option("--quiet", help="Say nothing but errors and warnings.")]
StoreFolder = Annotated[
    Path,
    typer.Option(
        "--store",
        envvar="PLIANT_STORE",
        help="Folder of cached results; share it between studies and processes.",
    ),
]
PluginFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--file", metavar="FILE.py", help="A Python file with effects of your own; may be repeated."
    ),
]
Workers = Annotated[
    int | None,
    typer.Option("--workers", metavar="N", help="Processes that work; by default one for each CPU."),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Work on a dask cluster instead: tcp://host:8786, or the scheduler's file.",
    ),
]
DEFAULT_STORE = Path(".pliant/store")


def workers_or_scheduler(workers: int | None, scheduler: str | None) -> int | str | None:
    """The one that is given; raises `UserError` for both, or for a number of workers that is none."""
    if workers is not None and scheduler is not None:
        raise UserError("give --workers or --scheduler, not both; a cluster's workers are its own.")
    return scheduler if workers is None else checked_workers(workers)
