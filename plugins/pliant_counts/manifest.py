"""The kind of data `counts` and its Python function; nothing that reads or simulates is imported here."""

from __future__ import annotations

from collections.abc import Iterable

from pliant.registry.data_kind import DataKind
from pliant.registry.function import Function
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3


@hookimpl
def pliant_data() -> Iterable[DataKind]:
    """Return the kind of data that `compare` and `diagnose` take in place of readings."""
    return [DataKind("counts", "pliant_counts.recognition:is_counted", "pliant_counts.data_kind:open_counts")]


@hookimpl
def pliant_functions() -> Iterable[Function]:
    """Return the function that `pliant.api` calls."""
    return [Function("compare_counts", "pliant_counts.data_kind:compare_counts_file")]
