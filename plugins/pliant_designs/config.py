"""The block `sweep` of a study, and the keys that no stage reads beside it or a meta-model."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, Field, model_validator

from pliant.config.study import Study
from pliant.interfaces.base import FrozenModel

SWEPT_BLOCKS = ("family", "material")
RANGE = {"low", "high", "count"}


class SweepConfig(FrozenModel):
    """Parameters of the family, as the family block writes them, each with a list of values or a range `{low: 5 mm,
    high: 7 mm, count: 5}`; every combination is a design. `material.shear_modulus` names a constant of the material.
    `designs: table.csv` gives one design per row instead, the header naming parameters.
    """

    model_config = ConfigDict(extra="allow")

    designs: Path | None = Field(
        None, description="a CSV with one design per row, its header naming parameters"
    )

    @model_validator(mode="before")
    @classmethod
    def _flat(cls, raw: Any) -> Any:
        """Return `material: {shear_modulus: …}`, as overrides write it, as `material.shear_modulus: …`."""
        if not isinstance(raw, Mapping):
            return raw
        flat: dict[Any, Any] = {}
        for name, value in raw.items():
            if name in SWEPT_BLOCKS and isinstance(value, Mapping) and not RANGE & set(value):
                flat.update({f"{name}.{inner}": item for inner, item in value.items()})
            else:
                flat[name] = value
        return flat

    @property
    def axes(self) -> Mapping[str, Any]:
        """Return each parameter → its values, both as the study writes them."""
        return {name: value for name, value in (self.model_extra or {}).items() if value is not None}


def unused_sweep(study: Study) -> list[str]:
    """Return the sweep of a study, unless its meta-model, which names no table, is fitted to the sweep's designs."""
    model = study.block("meta_model")
    return [] if model is not None and model.data is None else ["sweep"]


def unused_surrogate(study: Study) -> list[str]:
    """Return the surrogate beside a meta-model, from which the laws come."""
    return [] if study.surrogate is None else ["surrogate"]
