"""`pliant example`: a small study with its data, to try Pliant without a checkout."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pliant.cli.options import verb
from pliant.cli.session import Session, check_writable
from pliant.errors import UserError, closest
from pliant.examples_shipped import EXAMPLES, copy_example


@verb(store=False)
def example(
    session: Session,
    name: Annotated[str, typer.Argument(metavar="NAME", help=", ".join(EXAMPLES))],
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="By default ./NAME.")] = None,
) -> None:
    """Write a small study with its data, to try the other commands on."""
    if name not in EXAMPLES:
        raise UserError(f"unknown example '{name}'{closest(name, EXAMPLES)} Examples: {', '.join(EXAMPLES)}.")
    _, files, command = EXAMPLES[name]
    target = out or Path(name)
    check_writable(target)
    if there := [str(target / file) for file in files if (target / file).exists()]:
        raise UserError(f"{' and '.join(there)}: there already; choose another --out folder.")
    for file in copy_example(name, target):
        session.say(str(target / file))
    session.result["files"] = [str(target / file) for file in files]
    session.say(f"\nnext: pliant {command} {target / files[0]}")
