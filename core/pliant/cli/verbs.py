"""The verbs of all packages in one `app`; a verb's module is imported when the verb is called, not before."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from pliant import __version__
from pliant.errors import interrupted_at_start
from pliant.registry.command import Command, commands
from pliant.registry.manifests import FRAME

# Name → verb, in the order of `pliant --help`.
VERBS = commands()


class Verb(TyperCommand):
    """A verb as `pliant --help` lists it; the command itself, with its options, is built when it is called."""

    def __init__(self, verb: Command) -> None:
        self._verb = verb
        super().__init__(verb.name, help=verb.help)

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Return the context of the real command, with which click continues."""
        with _interrupts_answered():
            return self.command().make_context(info_name, args, parent, **extra)

    def command(self) -> Any:
        """Return the command with its options.

        Raises:
            typer.Exit: the function of another package cannot be imported, which is printed.
        """
        module, _, name = self._verb.function.partition(":")
        try:
            function: Callable[..., None] = getattr(importlib.import_module(module), name)
        except (ImportError, AttributeError) as error:
            if self._verb.package == FRAME:
                raise
            typer.echo(f"'{self.name}' of {self._verb.package} cannot be used: {error}.", err=True)
            raise typer.Exit(2) from None
        alone = typer.Typer(add_completion=False)
        alone.command(self.name)(function)
        return typer.main.get_command(alone)


class Verbs(TyperGroup):
    """The group of all verbs."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        for verb in VERBS.values():
            self.add_command(Verb(verb))

    def make_context(self, *args: Any, **extra: Any) -> Any:
        """Return the context of the whole command line; reading its options imports modules too."""
        with _interrupts_answered():
            return super().make_context(*args, **extra)


@contextmanager
def _interrupts_answered() -> Iterator[None]:
    """End the command with a sentence on Ctrl-C; typer itself would print nothing."""
    try:
        yield
    except KeyboardInterrupt:
        interrupted_at_start()


app = typer.Typer(
    name="pliant",
    help="Soft robots from finite elements to fast chain models with a stated error.",
    cls=Verbs,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(show: bool) -> None:
    if show:
        typer.echo(f"pliant {__version__}")
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass
