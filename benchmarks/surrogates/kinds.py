"""Surrogates by kind through the registry, and the designs that benchmarks fit them to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks.output import ROOT

from pliant.errors import UserError
from pliant.interfaces.surrogate import Surrogate
from pliant.records.fem import ModuleData
from pliant.registry.discovery import Registry, discover
from pliant.tabular.fem_reading import read_designs_table, read_module_table

BENDING_GRID = ROOT / "examples/designs/bending_grid.csv"
HELICAL_GRID = ROOT / "examples/designs/helical_grid.csv"
BENDING_REFERENCE = ROOT / "examples/data/bellow_bending.csv"
# What laws of one axis are compared: name → kind and config.
FORMS: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "polynomial, adaptive": ("polynomial", {}),
    "polynomial, study, least squares": ("polynomial", {"form": "study"}),
    "polynomial, study, differences": ("polynomial", {"form": "study", "procedure": "finite_differences"}),
    "table": ("table", {}),
    "neural": ("neural", {}),
}


def surrogate(name: str, registry: Registry | None = None) -> Surrogate | None:
    """The surrogate of one of `FORMS`; None where its kind is not installed."""
    kind, config = FORMS[name]
    known = registry or discover()
    try:
        component = known.get("surrogate", kind)
        built: Surrogate = component.build(component.config_model().model_validate({"kind": kind, **config}))
    except UserError:
        return None
    return built


def bending_designs() -> list[ModuleData]:
    """The grid of bending designs."""
    return read_designs_table(BENDING_GRID)


def helical_designs() -> list[ModuleData]:
    """The grid of helical designs, three axes."""
    return read_designs_table(HELICAL_GRID)


def bending_reference() -> ModuleData:
    """The reference bending design."""
    return read_module_table(BENDING_REFERENCE)
