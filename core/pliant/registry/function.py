"""Functions in manifests: what a package adds to Pliant's Python interface."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pliant.errors import MissingDependencyError
from pliant.registry.manifests import registered
from pliant.registry.place import imported, is_place
from pliant.registry.shipped import REMEDY

NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")


@dataclass(frozen=True)
class Function:
    """A function by which `pliant.api` and the methods of `pliant.Study` call a package.

    Attributes:
        name: by which it is called, `calibrate`.
        place: "module:function", imported at the first call.
        package: name and version of the distribution; filled by `functions`.
    """

    name: str
    place: str
    package: str = ""

    @property
    def label(self) -> str:
        """The name in messages."""
        return f"function '{self.name}'"

    def problem(self) -> str | None:
        """Return an error in this entry, or None, without importing anything."""
        if not (isinstance(self.name, str) and NAME.fullmatch(self.name)):
            return f"a function has name {self.name!r}; write lower-case words joined by '_'"
        if not is_place(self.place):
            return f"{self.label} has place {self.place!r}; write 'package.module:function'"
        return None


def functions() -> Mapping[str, Function]:
    """Return the functions of all packages by name."""
    return registered("pliant_functions", Function)


def package_function(name: str, package: str) -> Callable[..., Any]:
    """Import a function of a feature package.

    Raises:
        MissingDependencyError: the package `package` is not installed.
    """
    entry = functions().get(name)
    if entry is None:
        raise MissingDependencyError(f"'{name}' belongs to the package {package}, {REMEDY}.")
    function: Callable[..., Any] = imported(entry.place)
    return function
