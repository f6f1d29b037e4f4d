"""Manifests: the modules that packages name under the entry-point group `pliant`; cheap to import for any verb."""

from __future__ import annotations

import importlib
import importlib.metadata
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from typing import Any, Protocol, TypeVar

import pluggy

from pliant.registry import hookspecs

GROUP = "pliant"
# Number of the plugin contract of this version; a manifest states it as CONTRACT.
CONTRACT_VERSION = 3
# Package name of the core's own manifest.
FRAME = "pliant"
# Manifest of the core; every other package is found by its entry point.
OWN = ("pliant.manifest",)


class Entry(Protocol):
    """An entry of a manifest: a command, a block, a stored record or an interface."""

    @property
    def name(self) -> str:
        """The name that no other entry of its hook has."""

    @property
    def label(self) -> str:
        """The name in messages."""

    @property
    def package(self) -> str:
        """Name and version of the distribution."""

    def problem(self) -> str | None:
        """Return an error in this entry, or None, without importing anything."""


E = TypeVar("E", bound=Entry)


def entry_points() -> list[importlib.metadata.EntryPoint]:
    """Return the entry points of the group, each once, sorted by name."""
    unique = {(e.name, e.value): e for e in importlib.metadata.entry_points(group=GROUP)}
    return [unique[key] for key in sorted(unique)]


def distribution_name(entry: importlib.metadata.EntryPoint) -> str:
    """Return name and version of the distribution of an entry point."""
    distribution = entry.dist
    try:
        name = distribution.name if distribution else None
    except Exception:  # a half-removed package has entry points and no metadata
        name = None
    return f"{name} {distribution.version}" if distribution and name else "unknown package"


def hooked(module: Any) -> pluggy.PluginManager:
    """Return pluggy's manager of one manifest.

    Raises:
        TypeError: the module implements no hook.
        pluggy.PluginValidationError: a hook that Pliant does not have.
    """
    manager = pluggy.PluginManager(hookspecs.PROJECT)
    manager.add_hookspecs(hookspecs)
    manager.register(module)
    manager.check_pending()
    if not any(getattr(manager.hook, name).get_hookimpls() for name in hookspecs.HOOKS):
        raise TypeError(
            f"{getattr(module, '__name__', module)} has no @hookimpl {' or '.join(hookspecs.HOOKS)}"
        )
    return manager


def registered(hook: str, kind: type[E]) -> Mapping[str, E]:
    """Return the entries that all packages register by a hook, by name: Pliant's own first, of equal names the first.

    A manifest that fails, or is written for another contract, adds none: `pliant plugins` states the cause.
    The manifests are read once for each set of installed packages.

    Args:
        hook: its name, such as `pliant_commands`.
        kind: class of the entries.
    """
    return _registered(hook, kind, importlib.metadata.entry_points, tuple(sys.path))


@cache
def _registered(
    hook: str, kind: type[E], reader: Callable[..., Any], path: tuple[str, ...]
) -> Mapping[str, E]:
    """Return `registered`; another reader of entry points, or another path, has other packages."""
    entries: dict[str, E] = {}
    for package, load in _manifests():
        try:
            module = load()
            if package != FRAME and getattr(module, "CONTRACT", 1) != CONTRACT_VERSION:
                continue
            answers: Iterable[Any] = getattr(hooked(module).hook, hook)()
            own = [entry for answer in answers for entry in answer]
        except KeyboardInterrupt:
            raise
        except BaseException:  # another package's manifest may fail in any way
            continue
        for entry in own:
            if isinstance(entry, kind) and not entry.problem():
                entries.setdefault(entry.name, replace(entry, package=package))  # type: ignore[type-var]
    return entries


def _manifests() -> Iterator[tuple[str, Callable[[], Any]]]:
    """Yield the package of each manifest, Pliant's own first, and the call that imports it."""
    for name in OWN:
        yield FRAME, lambda name=name: importlib.import_module(name)  # type: ignore[misc]
    for entry in entry_points():
        yield distribution_name(entry), entry.load
