"""Models that are Python functions: a file with the names of inputs and outputs, parameters, and `simulate`.

    INPUTS = ("voltage",)
    OUTPUTS = ("angle_rad",)
    PARAMETERS = {"stiffness": (2.0, 1.0, 4.0)}    # value, and the plausible range
    MISSING = {"air_drag": (0.0, 0.0, 0.2)}        # effects of the state that the model may lack, neutral first


    def simulate(time_s, inputs, parameters):
        ...
        return {"angle_rad": angle}

`inputs` and the returned readings are arrays (t,) by name, `parameters` values of both tables by name. A function
`initial`, if there is one, gives the readings of a run's first sample as `simulate(…, first=…)`.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np
from pydantic import Field

from pliant.errors import UserError
from pliant.interfaces.effect import AT, EffectConfig, EffectNotes, EffectParameter, parameter
from pliant.interfaces.model import (
    Channel,
    Drive,
    ModelConfig,
    SystemEffect,
    SystemModel,
    SystemParts,
    SystemReadings,
)
from pliant.pipeline.workbench import digest
from pliant.records.design import Array
from pliant.registry.blame import describe_error
from pliant.registry.files import load_module, shown
from pliant.units import split_unit

PARAMETER, STATE = "parameter", "state"
TABLES = {PARAMETER: "PARAMETERS", STATE: "MISSING"}


class PythonModelConfig(ModelConfig):
    """``model: {kind: python, file: my_model.py}``."""

    kind: Literal["python"] = "python"
    file: Path = Field(description="the Python file, relative to the study", examples=["my_model.py"])


class PythonModel(SystemModel):
    """A user's function as a model."""

    config: PythonModelConfig
    threads = False

    @cached_property
    def module(self) -> ModuleType:
        """The executed file; raises `UserError` for a file that fails or lacks a name."""
        module = load_module(self.config.file)
        for name in ("INPUTS", "OUTPUTS", "simulate"):
            if not hasattr(module, name):
                raise UserError(
                    f"{shown(self.config.file)}: the model has no {name}; it needs INPUTS, OUTPUTS and "
                    "simulate(time_s, inputs, parameters)."
                )
        return module

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.config,)

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """Return the channels of INPUTS."""
        return self._channels("INPUTS", "input")

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Return the channels of OUTPUTS."""
        return self._channels("OUTPUTS", "output")

    def _channels(self, name: str, what: str) -> tuple[Channel, ...]:
        stated = getattr(self.module, name)
        ranges = stated if isinstance(stated, Mapping) else {}
        found = []
        for one in stated:
            low, high = ranges.get(one) or (None, None)
            found.append(Channel(one, split_unit(one)[1], f"{what} '{one}'", low, high))
        return tuple(found)

    @cached_property
    def stated(self) -> Mapping[str, Mapping[str, tuple[float, float, float]]]:
        """The tables PARAMETERS and MISSING: value, lowest and highest plausible value by name."""
        found: dict[str, dict[str, tuple[float, float, float]]] = {}
        for place, table in TABLES.items():
            found[place] = {}
            for name, entry in getattr(self.module, table, {}).items():
                numbers = tuple(float(one) for one in np.ravel(entry)[:3])
                if len(numbers) != 3 or not numbers[1] < numbers[2]:
                    raise UserError(
                        f"{shown(self.config.file)}: {table}['{name}'] is {entry!r}; write (value, lowest plausible, "
                        "highest plausible)."
                    )
                found[place][name] = (numbers[0], numbers[1], numbers[2])
        return found

    @property
    def attachments(self) -> Mapping[str, tuple[str, ...]]:
        """Return the names of parameters, and of effects of the state that the model may lack."""
        return {place: tuple(names) for place, names in self.stated.items()}

    def default_kinds(self, kinds: Sequence[str]) -> list[str]:
        """Return all kinds, and one for each parameter and each declared effect of the state."""
        own = [f"{place}{AT}{name}" for place, names in self.stated.items() for name in names]
        return [*(kind for kind in kinds if kind not in TABLES), *own]

    def adapted(self, kind: str, declared: EffectParameter) -> EffectParameter:
        """Return the value's range as the file states it."""
        place, _, name = kind.partition(AT)
        if place not in TABLES:
            return declared
        if name not in self.stated[place]:
            raise UserError(f"{shown(self.config.file)}: {TABLES[place]} has no '{name}'.")
        value, low, high = self.stated[place][name]
        span = high - low
        bounds = (min(low - 2 * span, value), max(high + 2 * span, value))
        if low >= 0.0 and value >= 0.0:
            bounds = (0.0, bounds[1])
        return replace(declared, neutral=value, bounds=bounds, plausible=(low, high))

    def simulate(self, parts: SystemParts, drives: Sequence[Drive]) -> tuple[SystemReadings, ...]:
        """Return the readings that the function gives; raise `UserError` for one that fails or has another length."""
        values = {name: entry[0] for names in self.stated.values() for name, entry in names.items()}
        for change in parts.changes:
            values[change.name] = change.value
        return tuple(self._run(drive, values) for drive in drives)

    def _run(self, drive: Drive, values: Mapping[str, float]) -> SystemReadings:
        where, history = shown(self.config.file), drive.history
        simulate: Callable[..., Any] = self.module.simulate
        more = {"first": dict(drive.first)} if "first" in inspect.signature(simulate).parameters else {}
        inputs = {name: v.copy() for name, v in history.actuation.items()}
        assert history.time_s is not None
        try:
            found = simulate(history.time_s.copy(), inputs, dict(values), **more)
        except Exception as error:  # the user's code may raise anything
            raise UserError(
                f"{where}: simulate fails in run '{history.run}' ({describe_error(error)})."
            ) from error
        if not isinstance(found, Mapping):
            raise UserError(
                f"{where}: simulate returns {type(found).__name__}; return a dict of arrays by output."
            )
        readings: SystemReadings = {}
        for channel in self.outputs:
            if channel.name not in found:
                raise UserError(f"{where}: simulate returns no '{channel.name}', which OUTPUTS has.")
            readings[channel.name] = self._checked(
                channel.name, found[channel.name], len(history), history.run
            )
        return readings

    def _checked(self, name: str, values: Any, n: int, run: str) -> Array:
        found = np.asarray(values, float)
        if found.shape != (n,):
            raise UserError(
                f"{shown(self.config.file)}: simulate returns '{name}' of shape {found.shape} in run '{run}', which "
                f"has {n} samples; return an array ({n},)."
            )
        return np.where(np.maximum.accumulate(~np.isfinite(found)), np.nan, found)

    def remarks(self, drives: Sequence[Drive]) -> tuple[str, ...]:
        """Return nothing."""
        return ()

    def fingerprint(self) -> Mapping[str, Any]:
        """Return the digest of the file."""
        return {"file": digest(self.config.file)}


