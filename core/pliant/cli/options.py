"""Options that several verbs share (docs/command_line.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

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
DEFAULT_STORE = Path(".pliant/store")
