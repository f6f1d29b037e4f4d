"""Small plugins: one good one per interface, and for every check one that is broken in exactly that way."""

from __future__ import annotations

import importlib
import pkgutil
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from pliant.registry.component import INTERFACES, Component

SUITES = ("common", *INTERFACES)


@dataclass(frozen=True)
class Broken:
    """A broken component, the check that must find it and a pattern that its message must hold."""

    check: str
    component: Component
    says: str


class Variants:
    """The broken variants of one good component."""

    def __init__(self, good: Component) -> None:
        self.good = good
        self.all: list[Broken] = []

    def add(self, check: str, says: str, **changes: Any) -> None:
        """A component whose manifest entry is changed."""
        self.all.append(Broken(check, replace(self.good, **changes), says))

    def by(self, check: str, says: str) -> Callable[[type], type]:
        """Decorator: an implementation that breaks one check."""

        def register(cls: type) -> type:
            self.add(check, says, implementation=f"{cls.__module__}:{cls.__name__}")
            return cls

        return register

    def by_config(self, check: str, says: str) -> Callable[[type], type]:
        """Decorator: a config model that breaks one check."""

        def register(cls: type) -> type:
            self.add(check, says, config=f"{cls.__module__}:{cls.__name__}")
            return cls

        return register

    def by_part(self, base: type, attribute: str) -> Callable[[str, str], Callable[[type], type]]:
        """A decorator like `by`, for a part: the implementation is `base` with this part as its `attribute`."""

        def by(check: str, says: str) -> Callable[[type], type]:
            def register(part: type) -> type:
                members = {attribute: part, "__doc__": part.__doc__, "__module__": part.__module__}
                whole = type(f"With{part.__name__}", (base,), members)
                setattr(sys.modules[part.__module__], whole.__name__, self.by(check, says)(whole))
                return part

            return register

        return by


def good(interface: str) -> Component:
    """The good component of an interface."""
    variants: Variants = importlib.import_module(f"broken.{interface}").variants
    return variants.good


def of(suite: str) -> list[Broken]:
    """The broken components of a suite: those of its module, and of modules `<suite>_...` that add to them."""
    variants: Variants = importlib.import_module(f"broken.{suite}").variants
    for module in pkgutil.iter_modules(__path__):
        if module.name.startswith(f"{suite}_"):
            importlib.import_module(f"broken.{module.name}")
    return variants.all
