"""Manifest of the search: its verb, its blocks of a study, its records, the interface `optimizer`, the optimizers."""

from __future__ import annotations

from collections.abc import Iterable

from pliant.registry.block import Block
from pliant.registry.command import Command
from pliant.registry.component import Component
from pliant.registry.function import Function
from pliant.registry.hookspecs import hookimpl
from pliant.registry.interface import Interface
from pliant.registry.result_folder import ResultFolder
from pliant.registry.stored_record import StoredRecord

CONTRACT = 3
HERE = "pliant_search"
RECORDS = (
    "FoundDesign",
    "Robustness",
    "SearchHistory",
    "SearchResult",
    "PolishedCandidate",
    "SearchRound",
    "Slope",
    "VariableRecord",
    "Verification",
)


@hookimpl
def pliant_commands() -> Iterable[Command]:
    """Return the verb that searches."""
    return [Command("optimize", f"{HERE}.command:optimize")]


@hookimpl
def pliant_functions() -> Iterable[Function]:
    """Return the function that `pliant.api` and `pliant.Study` call."""
    return [Function("optimize", f"{HERE}.notebook:optimize")]


@hookimpl
def pliant_blocks() -> Iterable[Block]:
    """Return the blocks of a study that only a search reads."""
    return [
        Block(
            "search",
            model=f"{HERE}.config:SearchConfig",
            description="what `pliant optimize` varies and wants (docs/design_for_a_task.md)",
            reader="optimize",
            fixed="it is the search itself",
            check=f"{HERE}.variables:check_search",
            settings=f"{HERE}.paths:change_search_paths",
        ),
        Block(
            "optimizer",
            interface="optimizer",
            description="proposes designs; cmaes by default",
            reader="optimize",
            fixed="it is what searches",
        ),
    ]


@hookimpl
def pliant_interfaces() -> Iterable[Interface]:
    """Return the interface of optimizers."""
    return [
        Interface(
            "optimizer",
            config=f"{HERE}.optimizer:OptimizerConfig",
            bases=(f"{HERE}.optimizer:Optimizer",),
            checks=(f"{HERE}.conformance",),
        )
    ]


@hookimpl
def pliant_records() -> Iterable[StoredRecord]:
    """Return the records of a finished search."""
    return [StoredRecord(f"{HERE}.records:{name}") for name in RECORDS]


@hookimpl
def pliant_folders() -> Iterable[ResultFolder]:
    """Return the folder of a finished search."""
    return [
        ResultFolder("search", "data/search_page/digests.json", f"{HERE}.report.document:rebuild_search_page")
    ]


@hookimpl
def pliant_components() -> Iterable[Component]:
    """Return the optimizers."""
    return [
        Component(
            interface="optimizer",
            kind="cmaes",
            config=f"{HERE}.optimizers.config:CmaesConfig",
            implementation=f"{HERE}.optimizers.cmaes.optimizer:Cmaes",
            summary="CMA-ES by pycma: one objective, some hundreds of candidates or more",
            requires=("cma",),
            install="pip install 'pliant[search]'",
        ),
        Component(
            interface="optimizer",
            kind="optuna",
            config=f"{HERE}.optimizers.config:OptunaConfig",
            implementation=f"{HERE}.optimizers.optuna.optimizer:Optuna",
            summary="Optuna's samplers (TPE, NSGA-II, Gaussian process, …), with its dashboard; several objectives",
            requires=("optuna",),
            install="pip install 'pliant[search]'",
        ),
    ]
