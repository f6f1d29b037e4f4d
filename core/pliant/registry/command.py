"""Verbs of the command line in manifests; a verb's module is imported when it is called."""

from __future__ import annotations

import importlib.util
import inspect
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from pliant.registry.manifests import registered
from pliant.registry.place import is_place

NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")


@dataclass(frozen=True)
class Command:
    """A verb of the command line.

    Attributes:
        name: as typed, `optimize`.
        function: "module:function" with typer's annotations; its docstring is the help.
        package: name and version of the distribution; filled by `commands`.
    """

    name: str
    function: str
    package: str = ""

    @property
    def label(self) -> str:
        """The name in messages."""
        return f"command '{self.name}'"

    def problem(self) -> str | None:
        """Return an error in this entry, or None, without importing anything."""
        if not (isinstance(self.name, str) and NAME.fullmatch(self.name)):
            return f"a command has name {self.name!r}; write lower-case words joined by '-'"
        if not is_place(self.function):
            return f"{self.label} has function {self.function!r}; write 'package.module:function'"
        return None

    @cached_property
    def help(self) -> str:
        """The docstring of its function, from the source; "" without such a file."""
        module, _, name = self.function.partition(":")
        try:
            spec = importlib.util.find_spec(module)
            source = Path(str(spec and spec.origin)).read_text(encoding="utf-8")
        except (ImportError, OSError, ValueError):
            return ""
        # by its text, since parsing every module of the command line takes longer than printing the help
        found = re.search(rf'^def {name}\(.*?^    """(.*?)"""', source, re.DOTALL | re.MULTILINE)
        return inspect.cleandoc(found[1]) if found else ""


def commands() -> Mapping[str, Command]:
    """Return the verbs of all packages by name, in the order of `pliant --help`."""
    return registered("pliant_commands", Command)
