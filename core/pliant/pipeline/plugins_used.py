"""The plugins that computed a finished run: recorded in its folder, named in an error if one is not installed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pliant.errors import UserError
from pliant.registry.component import Component
from pliant.registry.discovery import Registry


def find_run_component(
    registry: Registry, interface: str, kind: str, folder: Path, index: Mapping[str, Any]
) -> Component:
    """Return the plugin that a run's folder needs; raises `UserError` with its package if it is not installed."""
    if kind in registry.kinds(interface):
        return registry.get(interface, kind)
    used = (one for one in index.get("plugins", ()) if (one["interface"], one["kind"]) == (interface, kind))
    package = next((str(one["package"]) for one in used), "")
    try:
        return registry.get(interface, kind)
    except UserError as error:
        if not package:
            raise
        raise UserError(
            f"{folder} was computed with {interface} '{kind}' of {package}, which is needed to read it; install that "
            f"package. Here: {error}"
        ) from None


def used_plugins(manifests: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """Return the plugins that computed some artifacts: interface, kind and package of each, once."""
    every = [dict(plugin) for manifest in manifests for plugin in manifest.get("plugins", ())]
    return list({tuple(sorted(plugin.items())): plugin for plugin in every}.values())
