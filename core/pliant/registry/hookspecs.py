"""The one hook that a plugin package fills."""

from __future__ import annotations

from collections.abc import Iterable

import pluggy

from pliant.registry.component import Component

PROJECT = "pliant"
hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)


@hookspec
def pliant_components() -> Iterable[Component]:  # type: ignore[empty-body]
    """Return the package's components; must be cheap and must not import implementations."""
