"""The model `mjcf` and the effects that act at its joints, tendons, bodies and world."""

from __future__ import annotations

from collections.abc import Iterable

from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl
from pliant_mjcf.effects_manifest import effect_components

CONTRACT = 3


@hookimpl
def pliant_components() -> Iterable[Component]:
    """Return the components."""
    return [*effect_components()]
