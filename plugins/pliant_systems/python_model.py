"""Models that are Python functions: a file with the names of inputs and outputs, parameters, and `simulate`.

    INPUTS = {"voltage": (0.0, 5.0)}               # or a tuple of names; a range is optional
    OUTPUTS = ("angle_rad",)
    PARAMETERS = {"stiffness": (2.0, 1.0, 4.0, "N*m/rad", "stiffness of the hinge")}   # value, plausible range, …
    MISSING = {"air_drag": (0.0, 0.0, 0.2)}        # effects of the state that the model may lack, neutral first
    DERIVATIVES = "jax"                            # or "torch"; optional


    def simulate(time_s, inputs, parameters):
        ...
        return {"angle_rad": angle}

`inputs` and the returned readings are arrays (t,) by name, `parameters` the numbers of both tables by name. A function
`simulate(time_s, inputs, parameters, first=…)` gets the readings of the run's first sample by output, to start there.
With `DERIVATIVES` all three arguments are arrays of that library, and slopes in the file's numbers are its derivatives;
JAX arrays among the readings have the same effect. Other slopes are differences.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from pliant.errors import UserError
from pliant.interfaces.effect import AT, EffectParameter
from pliant.interfaces.model import Channel, Drive, ModelConfig, SystemModel, SystemParts, SystemReadings
from pliant.pipeline.workbench import digest
from pliant.registry.blame import describe_error
from pliant.registry.files import place_of
from pliant_systems.derivatives import JAX, as_array, in_library, is_jax, linearized
from pliant_systems.python_file import TABLES, PythonFile, StatedNumber, read_python_file, stated_number


class PythonModelConfig(ModelConfig):
    """``model: {kind: python, file: my_model.py}``."""

    kind: Literal["python"] = "python"
    file: Path = Field(description="the Python file, relative to the study")


class PythonModel(SystemModel):
    """A user's function as a model."""

    config: PythonModelConfig
    threads = False

    @cached_property
    def file(self) -> PythonFile:
        """The executed file; raises `UserError` for a file that fails or has a wrong entry."""
        return read_python_file(self.config.file)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.config,)

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """Return the channels of INPUTS."""
        return self.file.inputs

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Return the channels of OUTPUTS."""
        return self.file.outputs

    @property
    def attachments(self) -> Mapping[str, tuple[str, ...]]:
        """Return the names of parameters, and of effects of the state that the model may lack."""
        return {place: tuple(names) for place, names in self.file.tables.items()}

    def default_kinds(self, kinds: Sequence[str]) -> list[str]:
        """Return all kinds, and one for each parameter and each declared effect of the state."""
        own = [f"{place}{AT}{name}" for place, names in self.file.tables.items() for name in names]
        return [*(kind for kind in kinds if kind not in TABLES), *own]

    def _stated(self, kind: str) -> StatedNumber | None:
        """Return the number that an effect changes; None for other effects."""
        place, at, name = kind.partition(AT)
        return stated_number(self.file, place, name) if at and place in TABLES else None

    def adapted(self, kind: str, declared: EffectParameter) -> EffectParameter:
        """Return the value's range and unit as the file states it."""
        stated = self._stated(kind)
        if stated is None:
            return declared
        value, low, high = stated.value, stated.low, stated.high
        span = high - low
        bounds = (min(low - 2 * span, value), max(high + 2 * span, value))
        if low >= 0.0 and value >= 0.0:
            bounds = (0.0, bounds[1])
        return replace(declared, neutral=value, bounds=bounds, plausible=(low, high), unit=stated.unit)

    def words(self, kind: str) -> str:
        """Return the file's words on a number."""
        stated = self._stated(kind)
        return "" if stated is None else stated.words

    def simulate(self, parts: SystemParts, drives: Sequence[Drive]) -> tuple[SystemReadings, ...]:
        """Return the readings that the function gives; raise `UserError` for one that fails or has another length."""
        values = self._values(parts)
        return tuple(self._checked(drive, self._called(drive, values)) for drive in drives)

    def vary(
        self, parts: SystemParts, towards: Sequence[SystemParts], drives: Sequence[Drive]
    ) -> tuple[tuple[SystemReadings, ...], tuple[tuple[SystemReadings, ...], ...]] | None:
        """Return readings and derivatives by the file's library; None for a file of numpy."""
        values = self._values(parts)
        library = self.file.library
        if not library and is_jax(self._called(drives[0], values)):
            library = JAX
        if not library:
            return None
        moved = [self._values(other) for other in towards]
        directions = [{name: other[name] - value for name, value in values.items()} for other in moved]
        runs = []
        for drive in drives:
            try:
                found, changes = linearized(library, partial(self._readings, drive), values, directions)
            except UserError:
                raise
            except Exception as error:
                if not self.file.library:
                    return None
                raise UserError(
                    f"{self._place(error)}: simulate cannot be differentiated by {library} in run "
                    f"'{drive.history.run}' ({describe_error(error)}); compute with {library} alone, or leave out "
                    "DERIVATIVES."
                ) from error
            runs.append((self._checked(drive, found), [self._checked(drive, one) for one in changes]))
        return tuple(run for run, _ in runs), tuple(
            tuple(changes[k] for _, changes in runs) for k in range(len(towards))
        )

    def _values(self, parts: SystemParts) -> dict[str, float]:
        values = {name: one.value for names in self.file.tables.values() for name, one in names.items()}
        for change in parts.changes:
            stated_number(self.file, change.place, change.name)
            values[change.name] = change.value
        return values

    def _called(self, drive: Drive, values: Mapping[str, float]) -> Mapping[str, Any]:
        """Return what the function gives for a run; raise `UserError` if it fails."""
        at = {name: in_library(self.file.library, value) for name, value in values.items()}
        try:
            return self._readings(drive, at)
        except UserError:
            raise
        except (Exception, SystemExit) as error:  # the user's code may raise anything
            raise UserError(
                f"{self._place(error)}: simulate fails in run '{drive.history.run}' ({describe_error(error)})."
            ) from error

    def _readings(self, drive: Drive, at: Mapping[str, Any]) -> dict[str, Any]:
        """Return the outputs that the function gives, in arrays of its library."""
        where, history, library = self.file.where, drive.history, self.file.library
        simulate = self.file.simulate
        assert history.time_s is not None
        time_s = in_library(library, history.time_s.copy())
        inputs = {name: in_library(library, v.copy()) for name, v in history.actuation.items()}
        more = {"first": dict(drive.first)} if _takes_first(simulate) else {}
        with np.errstate(all="ignore"):  # a run that diverges is reported once, not at every step
            found = simulate(time_s, inputs, dict(at), **more)
        if not isinstance(found, Mapping):
            raise UserError(
                f"{where}: simulate returns {_article(found)}; return a dict of arrays by output, such as "
                f"{{'{self.outputs[0].name}': values}}."
            )
        for channel in self.outputs:
            if channel.name not in found:
                has = ", ".join(map(str, found)) or "nothing"
                raise UserError(
                    f"{where}: simulate returns no '{channel.name}', which OUTPUTS has; it returns {has}."
                )
        return {channel.name: found[channel.name] for channel in self.outputs}

    def _checked(self, drive: Drive, readings: Mapping[str, Any]) -> SystemReadings:
        """Return the readings of a run as arrays of numpy, NaN from the first that is not finite."""
        n, checked = len(drive.history), {}
        for name, values in readings.items():
            try:
                found = as_array(values)
            except (TypeError, ValueError):
                raise UserError(
                    f"{self.file.where}: simulate returns '{name}' as {_article(values)} that is no array of numbers; "
                    f"return {n} numbers."
                ) from None
            if found.shape != (n,):
                raise UserError(
                    f"{self.file.where}: simulate returns '{name}' of shape {found.shape} in run "
                    f"'{drive.history.run}', which has {n} samples; return an array ({n},)."
                )
            checked[name] = np.where(np.maximum.accumulate(~np.isfinite(found)), np.nan, found)
        return checked

    def _place(self, error: BaseException) -> str:
        return place_of(self.config.file, error)

    def fingerprint(self) -> Mapping[str, Any]:
        """Return the digest of the file."""
        return {"file": digest(self.config.file)}


def _takes_first(function: Any) -> bool:
    try:
        return "first" in inspect.signature(function).parameters
    except (TypeError, ValueError):  # a compiled function
        return False


def _article(value: Any) -> str:
    """Return the type of a value with its article: ``a list``, ``an ndarray``, ``None``."""
    name = type(value).__name__
    return "None" if value is None else f"a{'n' if name[0].lower() in 'aeiou' else ''} {name}"
