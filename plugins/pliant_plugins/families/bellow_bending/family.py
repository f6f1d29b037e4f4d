"""The bending bellow as an `ActuatorFamily`, and its parameters."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Literal

import numpy as np
from pydantic import Field

from pliant.families import Need, QuarterModule, design_geometry, half_cylinders
from pliant.interfaces.family import FamilyConfig
from pliant.records.fem import ModuleMesh
from pliant.records.shape import HalfShapes, Shape
from pliant.records.structure import StructureProblem
from pliant.units import Length
from pliant_plugins.families.bellow_bending.mesh import BellowGeometry, build_mesh, build_structure


class BellowBendingConfig(FamilyConfig):
    """A bellow whose wall has thickness t outside a profile of radii r (trough) and 2R − r (crest).

    Which values make a valid design: `BellowGeometry.needs`.
    """

    kind: Literal["bellow_bending"] = "bellow_bending"
    inner_radius_m: Length = Field(description="r: inner radius of the trough")
    average_radius_m: Length = Field(description="R: mean of the inner radii of trough and crest")
    wall_m: Length = Field(description="t: wall thickness; the plate is 2t thick")
    module_length_m: Length = Field(description="l: length of one convolution, the module")


class BellowBending(QuarterModule):
    """One design of the bending bellow.

    A module runs from mid-trough to mid-trough with its joint at mid-crest, on the plate's mid-plane: modules
    meet at the narrow section, where the tube ends anyway and least mass crosses the border. The solved piece
    is the half that moves with the child, x ∈ [0, l/2], cut by the mirror plane y = 0. The pinned node, at the
    origin, removes the rigid motion along z; the line z = 0, whose strain is e, is the plate's mid-plane.
    """

    @cached_property
    def geometry(self) -> BellowGeometry:
        """The profile, and the plate."""
        return design_geometry(self.config, BellowGeometry)

    def needs(self) -> Iterator[Need]:
        return self.geometry.needs()

    def mesh(self, refinement: int = 1) -> ModuleMesh:
        return build_mesh(self.geometry, refinement)

    def structure(self, modules: int, refinement: int = 1) -> StructureProblem:
        """Return `modules` modules as one body."""
        return build_structure(self.geometry, modules, refinement)

    def shapes(self) -> HalfShapes:
        """Return for each half a box, the plate, 2R wide and 2t thick, and a cylinder of radius Rc + t.

        Pressure turns the tip toward −z: the plate's face z = −t is the side that grips.
        """
        geometry, quarter = self.geometry, self.module_length_m / 4
        crests = half_cylinders(
            self.module_length_m, geometry.crest_radius_m + geometry.wall_m, geometry.axis_height_m
        )
        size = (quarter, geometry.average_radius_m, geometry.wall_m)
        start, end = (Shape("box", size, np.array([x, 0.0, 0.0]), np.eye(3)) for x in (-quarter, quarter))
        return HalfShapes(start=(start, *crests.start), end=(end, *crests.end))
