"""What all interfaces share: the config model and the number of the contract."""

from __future__ import annotations

from abc import ABC
from typing import Any, Generic, TypeVar

from pydantic import AliasGenerator, BaseModel, ConfigDict

from pliant.units import strip_unit_suffix

# The number that a plugin's manifest states; docs/plugin_contract.md says what it covers.
CONTRACT_VERSION = 2


class FrozenModel(BaseModel):
    """Typed, frozen, strict about unknown keys; ``wall_m`` may be written ``wall: 1.5 mm``."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        populate_by_name=True,
        validate_default=True,
        allow_inf_nan=False,
        alias_generator=AliasGenerator(validation_alias=strip_unit_suffix),
    )

    def canonical(self) -> dict[str, Any]:
        """The config as JSON values under SI names: what provenance stores and keys are made of."""
        return self.model_dump(mode="json")


class ComponentConfig(FrozenModel):
    """A study's block. `kind` names the plugin; a subclass narrows it: ``kind: Literal["mine"] = "mine"``."""

    kind: str


ConfigT = TypeVar("ConfigT", bound=ComponentConfig)


class Configured(ABC, Generic[ConfigT]):
    """Base of all interfaces: an implementation is built from its config and keeps it."""

    def __init__(self, config: ConfigT) -> None:
        self.config = config
