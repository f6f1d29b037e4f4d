"""The translational bellow as an `ActuatorFamily`."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar

from pliant.interfaces.family import ActuatorFamily
from pliant.meshing.masses import half_masses
from pliant.meshing.surfaces import half_skins
from pliant.records.design import ModuleMass
from pliant.records.fem import ModuleMesh, ModuleProblem
from pliant.records.law import JointKind
from pliant.records.shape import HalfShapes, HalfSurfaces
from pliant_plugins.families.bellow.profile import BellowProfile
from pliant_plugins.families.bellow.revolved import Counts, sector
from pliant_plugins.families.bellow.shapes import half_tubes
from pliant_plugins.families.bellow_translational.config import BellowTranslationalConfig


class BellowTranslational(ActuatorFamily):
    """One design of the translational bellow.

    A module runs from mid-trough to mid-trough with its joint at mid-crest, on the tube's axis. The joint slides
    along x: u is the module's extension, τ a force. Both end sections stay plane and are free to breathe, as in
    the middle of a long bellow.
    """

    joint: ClassVar[JointKind] = "prismatic"
    axes: ClassVar[tuple[str, ...]] = ("x",)
    main_axis: ClassVar[str] = "x"

    def __init__(self, config: BellowTranslationalConfig) -> None:
        super().__init__(config)
        self.geometry = BellowProfile(
            config.inner_radius_m, config.average_radius_m, config.wall_m, config.module_length_m
        )
        self.geometry.check_mid_surface(config.kind)

    @property
    def module_length_m(self) -> float:
        return self.geometry.module_length_m

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        """Half a module, a quarter of its section: u is twice the piece's extension, the energy eight times its."""
        return ModuleProblem(
            mesh=sector(self.geometry, self._counts(refinement), quarters=1),
            span_m=self.geometry.half_length_m,
            reference_z_m=0.0,
            deformation_scale=2.0,
            energy_scale=8.0,
            fixed={"start": (0,), "end": (0,), "symmetry": (1,), "level": (2,)},
            axes=("x",),
            main_axis="x",
            joint="prismatic",
        )

    def _counts(self, refinement: int = 1) -> Counts:
        """Finer than a bellow that bends: stretching it strains the whole circumference."""
        return Counts.of(self.geometry, refinement, arc=3, quarter=4)

    @cached_property
    def _half_section(self) -> ModuleMesh:
        return sector(self.geometry, self._counts(), quarters=2)

    def shapes(self) -> HalfShapes:
        """Cylinders around the crests of the two halves."""
        return half_tubes(self.geometry)

    def surface(self) -> HalfSurfaces:
        """The undulating wall, open at both ends as the modules are."""
        return half_skins(self._half_section)

    def mass(self, density_kg_m3: float) -> ModuleMass:
        """Masses of the two halves, by Gauss quadrature over the mesh and its mirror images."""
        return half_masses(self._half_section, density_kg_m3)
