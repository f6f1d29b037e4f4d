"""SystemModel: a user's own model of a system, which a study names in its block `model`.

It declares what drives it (`inputs`), what it reads (`outputs`), where effects can act (`attachments`), and simulates
runs from the histories of its inputs.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pliant.errors import UserError, closest
from pliant.interfaces.base import ComponentConfig, Configured
from pliant.interfaces.effect import AT, Effect, EffectParameter, Model, SignalMaps
from pliant.records.design import Array
from pliant.records.history import History


class ModelConfig(ComponentConfig):
    """Base of the block `model`."""


@dataclass(frozen=True)
class Channel:
    """An input or an output of a system.

    Attributes:
        name: in measurements and messages, with its SI unit at the end: ``shoulder_n_m``.
        unit: SI unit; "" for a pure number.
        label: the actuator or sensor of the model: ``actuator 'shoulder'``.
        low, high: allowed range of an input, SI; None without a limit.
    """

    name: str
    unit: str = ""
    label: str = ""
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, eq=False)
class SystemParts(SignalMaps):
    """What effects change of a system: its signals, and the parts that its own kind of model knows.

    Attributes:
        scales: largest magnitude of each input and output in the measured runs, SI; 1 where nothing is known.
        names: names of the inputs, then of the outputs.
        changes: what effects at the model's attachment points add, in their order; the model's package defines them.
    """

    scales: Mapping[str, float] = field(default_factory=dict, kw_only=True)
    names: tuple[tuple[str, ...], tuple[str, ...]] = field(default=((), ()), kw_only=True)
    changes: tuple[Any, ...] = field(default=(), kw_only=True)

    def with_change(self, change: object) -> SystemParts:
        """Return a copy with an additional change of the model."""
        return replace(self, changes=(*self.changes, change))


@dataclass(frozen=True, eq=False)
class Drive:
    """A run to simulate.

    Attributes:
        history: the inputs that reach the system, after the effects' maps, by channel; straight lines between samples.
        first: the readings of the run's first sample by output, SI; empty where none was read.
    """

    history: History
    first: Mapping[str, float] = field(default_factory=dict)


SystemReadings = dict[str, Array]


@dataclass(frozen=True, eq=False)
class Improved:
    """A study's model with its effects, for an export.

    Attributes:
        study: its name.
        effects: of the study, in their order.
        provenance: what is known of each: values, uncertainty, the recording that they were fitted to.
        parts: the system without the effects.
        drives: recorded runs for a check, as commanded.
        predicted: the study's predictions of their readings, SI.
    """

    study: str
    effects: tuple[Effect, ...]
    provenance: tuple[str, ...]
    parts: SystemParts
    drives: tuple[Drive, ...] = ()
    predicted: tuple[Mapping[str, Array], ...] = ()


@dataclass(frozen=True)
class Exported:
    """Files of an improved model.

    Attributes:
        files: the model first.
        acts: where each effect is written, in a sentence, by the effect's kind.
        sentences: how to use the files, and what they do not have.
    """

    files: tuple[Path, ...]
    acts: Mapping[str, str]
    sentences: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class SystemPicture:
    """A still of a system.

    Attributes:
        pixels: (height, width, 3) 8-bit RGB.
        places: column and row of each place that was asked for, in pixels; None for one that has no point.
    """

    pixels: NDArray[np.uint8]
    places: tuple[tuple[float, float] | None, ...] = ()


class SystemModel(Configured[ModelConfig]):
    """A model that predicts the readings of runs.

    An implementation has no state that changes: `simulate` gives the same result for the same arguments, in any thread
    if `threads` is true.
    """

    threads: ClassVar[bool] = False

    @property
    @abstractmethod
    def inputs(self) -> tuple[Channel, ...]:
        """Return what drives the system."""

    @property
    @abstractmethod
    def outputs(self) -> tuple[Channel, ...]:
        """Return what it reads."""

    @property
    def attachments(self) -> Mapping[str, tuple[str, ...]]:
        """Return the names of the places where effects can act, by kind of place: ``{"joint": ("elbow",)}``.

        Inputs and outputs are places of every model.
        """
        return {}

    def adapted(self, kind: str, declared: EffectParameter) -> EffectParameter:
        """Return a parameter of an effect with the range that is plausible for this system.

        Parameters in SI units have a size that depends on the system: the damping of a finger is not that of an
        excavator.
        """
        return declared

    def words(self, kind: str) -> str:
        """Return what an effect at places of this model is in words, instead of its package's summary; "" for that."""
        return ""

    def default_kinds(self, kinds: Sequence[str]) -> list[str]:
        """Return the kinds of effects that a diagnosis tries first, among all kinds for this kind of model."""
        return list(kinds)

    @abstractmethod
    def simulate(self, parts: SystemParts, drives: Sequence[Drive]) -> tuple[SystemReadings, ...]:
        """Return (t,) every output at the samples of each run, SI, before the effects' maps of readings.

        Readings are NaN from the sample on at which the simulation of a run diverges.

        Raises:
            UserError: the model cannot simulate these runs at all.
        """

    def vary(
        self, parts: SystemParts, towards: Sequence[SystemParts], drives: Sequence[Drive]
    ) -> tuple[tuple[SystemReadings, ...], tuple[tuple[SystemReadings, ...], ...]] | None:
        """Return the readings as `simulate` does, and their derivatives from `parts` towards each of the others.

        The others differ from `parts` in their `changes` only. None where the model has no derivatives: differences of
        `simulate` then stand for them.
        """
        return None

    @property
    def number_error(self) -> float:
        """Return the share by which the model's own numbers may be off; 0 where they are taken as exact."""
        return 0.0

    def number_changes(self, share: float) -> tuple[object, ...]:
        """Return a change (`SystemParts.changes`) for each of the model's own numbers, by this share of it."""
        return ()

    def remarks(self, drives: Sequence[Drive]) -> tuple[str, ...]:
        """Return sentences on these runs that limit a comparison, such as contacts that chatter."""
        return ()

    def step_error(self, drives: Sequence[Drive]) -> Mapping[str, float]:
        """Return the RMS change of each output, SI, if the integration took half its step; {} where that is unknown."""
        return {}

    def export(self, improved: Improved, target: Path) -> Exported:
        """Write the model with its effects as files of its own kind; check files have the names `FILE.check.json`.

        Raises:
            UserError: this kind of model has no such file, or an effect cannot be written.
        """
        raise UserError(
            f"a model of kind '{self.config.kind}' cannot be exported; --out parameters.csv writes the numbers of its "
            "effects."
        )

    def picture(self, places: Sequence[tuple[str, str]]) -> SystemPicture | None:
        """Return a still of the system, and where places are in it, each by kind and name; None without one."""
        return None

    def fingerprint(self) -> Mapping[str, Any]:
        """Return JSON values that identify the model's files and libraries, for keys of results."""
        return {}


