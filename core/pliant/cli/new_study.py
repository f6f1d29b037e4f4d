"""A new study's file: where it may go, and the options of verbs that write one."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from pliant.cli.session import check_writable
from pliant.config.loading import StudyFile
from pliant.config.writing import refuse_bases
from pliant.errors import UserError

Force = Annotated[bool, typer.Option("--force", help="Overwrite the new study's file if it is there.")]
Full = Annotated[
    bool,
    typer.Option(
        "--full",
        help="Write a study that stands alone, comments kept, instead of 'extends' and what changed.",
    ),
]


def check_target(source: Path, target: Path, force: bool) -> None:
    """Refuse a place that cannot be written or that holds something, before any work is done."""
    if os.path.isdir(target):  # noqa: PTH112 - never raises
        raise UserError(
            f"--out needs the name of a file, and {target} is a folder; try {target / 'new.yaml'}."
        )
    refuse_bases(target, StudyFile.read(source))
    if os.path.exists(target) and not force:  # noqa: PTH110 - never raises
        raise UserError(f"{target} is there already; give another --out, or --force to overwrite it.")
    check_writable(target.parent)
