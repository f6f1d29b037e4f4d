"""Find plugins by entry points of group `pliant`; a broken one is remembered, never fatal."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import pluggy

from pliant.errors import UserError, closest
from pliant.interfaces.base import ComponentConfig
from pliant.registry import hookspecs
from pliant.registry.component import Component

GROUP = "pliant"


@dataclass(frozen=True)
class FailedPlugin:
    """A plugin package, or a kind that two packages define, that cannot be used, and why."""

    name: str
    package: str
    cause: str


@dataclass(frozen=True)
class Registry:
    """All components that were found, and what failed."""

    components: tuple[Component, ...]
    failures: tuple[FailedPlugin, ...] = ()
    clashes: Mapping[tuple[str, str], tuple[str, ...]] = field(default_factory=dict)

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
            components += ask(entry.load(), package)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # a plugin may fail in any way, even by sys.exit
            failures.append(FailedPlugin(name, package, _cause(error)))
    for module in extra:
        components += ask(module, module.__name__)
    return _without_clashes(components, failures)


def _entry_points() -> list[importlib.metadata.EntryPoint]:
    unique = {(e.name, e.value): e for e in importlib.metadata.entry_points(group=GROUP)}
    return [unique[key] for key in sorted(unique)]


def _package_of(entry: importlib.metadata.EntryPoint) -> str:
    distribution = entry.dist
    try:
        name = distribution.name if distribution else None
    except Exception:  # a half-removed package has entry points and no metadata
        name = None
    return f"{name} {distribution.version}" if distribution and name else "unknown package"


def ask(module: Any, package: str) -> list[Component]:
    """Call the module's hook through pluggy and check what it returns; raises what is wrong with it."""
    manager = pluggy.PluginManager(hookspecs.PROJECT)
    manager.add_hookspecs(hookspecs)
    manager.register(module)
    manager.check_pending()
    name = getattr(module, "__name__", module)
    if not manager.hook.pliant_components.get_hookimpls():
        raise TypeError(f"{name} has no @hookimpl pliant_components")
    answers = manager.hook.pliant_components()
    if not answers:
        raise TypeError(f"pliant_components of {name} returned None; it must return a list of Component")
    if isinstance(answers[0], Component):
        raise TypeError(f"pliant_components of {name} returned one Component; put it into a list")
    found = []
    for component in (c for answer in answers for c in answer):
        if not isinstance(component, Component):
            raise TypeError(f"pliant_components returned {component!r}, which is no Component")
        if problem := component.problem():
            raise ValueError(problem)
        found.append(component.from_package(package))
    return found


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
