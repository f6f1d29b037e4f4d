"""Options that several verbs share (docs/command_line.md)."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from pliant.cli.session import check_writable, session
from pliant.config.loading import StudyFile as ReadStudy
from pliant.config.writing import refuse_bases
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
Quiet = Annotated[bool, typer.Option("--quiet", help="Print only errors and warnings.")]
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
    typer.Option(
        "--workers",
        metavar="N",
        help="Processes that work; by default the study's 'workers', or one for each CPU.",
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Work on a dask cluster instead: tcp://host:8786, or the scheduler's file.",
    ),
]
Fitters = Annotated[
    int | None,
    typer.Option(
        "--workers",
        metavar="N",
        help="Processes that fit hypotheses or simulate the conditions of counts; by default the study's 'workers', "
        "or this one alone.",
    ),
]
DEFAULT_STORE = Path(".pliant/store")


def report_folder(verb: str, option: str = "--out") -> typer.models.OptionInfo:
    """Return the option for the folder of a verb's report."""
    text = f"Folder of the report; runs/<name>-{verb} by default."
    return typer.Option(option, metavar="DIR", help=text)


def verb(store: bool = True, json: bool = True) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator that makes a function a verb: it gets a `Session` first, `--store`, `--json` and `--quiet`."""
    shared: dict[str, tuple[Any, Any]] = {
        **({"store": (StoreFolder, DEFAULT_STORE)} if store else {}),
        **({"json": (JsonFile, None)} if json else {}),
        "quiet": (Quiet, False),
    }

    def made(function: Callable[..., None]) -> Callable[..., None]:
        _, *own = inspect.signature(function, eval_str=True).parameters.values()
        more = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=kind, default=default)
            for name, (kind, default) in shared.items()
        ]

        def call(**given: Any) -> None:
            own_store, target = given.pop("store", DEFAULT_STORE), given.pop("json", None)
            name = function.__name__.rstrip("_").replace("_", "-")  # `import_`: `import` is a Python keyword
            with session(name, target, given.pop("quiet"), own_store) as opened_session:
                function(opened_session, **given)

        call.__name__, call.__doc__, call.__module__ = (
            function.__name__,
            function.__doc__,
            function.__module__,
        )
        call.__signature__ = inspect.Signature([*own, *more])  # type: ignore[attr-defined]
        call.__annotations__ = {parameter.name: parameter.annotation for parameter in (*own, *more)}
        return call

    return made


def workers_or_scheduler(workers: int | None, scheduler: str | None) -> int | str | None:
    """Return the given one; raises `UserError` for both, or for an invalid number of workers."""
    if workers is not None and scheduler is not None:
        raise UserError("give --workers or --scheduler, not both; a cluster's workers are its own.")
    return scheduler if workers is None else checked_workers(workers)


Force = Annotated[bool, typer.Option("--force", help="Overwrite the new study's file if it is there.")]
Full = Annotated[
    bool,
    typer.Option(
        "--full",
        help="Write a self-contained study with its comments, instead of 'extends' and the changes.",
    ),
]


def check_target(source: Path | None, target: Path, force: bool | None = None) -> None:
    """Raise `UserError`, before any work is done, for a target that exists or cannot be written.

    `source` is the study that the new one extends, if any; `force` is None for a verb without that option.
    """
    if os.path.isdir(target):  # noqa: PTH112 - never raises
        raise UserError(
            f"--out needs the name of a file, and {target} is a folder; try {target / 'new.yaml'}."
        )
    if source is not None:
        refuse_bases(target, ReadStudy.read(source))
    if os.path.exists(target) and not force:  # noqa: PTH110 - never raises
        or_force = "" if force is None else ", or --force to overwrite it"
        raise UserError(f"{target} is there already; give another --out{or_force}.")
    check_writable(target.parent)
