"""Common config model of all interfaces."""

from __future__ import annotations

from abc import ABC
from collections import Counter
from typing import Any, ClassVar, Generic, TypeVar

from pydantic import AliasGenerator, BaseModel, ConfigDict

from pliant.units import quantities_in, split_unit, strip_unit_suffix


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

    # Plain numbers, without a quantity's type, whose unit a study may omit.
    bare_keys: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """Allow a key without its unit only if the field's type is a quantity of that unit and the name is unique.

        A float `rate_per_s` stays `rate_per_s`; with `size_n` in the same model, `size_m` stays `size_m`.
        """
        super().__pydantic_init_subclass__(**kwargs)
        written = Counter([strip_unit_suffix(name) for name in cls.model_fields])
        changed = False
        for name, info in cls.model_fields.items():
            stem, unit = split_unit(name)
            if stem == name or info.validation_alias != stem:
                continue
            typed = name in cls.bare_keys or any(
                one.unit == unit for one in quantities_in(info.annotation, *info.metadata)
            )
            if written[stem] > 1 or not typed:
                info.validation_alias, info.alias_priority, changed = name, 2, True
        if changed:
            cls.model_rebuild(force=True)

    def canonical(self) -> dict[str, Any]:
        """Return the config as JSON values under SI names, for provenance and keys."""
        return self.model_dump(mode="json")


class ComponentConfig(FrozenModel):
    """A study's block. `kind` names the plugin; a subclass narrows it: ``kind: Literal["mine"] = "mine"``."""

    kind: str


ConfigT = TypeVar("ConfigT", bound=ComponentConfig)


class Configured(ABC, Generic[ConfigT]):
    """Base of all interfaces: an implementation is built from its config and keeps it."""

    def __init__(self, config: ConfigT) -> None:
        self.config = config
