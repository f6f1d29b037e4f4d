"""The hooks that a plugin package fills: its components, and new kinds of actuation where it has them."""

from __future__ import annotations

from collections.abc import Iterable

import pluggy

from pliant.records.actuation import ActuationKind
from pliant.registry.component import Component

PROJECT = "pliant"
hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)


@hookspec
def pliant_components() -> Iterable[Component]:  # type: ignore[empty-body]
    """Return the package's components; must be cheap and must not import implementations."""


@hookspec
def pliant_actuations() -> Iterable[ActuationKind]:  # type: ignore[empty-body]
    """Return the kinds of actuation that the package adds: name, unit and travel of each."""
