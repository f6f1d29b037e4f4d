"""Hooks that a plugin package implements; each returns entries, which import nothing."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pluggy

PROJECT = "pliant"
HOOKS = (
    "pliant_components",
    "pliant_actuations",
    "pliant_commands",
    "pliant_blocks",
    "pliant_records",
    "pliant_interfaces",
    "pliant_folders",
    "pliant_data",
    "pliant_law_sources",
    "pliant_residual_models",
    "pliant_functions",
)
hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)


@hookspec
def pliant_components() -> Iterable[Any]:  # type: ignore[empty-body]
    """Return the package's `Component`s; must be cheap and must not import implementations."""


@hookspec
def pliant_actuations() -> Iterable[Any]:  # type: ignore[empty-body]
    """Return the `ActuationKind`s that the package adds: name, unit and travel of each."""


@hookspec
def pliant_commands() -> Iterable[Any]:  # type: ignore[empty-body]
    """Return a `Command` for each verb that the package adds to `pliant`, with the path of its function."""


@hookspec
def pliant_blocks() -> Iterable[Any]:  # type: ignore[empty-body]
    """Return a `Block` for each key that the package adds to a study file, with the path of its pydantic model."""


@hookspec
def pliant_records() -> Iterable[Any]:  # type: ignore[empty-body]
    """Return a `StoredRecord` for each dataclass that the package writes to the artifact store."""


@hookspec
def pliant_interfaces() -> Iterable[Any]:  # type: ignore[empty-body]
    """Return an `Interface` for each one that the package adds, of which any package registers components."""


@hookspec
def pliant_folders() -> Iterable[Any]:  # type: ignore[empty-body]
    """Return a `ResultFolder` for each kind of folder that the package's verbs write and `pliant report` shows."""


@hookspec
def pliant_data() -> Iterable[Any]:  # type: ignore[empty-body]
    """Return a `DataKind` for each kind of measured data that the package compares and diagnoses."""


@hookspec
def pliant_law_sources() -> Iterable[Any]:  # type: ignore[empty-body]
    """Return a `LawSource` for each block of a study from which laws of designs come."""


@hookspec
def pliant_residual_models() -> Iterable[Any]:  # type: ignore[empty-body]
    """Return a `ResidualModel` for each way to learn a term for what no listed effect explains."""


@hookspec
def pliant_functions() -> Iterable[Any]:  # type: ignore[empty-body]
    """Return a `Function` for each one that the package adds to Pliant's Python interface, with its path."""
