"""Small plugins: one correct plugin per interface, and a table of modifications with the check that must fail."""

from __future__ import annotations

import functools
import importlib
import inspect
import pkgutil
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pliant.registry.component import Component
from pliant.registry.interface import interfaces

# Benches that break the suite of the interface `bench` are in tests/bench/bad_benches.py.
SUITES = ("common", *(name for name in interfaces() if name != "bench"))


@dataclass(frozen=True)
class Broken:
    """A broken component and the check that must detect it."""

    check: str
    component: Component


class Variants:
    """The broken variants of one correct component."""

    def __init__(self, good: Component) -> None:
        self.good = good
        self.all: list[Broken] = []

    def add(self, check: str, **changes: Any) -> None:
        """Add a component whose manifest entry is changed."""
        self.all.append(Broken(check, replace(self.good, **changes)))

    def by_config(self, check: str) -> Callable[[type], type]:
        """Return a decorator that adds a config model that breaks one check."""

        def register(cls: type) -> type:
            self.add(check, config=f"{cls.__module__}:{cls.__name__}")
            return cls

        return register

    def row_adder(self, base: type, part: str = "") -> Callable[..., None]:
        """Return a function that adds a row: the check, and by name the changed members of `base` or of a part of it.

        A function is a method; before `self` it gets the original method that it replaces. A part is the class that
        `base` has as this attribute, or as an attribute of one ("laws.made").
        """

        def row(check: str, **members: Any) -> None:
            module = sys.modules[base.__module__]
            name = f"Broken{len(vars(module))}"
            setattr(module, name, _changed(base, part.split(".") if part else (), members, name))
            self.add(check, implementation=f"{module.__name__}:{name}")

        return row


def _changed(base: type, path: Sequence[str], members: dict[str, Any], name: str) -> type:
    if path:
        members = {path[0]: _changed(getattr(base, path[0]), path[1:], members, name)}
    else:
        members = {k: _method(base, k, m) if inspect.isfunction(m) else m for k, m in members.items()}
    return type(
        name, (base,), {**members, "__module__": base.__module__, "__doc__": f"{name} of {base.__name__}."}
    )


def _method(base: type, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    def method(self: Any, *given: Any, **named: Any) -> Any:
        return function(functools.partial(getattr(base, name), self), self, *given, **named)

    return method


def good(interface: str) -> Component:
    """Return the correct component of an interface."""
    variants: Variants = importlib.import_module(f"{__name__}.{interface}").variants
    return variants.good


def broken_components(suite: str) -> list[Broken]:
    """Return the broken components of a suite, from its module and from modules `<suite>_...` that extend them."""
    variants: Variants = importlib.import_module(f"{__name__}.{suite}").variants
    for module in pkgutil.iter_modules(__path__):
        if module.name.startswith(f"{suite}_"):
            importlib.import_module(f"{__name__}.{module.name}")
    return variants.all