def effect_kind(kind: str) -> Any:
    """Return the field `kind` of a system effect's config: the kind, with a pattern of places behind it."""
    return Field(kind, pattern=f"^{kind}({AT}.+)?$")


class SystemEffect(Effect):
    """An effect of a system, at the places of its kind (`place`) that the pattern behind the ``@`` of its kind names.

    Its config declares ``kind: str = effect_kind("viscous_damping")``.

    ``viscous_damping`` acts on all joints alike, ``viscous_damping@elbow`` on one, ``viscous_damping@arm_*`` on some.
    """

    models: ClassVar[tuple[str, ...]] = ("python", "mjcf")

    @property
    def pattern(self) -> str:
        """Return the pattern of the places; ``*`` for all."""
        return self.config.kind.partition(AT)[2] or "*"

    def chosen(self, names: Sequence[str]) -> tuple[str, ...]:
        """Return the names that the pattern fits; raise `UserError` without any."""
        found = tuple(name for name in names if fnmatchcase(name, self.pattern))
        if not found:
            known = ", ".join(names) or f"no {self.place}"
            raise UserError(
                f"effect '{self.config.kind}' acts on no {self.place}: the model has {known}"
                f"{closest(self.pattern, names)}"
            )
        return found

    def apply(self, model: Any) -> Any:
        """Return the system with this effect; raise `UserError` for a chain."""
        if isinstance(model, Model):
            raise UserError(
                f"effect '{self.config.kind}' is of a user's own model, not of a chain of modules"
            )
        return self.act(model)

    @abstractmethod
    def act(self, parts: SystemParts) -> SystemParts:
        """Return the parts with this effect, at the parameter values of the config."""
