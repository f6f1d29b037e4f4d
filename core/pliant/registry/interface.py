"""Interfaces in manifests: what a component can be, and the base classes that its config and implementation have."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pliant.registry.manifests import registered
from pliant.registry.place import imported, is_place

NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")


@dataclass(frozen=True)
class Interface:
    """An interface of which packages register components.

    Attributes:
        name: as a component states it, `optimizer`.
        config: "module:Class", base of the config models of its components.
        bases: "module:Class" of the base classes; an implementation subclasses one of them.
        checks: modules with the checks of its conformance suite, in addition to those of every component.
        package: name and version of the distribution; filled by `interfaces`.
    """

    name: str
    config: str
    bases: tuple[str, ...]
    checks: tuple[str, ...] = ()
    package: str = ""

    @property
    def label(self) -> str:
        """The name in messages."""
        return f"interface '{self.name}'"

    def problem(self) -> str | None:
        """Return an error in this entry, or None, without importing anything."""
        if not (isinstance(self.name, str) and NAME.fullmatch(self.name)):
            return f"an interface has name {self.name!r}; write lower-case words joined by '_'"
        for name in ("bases", "checks"):
            value = getattr(self, name)
            if not (isinstance(value, tuple) and all(isinstance(item, str) for item in value)):
                return f"{self.label} has {name} {value!r}; write a tuple of texts"
        for place in (self.config, *self.bases):
            if not is_place(place):
                return f"{self.label} names {place!r}; write it as 'package.module:Class'"
        if not self.bases:
            return f"{self.label} has no base class"
        return None

    def config_class(self) -> type[Any]:
        """Import the base of the config models."""
        base: type[Any] = imported(self.config)
        return base

    def base_classes(self) -> tuple[type[Any], ...]:
        """Import the base classes of the implementations."""
        return tuple(imported(place) for place in self.bases)


def interfaces() -> Mapping[str, Interface]:
    """Return the interfaces of all packages by name, in the order of `pliant plugins`."""
    return registered("pliant_interfaces", Interface)
