"""The verbs that later versions will serve: they say so and exit with 2."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import typer

from pliant.cli.options import JsonFile, Quiet
from pliant.cli.session import session
from pliant.errors import UserError

NOT_BUILT = {
    "optimize": "the study's search, then the check of the winner by direct FEM",
}
ANYTHING = {"allow_extra_args": True, "ignore_unknown_options": True}


def add_to(app: typer.Typer) -> None:
    """Add the verbs that are not built yet."""
    for name, purpose in NOT_BUILT.items():
        app.command(name, context_settings=ANYTHING, help=f"Not built yet: {purpose}.")(_saying(name))


def _saying(name: str) -> Callable[..., None]:
    def verb(
        study: Annotated[str, typer.Argument(metavar="STUDY.yaml")] = "",
        json: JsonFile = None,
        quiet: Quiet = False,
    ) -> None:
        with session(name, json, quiet):
            raise UserError(
                f"'pliant {name}' is not built yet in this version; 'pliant --help' lists what is."
            )

    return verb
