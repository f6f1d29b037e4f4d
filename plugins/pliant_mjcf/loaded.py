"""A MuJoCo model that was read, and what of it writing the improved model needs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from pliant.interfaces.model import Drive
from pliant.records.design import Array
from pliant_mjcf.channels import Driven, Read
from pliant_mjcf.config import MjcfModelConfig


@dataclass(frozen=True, eq=False)
class Loaded:
    """An MJCF that was read, with what its study drives and reads."""

    spec: Any
    model: Any
    inputs: tuple[Driven, ...]
    outputs: tuple[Read, ...]
    resting: Array  # (nu,) ctrl of the fixed actuators, else 0


class WritableModel(Protocol):
    """What the export asks of a model: its file, its compiled form, starts and controls of runs."""

    config: MjcfModelConfig

    @property
    def loaded(self) -> Loaded:
        """Return the compiled file."""

    def start(self, model: Any, drive: Drive) -> Array:
        """Return the state at the start of a run."""

    def control(self, drive: Drive) -> Array:
        """Return (t, nu) ctrl at the samples of a run."""
