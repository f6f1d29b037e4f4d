"""The model `mjcf` and the effects that act at its joints, tendons, bodies and world."""

from __future__ import annotations

from collections.abc import Iterable

from pliant.registry.component import Component
from pliant.registry.function import Function
from pliant.registry.hookspecs import hookimpl
from pliant_mjcf.effects_manifest import effect_components

CONTRACT = 3
HERE = "pliant_mjcf"


@hookimpl
def pliant_components() -> Iterable[Component]:
    """Return the components."""
    return [
        Component(
            "model",
            "mjcf",
            f"{HERE}.config:MjcfModelConfig",
            f"{HERE}.model:MjcfModel",
            "a MuJoCo model: inputs drive its actuators, its sensors are compared",
            requires=("mujoco",),
            install="pip install 'pliant[mujoco]'",
        ),
        *effect_components(),
    ]


@hookimpl
def pliant_functions() -> Iterable[Function]:
    """Return the function behind `pliant.MjcfModel`."""
    return [Function("mjcf_model", f"{HERE}.python_interface:mjcf_model")]
