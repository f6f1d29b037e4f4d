"""The verb `pliant export`; nothing that writes a file is imported here."""

from __future__ import annotations

from collections.abc import Iterable

from pliant.registry.command import Command
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3


@hookimpl
def pliant_commands() -> Iterable[Command]:
    """Return the verb that writes files for other programs."""
    return [Command("export", "pliant_export.command:export")]
