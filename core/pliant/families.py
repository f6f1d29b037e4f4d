"""Building blocks of families: the inequalities of a design, and modules of which a quarter is solved."""

from __future__ import annotations

import itertools
import re
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, ClassVar, TypeVar

import numpy as np

from pliant.errors import InvalidDesignError
from pliant.formatting import quantity
from pliant.interfaces.base import ComponentConfig
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.mechanics.rotations import exp_map
from pliant.meshing.masses import UNIFORM, half_masses
from pliant.meshing.surfaces import half_skins
from pliant.records.design import ModuleMass
from pliant.records.fem import ModuleMesh, ModuleProblem
from pliant.records.shape import HalfShapes, HalfSurfaces, Shape
from pliant.units import quantities_in, split_unit

LARGEST_M = 1.0
ROUNDING = 1e-6  # sides that differ by less than this share of the larger are equal
OPPOSITE = {">": "≤", "≥": "<", "<": "≥", "≤": ">"}
DIGITS = 6
FAR_APART = 50  # ratio of lengths above which a unit is suspected to be wrong
UNITS = " (bare numbers are metres: were units forgotten?)"

G = TypeVar("G")


@dataclass(frozen=True)
class Need:
    """An inequality that a design keeps.

    Attributes:
        words: the text shown to users, with one of > ≥ < ≤: ``height > floor + wall (room for the chamber)``.
        left: its left side, in SI.
        right: its right side.
        si: the SI unit of both.
    """

    words: str
    left: float
    right: float
    si: str = "m"

    @property
    def sign(self) -> str:
        """The first of > ≥ < ≤ in its words; `ValueError` without one."""
        found = re.search("[><≥≤]", self.words)
        if found is None:
            raise ValueError(f"the need '{self.words}' has none of the signs > ≥ < ≤")
        return found.group()

    @property
    def is_kept(self) -> bool:
        """Return whether the inequality is satisfied; sides that are equal up to rounding satisfy only ≥ and ≤."""
        room = self.left - self.right if self.sign in ">≥" else self.right - self.left
        rounding = ROUNDING * max(abs(self.left), abs(self.right))
        return room >= -rounding if self.sign in "≥≤" else room > rounding

    def __str__(self) -> str:
        left, right, off = (
            quantity(side, self.si, DIGITS) for side in (self.left, self.right, abs(self.left - self.right))
        )
        if not self.right:
            return f"{self.words}, but it is {left}"
        how = "short" if self.sign in ">≥" else "over"
        by = f", {how} by {off}" if self.left != self.right else ""
        least, most = sorted((abs(self.left), abs(self.right)))
        units = UNITS if self.si == "m" and (most >= LARGEST_M or most > FAR_APART * least) else ""
        return f"{self.words}, but {left} {OPPOSITE[self.sign]} {right}{by}{units}"


def check_design(config: FamilyConfig, needs: Iterable[Need] = ()) -> None:
    """Raise `InvalidDesignError`, with the inequality and by how much it is broken, for an impossible design.

    Every length of the config is above 0, or may be 0 where its field says `ge=0`, and no longer than a metre; then the
    family's own `needs` are checked, each only where those before it are satisfied.
    """
    for need in itertools.chain(_length_needs(config), needs):
        if not need.is_kept:
            raise InvalidDesignError(f"{config.kind} needs {need}.")


def design_lengths(config: ComponentConfig) -> dict[str, tuple[float, bool]]:
    """Return the lengths of a design by field, and whether each may be 0 (`ge=0`); fields left out are omitted."""
    found = {}
    for field, info in type(config).model_fields.items():
        value = getattr(config, field)
        unit = next((each.unit for each in quantities_in(info.annotation, *info.metadata)), None)
        if unit == "m" and isinstance(value, float):
            found[field] = value, any(getattr(bound, "ge", None) == 0 for bound in info.metadata)
    return found


def _length_needs(config: FamilyConfig) -> Iterator[Need]:
    lengths = {split_unit(field)[0]: found for field, found in design_lengths(config).items()}
    for name, (value, may_be_0) in lengths.items():
        yield Need(f"{name} {'≥' if may_be_0 else '>'} 0", value, 0.0)
    for name, (value, _) in lengths.items():
        yield Need(f"{name} ≤ 1 m", value, LARGEST_M)


