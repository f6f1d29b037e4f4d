"""Small plugins: one good one per interface, and for every check one that is spoiled in exactly that way."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from pliant.registry.component import INTERFACES, Component

SUITES = ("common", *INTERFACES)


@dataclass(frozen=True)
class Spoil:
    """A spoiled component, the check that must find it and a pattern that its message must hold."""

    check: str
    component: Component
    says: str


class Spoils:
    """The spoiled variants of one good component."""

    def __init__(self, good: Component) -> None:
        self.good = good
        self.all: list[Spoil] = []

    def add(self, check: str, says: str, **changes: Any) -> None:
        """A component whose manifest entry is changed."""
        self.all.append(Spoil(check, replace(self.good, **changes), says))

    def by(self, check: str, says: str) -> Callable[[type], type]:
        """Decorator: an implementation that spoils one check."""

        def register(cls: type) -> type:
            self.add(check, says, implementation=f"{cls.__module__}:{cls.__name__}")
            return cls

        return register

    def by_config(self, check: str, says: str) -> Callable[[type], type]:
        """Decorator: a config model that spoils one check."""

        def register(cls: type) -> type:
            self.add(check, says, config=f"{cls.__module__}:{cls.__name__}")
            return cls

        return register


def good(interface: str) -> Component:
    """The good component of an interface."""
    spoils: Spoils = importlib.import_module(f"spoiled.{interface}").spoils
    return spoils.good


def of(suite: str) -> list[Spoil]:
    """The spoiled components of a suite: those of its module, and of modules `<suite>_...` that add to them."""
    spoils: Spoils = importlib.import_module(f"spoiled.{suite}").spoils
    for module in pkgutil.iter_modules(__path__):
        if module.name.startswith(f"{suite}_"):
            importlib.import_module(f"spoiled.{module.name}")
    return spoils.all
