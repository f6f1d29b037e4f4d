"""The fibre-reinforced tube as an `ActuatorFamily`: its parameters, its piece, masses and collision shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import cached_property
from typing import Literal

import numpy as np
from pydantic import Field

from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.mechanics.rotations import exp_map
from pliant.meshing.masses import UNIFORM, half_masses
from pliant.meshing.surfaces import half_skins
from pliant.records.design import ModuleMass
from pliant.records.fem import ModuleMesh, ModuleProblem
from pliant.records.shape import HalfShapes, HalfSurfaces, Shape
from pliant.units import Angle, Force, Length
from pliant_plugins.families.fibre_reinforced.geometry import TubeGeometry
from pliant_plugins.families.fibre_reinforced.mesh import SHEET, build_mesh, winding

ALONG_X = exp_map(np.array([0.0, np.pi / 2, 0.0]))
MASS_REFINEMENT = 2  # quadratic faces then follow the circles to 1e-5 of the mass


class FibreReinforcedConfig(FamilyConfig):
    """A tube of rubber, wound with threads at ±`thread_angle` from its axis, with a sheet along its bottom.

    Which values make a valid design is the family's own check (`TubeGeometry.check`). The sheet's material is the
    study's `material.regions.sheet`.
    """

    kind: Literal["fibre_reinforced"] = "fibre_reinforced"
    module_length_m: Length = Field(
        description="of the piece of tube that is one module; any, the tube is uniform"
    )
    radius_m: Length = Field(description="inner radius of the tube")
    wall_m: Length = Field(description="thickness of the whole wall, the sleeve in it")
    sleeve_m: Length = Field(description="thickness of the wall's outer part, which holds threads and sheet")
    thread_angle_rad: Angle = Field(
        description="of the threads from the tube's axis, both ways; 90 deg: around it"
    )
    thread_spacing_m: Length = Field(description="between neighbouring threads of one winding, across them")
    thread_stiffness_n: Force = Field(gt=0, description="EA of one thread, force per strain")
    sheet_angle_rad: Angle = Field(
        description="the sheet covers so much of the circumference on each side of y = 0"
    )


class FibreReinforced(ActuatorFamily):
    """One design of the bending tube (Galloway et al., ICAR 2013; Polygerinos et al., IEEE T-RO 31 (2015) 778–789).

    Threads around the tube keep it from growing fat, the sheet keeps one side from growing long, so that pressure
    bends it toward the sheet. The tube is uniform along x: one slice of cells is exact for any module's length. Threads
    are spread evenly over the sleeve, both windings, and resist being shortened as much as being stretched.
    """

    config: FibreReinforcedConfig
    regions = (SHEET,)

    def __init__(self, config: FibreReinforcedConfig) -> None:
        super().__init__(config)
        self.geometry = TubeGeometry(**{f.name: getattr(config, f.name) for f in fields(TubeGeometry)})
        self.geometry.check()

    @property
    def module_length_m(self) -> float:
        return self.geometry.module_length_m

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        """Half a module, half its section: the angle is half the joint's, the energy a quarter of the module's."""
        mesh = build_mesh(self.geometry, refinement)
        return ModuleProblem(
            mesh=mesh,
            span_m=self.geometry.module_length_m / 2,
            reference_z_m=0.0,
            deformation_scale=2.0,
            energy_scale=4.0,
            fixed={"start": (0,), "end": (0,), "symmetry": (1,), "pin": (2,)},
            fibres=winding(self.geometry, mesh, self.config.thread_stiffness_n),
        )

    @cached_property
    def _half(self) -> ModuleMesh:
        return build_mesh(self.geometry, MASS_REFINEMENT)

    def surface(self) -> HalfSurfaces:
        """The skin of the mesh, open at both ends as the modules are."""
        return half_skins(self._half)

    def shapes(self) -> HalfShapes:
        """A cylinder for each half."""
        g, quarter = self.geometry, self.geometry.module_length_m / 4

        def half(middle_m: float) -> Shape:
            size = (g.radius_m + g.wall_m, quarter)
            return Shape("cylinder", size, np.array([middle_m, 0.0, g.axis_height_m]), ALONG_X)

        return HalfShapes(start=(half(-quarter),), end=(half(quarter),))

    def mass(self, density_kg_m3: float, regions: Mapping[str, float] = UNIFORM) -> ModuleMass:
        """Masses of the two halves, threads as heavy as what they lie in; `sheet` has its own density."""
        return half_masses(self._half, density_kg_m3, regions=regions)