def design_geometry(config: FamilyConfig, geometry: type[G]) -> G:
    """Return a dataclass of a design's geometry, with the fields of the config of the same names."""
    return geometry(**{field.name: getattr(config, field.name) for field in fields(geometry)})  # type: ignore[arg-type]


def half_cylinders(module_length_m: float, radius_m: float, height_m: float = 0.0) -> HalfShapes:
    """Return a cylinder along x for each half of a module, its axis at a height above the joint."""
    quarter, along_x = module_length_m / 4, exp_map(np.array([0.0, np.pi / 2, 0.0]))
    start, end = (
        (Shape("cylinder", (radius_m, quarter), np.array([x, 0.0, height_m]), along_x),)
        for x in (-quarter, quarter)
    )
    return HalfShapes(start=start, end=end)


class QuarterModule(ActuatorFamily):
    """A family whose modules are symmetric about x = 0 and y = 0 and bend about y: a quarter of one is solved.

    A subclass defines `mesh` and, for conditions besides lengths above 0, `needs`. Its config has `module_length_m`.
    It may override: `fixed`, the constraints of the node sets; `piece`, to set other fields of `ModuleProblem`, as
    `return super().piece(mesh, reference_z_m=2e-3)`; class attributes of `ActuatorFamily`, such as `actuation` and
    `regions`; `shapes` and `surface`.

    Of the displacement v in the sections' frame, x is zero at both ends (`start`, `end`): sections there stay plane
    and turn, as in the middle of a long chain. y is zero on the mirror plane (`symmetry`). `pin`, one node, fixes z:
    this removes the last rigid motion without causing stress. The line at `reference_z_m` = 0, whose strain is solved
    for too, is the joint's.
    """

    # The components of v that are zero on each node set; `module_sets` makes these sets.
    fixed: ClassVar[Mapping[str, tuple[int, ...]]] = {
        "start": (0,), "end": (0,), "symmetry": (1,), "pin": (2,),
    }  # fmt: skip
    # Refinement of the mesh for mass and drawing: quadratic faces deviate from circles by its fourth power.
    mass_refinement: ClassVar[int] = 1

    def __init__(self, config: FamilyConfig) -> None:
        super().__init__(config)
        check_design(config, self.needs())

    def needs(self) -> Iterable[Need]:
        """Return the inequalities of a design besides the signs of its lengths."""
        return ()

    @property
    def module_length_m(self) -> float:
        return float(self.config.module_length_m)  # type: ignore[attr-defined]

    @abstractmethod
    def mesh(self, refinement: int = 1) -> ModuleMesh:
        """Return the mesh of the quarter: x ∈ [0, l/2], y ≥ 0; `refinement` multiplies the elements along each edge."""

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        """Return the problem of half a module, half its width: half the joint's angle, a quarter of the energy."""
        return self.piece(self.mesh(refinement))

    def piece(self, mesh: ModuleMesh, **other: Any) -> ModuleProblem:
        """Return the quarter's boundary-value problem on a mesh; `other` sets further fields of `ModuleProblem`."""
        quarter: dict[str, Any] = {
            "span_m": self.module_length_m / 2,
            "reference_z_m": 0.0,
            "deformation_scale": 2.0,
            "energy_scale": 4.0,
            "fixed": dict(self.fixed),
            "axes": self.axes,
            "main_axis": self.main_axis,
            "joint": self.joint,
            "actuation": self.actuation,
        }
        return ModuleProblem(mesh=mesh, **{**quarter, **other})

    @cached_property
    def solid(self) -> ModuleMesh:
        """Return the mesh for mass and drawing."""
        return self.mesh(self.mass_refinement)

    def surface(self) -> HalfSurfaces:
        """Return the surface of the mesh, open at both ends as the modules are."""
        return half_skins(self.solid)

    def mass(self, density_kg_m3: float, regions: Mapping[str, float] = UNIFORM) -> ModuleMass:
        """Return the masses of the two halves, by Gauss quadrature over the mesh and its mirror images."""
        return half_masses(self.solid, density_kg_m3, regions=regions)
