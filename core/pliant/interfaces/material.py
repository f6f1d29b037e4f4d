"""Material: a hyperelastic law."""

from __future__ import annotations

import copy
from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Self

from pydantic import Field, create_model, field_validator, model_serializer

from pliant.errors import UserError, closest
from pliant.interfaces.base import ComponentConfig, Configured, FrozenModel
from pliant.mechanics.homogeneous import stability_remarks
from pliant.records.design import Array
from pliant.units import Density


class RegionMaterials(FrozenModel):
    """Materials of regions, a key for each; a study's have the fields that its block names (`with_regions`)."""

    def named(self) -> dict[str, MaterialConfig]:
        """Return region → config of its material."""
        return {name: getattr(self, name) for name in type(self).model_fields}


class MaterialConfig(ComponentConfig):
    """Base of a material's config: constants in Pa and the density; materials of the module's regions."""

    density_kg_m3: Density = Field(default=1150.0, gt=0, description="mass per volume at rest")
    regions: RegionMaterials | None = Field(
        default=None,
        description="for a family with regions: the material of each by name, `{layer: {kind: neo_hookean, …}}`",
    )

    @field_validator("regions")
    @classmethod
    def _one_level(cls, regions: RegionMaterials | None) -> RegionMaterials | None:
        """Reject regions inside a region."""
        for name, config in (regions.named() if regions else {}).items():
            if config.regions is not None:
                raise ValueError(
                    f"the material of region '{name}' has regions of its own, which is not allowed"
                )
        return regions

    @model_serializer(mode="wrap")
    def _without_empty_regions(self, handler: Any) -> Any:
        """Omit empty regions, so that materials without regions keep their values and results their keys."""
        values = handler(self)
        if isinstance(values, dict) and values.get("regions", 0) is None:
            del values["regions"]
        return values

    def region_materials(self) -> dict[str, MaterialConfig]:
        """Return region → config of its material."""
        return self.regions.named() if self.regions else {}


def require_regions(names: Iterable[str], given: Iterable[str]) -> None:
    """Raise `UserError` unless the regions with a material are those of the module."""
    names, given = list(names), list(given)
    known = ", ".join(names) or "none"
    for name in given:
        if name not in names:
            raise UserError(
                f"'material.regions.{name}' is no region of this family's module{closest(name, names)} "
                f"Its regions: {known}."
            )
    for name in names:
        if name not in given:
            raise UserError(
                f"the region '{name}' of this family's module has no material; give it one, for example "
                f"'material: {{regions: {{{name}: {{kind: neo_hookean, shear_modulus: 2 MPa}}}}}}'."
            )


def with_regions(
    model: type[MaterialConfig], regions: Mapping[str, type[MaterialConfig]]
) -> type[MaterialConfig]:
    """Return the config model of a material with regions, each validated by the model of its kind."""
    fields: Any = {name: (own, ...) for name, own in regions.items()}
    named = create_model("RegionMaterials", __base__=RegionMaterials, **fields)
    return create_model(model.__name__, __base__=model, __doc__=model.__doc__, regions=(named, ...))


@dataclass(frozen=True, eq=False)
class Hyperelastic:
    """Strain energy density and its derivatives at points of any shape (...,).

    Attributes:
        energy: (...,) W in J/m³.
        stress: (..., 3, 3) first Piola–Kirchhoff stress P = ∂W/∂F in Pa.
        tangent: (..., 3, 3, 3, 3) A = ∂P/∂F in Pa.
    """

    energy: Array
    stress: Array
    tangent: Array


@dataclass(frozen=True)
class Preset:
    """A named rubber of a kind of material.

    Attributes:
        name: used by makers and papers.
        config: the equivalent block.
        law: its law and constants, in words.
        shear_modulus_pa: μ at small strain.
        range_pa: lowest and highest shear modulus of the sources, None for a single source.
        stretch: lowest and highest stretch of the fit or measurement.
        hardness: Shore hardness, such as 30A or 00-30; "" if no source states it.
        source: of the constants.
    """

    name: str
    config: MaterialConfig
    law: str
    shear_modulus_pa: float
    range_pa: tuple[float, float] | None
    stretch: tuple[float, float]
    hardness: str
    source: str


class Material(Configured[MaterialConfig]):
    """An isotropic hyperelastic solid. FEM backends call `evaluate` with all quadrature points at once.

    `regions` are the materials of the mesh's regions; the solid itself is that of all other cells.
    """

    regions: Mapping[str, Material] = MappingProxyType({})

    def with_regions(self, regions: Mapping[str, Material]) -> Self:
        """Return the same solid with these materials in the named regions."""
        made = copy.copy(self)
        made.regions = dict(regions)
        return made

    @property
    def resolved(self) -> Material:
        """Return the solid to whose kind the constants belong: itself, or the law of a named preset."""
        return self

    @classmethod
    def presets(cls) -> tuple[Preset, ...]:
        """Return the named rubbers of this kind, with which `pliant calibrate` compares its result."""
        return ()

    @property
    def density_kg_m3(self) -> float:
        return self.config.density_kg_m3

    @property
    @abstractmethod
    def shear_modulus_pa(self) -> float:
        """μ at small strain, Pa."""

    @property
    @abstractmethod
    def bulk_modulus_pa(self) -> float:
        """K at small strain, Pa; it weights the pressure in mixed elements."""

    @abstractmethod
    def energy(self, F: Array) -> Array:
        """Return W(F) in J/m³, shape (...,), of deformation gradients F of shape (..., 3, 3)."""

    @abstractmethod
    def evaluate(self, F: Array) -> Hyperelastic:
        """Return W, P and A at deformation gradients F of shape (..., 3, 3); the caller ensures J = det F > 0."""

    def remarks(self) -> tuple[str, ...]:
        """Return objections to these constants, in sentences that the FEM stage and `pliant calibrate` show.

        By default these are the stretches between 0.5 and 2 at which the nominal stress of a homogeneous test falls.
        """
        return stability_remarks(self)
