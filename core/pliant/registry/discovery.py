"""Find plugins by entry points of group `pliant`; a broken one is remembered, never fatal."""

from __future__ import annotations

import importlib.metadata
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import pluggy

from pliant.errors import UserError, closest
from pliant.interfaces.base import CONTRACT_VERSION, ComponentConfig
from pliant.registry import hookspecs
from pliant.registry.component import INTERFACES, Component

GROUP = "pliant"


@dataclass(frozen=True)
class FailedPlugin:
    """A plugin package, or one of its components, that could not be used, and why."""

    name: str
    package: str
    cause: str


@dataclass(frozen=True)
class Registry:
    """All components that were found, and what failed."""

    components: tuple[Component, ...]
    failures: tuple[FailedPlugin, ...] = ()
    clashes: dict[tuple[str, str], tuple[str, ...]] = field(default_factory=dict)

    def of(self, interface: str) -> tuple[Component, ...]:
        """Components of one interface, sorted by kind."""
        return tuple(sorted((c for c in self.components if c.interface == interface), key=lambda c: c.kind))

    def kinds(self, interface: str) -> list[str]:
        """Kinds of one interface."""
        return [component.kind for component in self.of(interface)]

    def get(self, interface: str, kind: str) -> Component:
        """The component of this kind; raises `UserError` with the close match and the plugins that failed."""
        if (interface, kind) in self.clashes:
            packages = " and ".join(self.clashes[interface, kind])
            raise UserError(f"{interface} '{kind}' is defined by {packages}; uninstall one of them.")
        for component in self.components:
            if (component.interface, component.kind) == (interface, kind):
                return component
        known = self.kinds(interface)
        message = f"unknown {interface} kind '{kind}'{closest(kind, known)}"
        message += f" Known kinds: {', '.join(known) or 'none is installed'}."
        if self.failures:
            names = ", ".join(f"{f.name} ({f.cause})" for f in self.failures)
            message += f" Plugins that failed to load: {names}."
        raise UserError(message)

    def build(self, interface: str, config: ComponentConfig) -> Any:
        """Build the implementation that belongs to a validated config."""
        return self.get(interface, config.kind).build(config)


def discover(extra: Iterable[ModuleType] = ()) -> Registry:
    """Load every entry point of group `pliant`; modules in `extra` are asked as if they were installed."""
    components: list[Component] = []
    failures: list[FailedPlugin] = []
    sources = [(entry.name, _package_of(entry), entry) for entry in _entry_points()]
    for name, package, entry in sources:
        try:
            components += _ask(entry.load(), package)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # a plugin may fail in any way, even by sys.exit
            failures.append(FailedPlugin(name, package, _cause(error)))
    for module in extra:
        components += _ask(module, module.__name__)
    return _without_clashes(components, failures)


def _entry_points() -> list[importlib.metadata.EntryPoint]:
    unique = {(e.name, e.value): e for e in importlib.metadata.entry_points(group=GROUP)}
    return [unique[key] for key in sorted(unique)]


def _package_of(entry: importlib.metadata.EntryPoint) -> str:
    distribution = entry.dist
    return f"{distribution.name} {distribution.version}" if distribution else "unknown package"


def _ask(module: Any, package: str) -> list[Component]:
    """Call the module's hook through pluggy and check what it returns."""
    manager = pluggy.PluginManager(hookspecs.PROJECT)
    manager.add_hookspecs(hookspecs)
    manager.register(module)
    manager.check_pending()
    answers = manager.hook.pliant_components()
    if not answers:
        raise TypeError(f"{getattr(module, '__name__', module)} has no @hookimpl pliant_components")
    found = []
    for component in (c for answer in answers for c in answer):
        _check(component)
        found.append(component.from_package(package))
    return found


def _check(component: object) -> None:
    if not isinstance(component, Component):
        raise TypeError(f"pliant_components returned {component!r}, which is no Component")
    if component.interface not in INTERFACES:
        raise ValueError(
            f"component '{component.kind}' has interface '{component.interface}'; "
            f"known: {', '.join(INTERFACES)}"
        )
    if component.contract != CONTRACT_VERSION:
        raise ValueError(
            f"{component.label} is written for contract {component.contract}, "
            f"this Pliant has {CONTRACT_VERSION}: update the plugin or Pliant"
        )


def _cause(error: BaseException) -> str:
    text = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return text.splitlines()[0]


def _without_clashes(components: list[Component], failures: list[FailedPlugin]) -> Registry:
    by_key: dict[tuple[str, str], list[Component]] = {}
    for component in components:
        by_key.setdefault((component.interface, component.kind), []).append(component)
    kept, clashes = [], {}
    for key, group in by_key.items():
        if len(group) == 1:
            kept.append(group[0])
            continue
        clashes[key] = tuple(c.package for c in group)
        failures.append(
            FailedPlugin(f"{key[0]} '{key[1]}'", " and ".join(clashes[key]), "the kind is defined twice")
        )
    return Registry(tuple(kept), tuple(failures), clashes)


def python_version() -> str:
    """The interpreter's version, as skip messages name it."""
    return ".".join(map(str, sys.version_info[:3]))
