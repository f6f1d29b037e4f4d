"""The verbs of the command line in one `app`; a verb's module is imported when the verb is called, not before."""

from __future__ import annotations

import ast
import importlib
import keyword
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from pliant import __version__
from pliant.errors import interrupted_at_start

# Verb → module of `pliant.cli` that holds a function of its name, in the order of `pliant --help`.
VERBS = {
    "example": "example",
    "run": "studies",
    "fem": "studies",
    "fit": "fit",
    "simulate": "studies",
    "report": "studies",
    "plugins": "plugins",
    "check": "plugins",
    "schema": "plugins",
    "new-plugin": "plugins",
    "calibrate": "calibrate",
    "compare": "evidence",
    "diagnose": "evidence",
    "plan": "plan",
    "extend": "extend",
    "improve": "improve",
    "app": "evidence_page",
    "import": "importing",
    "export": "export",
    "render": "render",
    "view": "render",
    "optimize": "optimize",
    "store": "store",
}


class Verb(TyperCommand):
    """A verb as `pliant --help` lists it; the command itself, with its options, is made when it is called."""

    def __init__(self, name: str) -> None:
        self._function = name.replace("-", "_") + "_" * keyword.iskeyword(name)
        self._module = VERBS[name]
        super().__init__(name, help=_docstrings(self._module)[self._function])

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """The context of the real command: click goes on with that one."""
        with _interrupts_answered():
            return self.command().make_context(info_name, args, parent, **extra)

    def command(self) -> Any:
        """The command with its options."""
        function: Callable[..., None] = getattr(
            importlib.import_module(f"pliant.cli.{self._module}"), self._function
        )
        alone = typer.Typer(add_completion=False)
        alone.command(self.name)(function)
        return typer.main.get_command(alone)


@cache
def _docstrings(module: str) -> dict[str, str]:
    """Of a module's functions by their names, from its source: nothing is imported."""
    source = Path(__file__).with_name(f"{module}.py").read_text(encoding="utf-8")
    functions = (node for node in ast.parse(source).body if isinstance(node, ast.FunctionDef))
    return {function.name: ast.get_docstring(function) or "" for function in functions}


class Verbs(TyperGroup):
    """The group of all verbs."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        for name in VERBS:
            self.add_command(Verb(name))

    def make_context(self, *args: Any, **extra: Any) -> Any:
        """The context of the whole command line; reading its options imports modules too."""
        with _interrupts_answered():
            return super().make_context(*args, **extra)


@contextmanager
def _interrupts_answered() -> Iterator[None]:
    """Ctrl-C is answered with a sentence: typer itself would end without a word."""
    try:
        yield
    except KeyboardInterrupt:
        interrupted_at_start()


app = typer.Typer(
    name="pliant",
    help="Soft robots from finite elements to fast, honest chain models.",
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
