"""The `sweep` block: which designs are solved. `pliant.config.designs` reads it against the study's family."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, Field, model_validator

from pliant.interfaces.base import FrozenModel

BLOCKS = ("family", "material")
RANGE = {"low", "high", "count"}


class SweepConfig(FrozenModel):
    """Parameters of the family, as the family block writes them, each with a list of values or a range
    `{low: 5 mm, high: 7 mm, count: 5}`; every combination is a design. `material.shear_modulus` names a constant
    of the material. `designs: table.csv` gives one design per row instead, the header naming parameters.
    """

    model_config = ConfigDict(extra="allow")

    designs: Path | None = Field(
        default=None, description="a CSV with one design per row, its header naming parameters"
    )

    @model_validator(mode="before")
    @classmethod
    def _flat(cls, raw: Any) -> Any:
        """`material: {shear_modulus: …}`, as overrides write it, is `material.shear_modulus: …`."""
        if not isinstance(raw, Mapping):
            return raw
        flat: dict[Any, Any] = {}
        for name, value in raw.items():
            if name in BLOCKS and isinstance(value, Mapping) and not RANGE & set(value):
                flat.update({f"{name}.{inner}": item for inner, item in value.items()})
            else:
                flat[name] = value
        return flat

    @property
    def axes(self) -> Mapping[str, Any]:
        """Parameter, as it was written → its values, as they were written."""
        return {name: value for name, value in (self.model_extra or {}).items() if value is not None}