class ModelValue(EffectConfig):
    """A number of the model at another value."""

    kind: str = Field(
        "parameter@name", pattern=f"^({PARAMETER}|{STATE}){AT}.+$", examples=["parameter@stiffness"]
    )
    value: float = parameter(
        unit="1", neutral=0.0, bounds=(-1e300, 1e300), plausible=(-1.0, 1.0), example=1.0
    )
    """value of the parameter, in the unit of the file"""


class NamedValue(SystemEffect):
    """A number of the model's file at another value than the file states."""

    config: ModelValue
    name: str = ""
    value: float = 0.0

    def act(self, parts: SystemParts) -> SystemParts:
        """Return the parts with the value."""
        name = self.config.kind.partition(AT)[2]
        if not name:
            raise UserError(f"effect '{self.config.kind}' needs a name: '{self.config.kind}{AT}stiffness'")
        return parts.with_change(_Value(name, self.config.value))


class _Value:
    """A value by name."""

    def __init__(self, name: str, value: float) -> None:
        self.name, self.value = name, value


class ParameterValue(NamedValue):
    """A parameter that differs from the file's value."""

    place = "parameter"
    notes = EffectNotes(
        signature="a number of the model differs from its stated value.",
        inspection="measure the quantity itself.",
        excitation="runs in which the quantity matters: see the model.",
        where="models with PARAMETERS.",
    )


class StateEffect(NamedValue):
    """An effect of the state that the file declares and leaves out by default."""

    place = "state"
    notes = EffectNotes(
        signature="as the model's file describes it.",
        inspection="as the model's file describes it.",
        excitation="runs in which the effect acts: see the model.",
        where="models with MISSING.",
    )
