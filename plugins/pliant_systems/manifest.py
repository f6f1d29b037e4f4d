"""The components of models of your own; nothing heavy is imported here."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3
HERE = "pliant_systems"
# Kinds of the block `model` whose inputs and outputs these effects change.
MODELS = ("python", "mjcf")
EXAMPLE = str(Path(__file__).with_name("example_model.py"))


def _effect(kind: str, module: str, name: str, summary: str, config: str = "", **more: Any) -> Component:
    place = f"{HERE}.{module}:{name}"
    return Component("effect", kind, f"{HERE}.{module}:{config or name + 'Config'}", place, summary, **more)


@hookimpl
def pliant_components() -> Iterable[Component]:
    """Return the model `python`, and the effects of inputs, outputs and parameters."""
    i, o, p, v = "input_effects", "output_effects", "python_model", "named_values"
    return [
        Component(
            "model",
            "python",
            f"{HERE}.{p}:PythonModelConfig",
            f"{HERE}.{p}:PythonModel",
            "a Python function of time, inputs and parameters that returns readings",
            {"file": EXAMPLE},
        ),
        *(
            _effect(kind, module, name, summary, config, models=MODELS)
            for kind, module, name, config, summary in (
                ("actuation_gain", i, "InputGain", "ActuationGainConfig", "inputs act by a factor"),
                ("input_offset", i, "InputOffset", "", "inputs have a constant offset"),
                ("dead_zone", i, "InputDeadZone", "DeadZoneConfig", "small inputs have no effect"),
                ("supply_lag", i, "InputLag", "SupplyLagConfig", "inputs arrive through a first-order lag"),
                ("dead_time", i, "DeadTime", "", "inputs act late by one time"),
                ("backlash", i, "InputPlay", "InputPlayConfig", "inputs act through a play"),
                ("saturation", i, "Saturation", "", "large inputs are cut off"),
                ("leak", i, "InputLeak", "InputLeakConfig", "held inputs fade"),
                ("sensor_bias", o, "SensorBias", "", "readings have a constant offset"),
                ("sensor_scale", o, "SensorScale", "", "readings are off by a factor"),
                ("sensor_lag", o, "SensorLag", "", "readings follow through a first-order lag"),
                ("sensor_delay", o, "SensorDelay", "", "readings are late by one time"),
                ("misaligned_frame", o, "MisalignedFrame", "", "vectors are read in a turned frame"),
            )
        ),
        _effect(
            "parameter",
            v,
            "ParameterValue",
            "a parameter has another value",
            models=("python",),
        ),
        _effect("state", v, "StateEffect", "a declared effect of the state acts", models=("python",)),
    ]
