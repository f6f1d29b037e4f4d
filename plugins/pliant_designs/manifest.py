"""Manifest of sweeps and meta-models: their blocks, functions, interface and kinds; nothing that fits is imported."""

from __future__ import annotations

from collections.abc import Iterable

from pliant.registry.block import Block
from pliant.registry.component import Component
from pliant.registry.function import Function
from pliant.registry.hookspecs import hookimpl
from pliant.registry.interface import Interface
from pliant.registry.law_source import LawSource

CONTRACT = 3
HERE = "pliant_designs"


@hookimpl
def pliant_blocks() -> Iterable[Block]:
    """Return the blocks of a study about many designs."""
    return [
        Block(
            "sweep",
            f"{HERE}.config:SweepConfig",
            description="the designs that `pliant fem` solves",
            paths=("designs",),
            fixed="its designs are what the meta-model is fitted to",
            check=f"{HERE}.sweep_designs:check_sweep",
            unused=f"{HERE}.config:unused_sweep",
        ),
        Block(
            "meta_model",
            interface="meta_model",
            description="one model over the designs of a sweep, which gives the law of any other",
            paths=("data",),
            unused=f"{HERE}.config:unused_surrogate",
        ),
    ]


@hookimpl
def pliant_law_sources() -> Iterable[LawSource]:
    """Return the meta-model as a source of laws."""
    return [LawSource("meta_model", f"{HERE}.stage:unseen_laws", f"{HERE}.stage:read_law")]


@hookimpl
def pliant_functions() -> Iterable[Function]:
    """Return the functions that `pliant fem`, `pliant fit` and `pliant.api` call."""
    return [
        Function("sweep", f"{HERE}.sweep:sweep_study"),
        Function("meta_model", f"{HERE}.unseen_designs:meta_model"),
        Function("report_sweep", f"{HERE}.command:report_sweep"),
        Function("fit_meta_model", f"{HERE}.command:fit_meta_model"),
    ]


@hookimpl
def pliant_interfaces() -> Iterable[Interface]:
    """Return the interface of meta-models."""
    return [
        Interface(
            "meta_model",
            config=f"{HERE}.meta_model:MetaModelConfig",
            bases=(f"{HERE}.meta_model:MetaModel",),
            checks=(f"{HERE}.conformance",),
        )
    ]


@hookimpl
def pliant_components() -> Iterable[Component]:
    """Return the meta-models."""
    return [
        Component(
            interface="meta_model",
            kind="regression",
            config=f"{HERE}.meta_models.config:RegressionConfig",
            implementation=f"{HERE}.meta_models.regression:Regression",
            summary="Gaussian processes, kernel ridge or polynomials of the design, whichever does better",
            example={"regressor": "gaussian_process"},
            requires=("sklearn",),
            install="pip install 'pliant[meta]'",
        ),
        Component(
            interface="meta_model",
            kind="coefficients",
            config=f"{HERE}.meta_models.config:CoefficientsConfig",
            implementation=f"{HERE}.meta_models.coefficients:Coefficients",
            summary="network 64-64-32 from the design to the coefficients of its law",
            example={"starts": 2},
            requires=("torch",),
            install="pip install 'pliant[neural]'",
        ),
        Component(
            interface="meta_model",
            kind="neural",
            config=f"{HERE}.meta_models.config:NeuralMetaConfig",
            implementation=f"{HERE}.meta_models.neural:NeuralMetaModel",
            summary="one network of design, actuation and deformation: an energy, or torques as in the study",
            example={"units": 16, "steps": 200},
            requires=("torch",),
            install="pip install 'pliant[neural]'",
        ),
    ]
