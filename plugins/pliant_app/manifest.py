"""The verb `pliant app`; nothing of the page is imported here."""

from __future__ import annotations

from collections.abc import Iterable

from pliant.registry.command import Command
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3


@hookimpl
def pliant_commands() -> Iterable[Command]:
    """Return the verb of the evidence page."""
    return [Command("app", "pliant_app.command:app")]
