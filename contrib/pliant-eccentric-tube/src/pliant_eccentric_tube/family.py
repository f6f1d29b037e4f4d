"""The eccentric tube as an `ActuatorFamily`."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

from pliant.families import Need, QuarterModule
from pliant.records.fem import ModuleMesh
from pliant_eccentric_tube.config import EccentricTubeConfig
from pliant_eccentric_tube.mesh import build_mesh
from pliant_eccentric_tube.section import Section


class EccentricTube(QuarterModule):
    """One design of the eccentric tube; the joint is on the tube's axis, at mid-module.

    The section is uniform, so that mirror planes at both ends are exact; the pin prevents the rigid motion along z.
    """

    mass_refinement = 4  # quadratic faces then follow the circles to 2e-7 of the mass
    config: EccentricTubeConfig

    @cached_property
    def section(self) -> Section:
        """The section of tube and bore."""
        return Section(self.config.outer_radius_m, self.config.bore_radius_m, self.config.offset_m)

    def needs(self) -> Iterator[Need]:
        return self.section.needs(self.module_length_m)

    def mesh(self, refinement: int = 1) -> ModuleMesh:
        return build_mesh(self.section, self.module_length_m / 2, refinement)
