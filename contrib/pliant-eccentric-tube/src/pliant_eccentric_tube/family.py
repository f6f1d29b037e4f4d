"""The eccentric tube as an `ActuatorFamily`."""

from __future__ import annotations

from collections.abc import Mapping

from pliant.interfaces.family import ActuatorFamily
from pliant.meshing.masses import UNIFORM, half_masses
from pliant.records.design import ModuleMass
from pliant.records.fem import ModuleProblem
from pliant_eccentric_tube.config import EccentricTubeConfig
from pliant_eccentric_tube.mesh import build_mesh
from pliant_eccentric_tube.section import Section

MASS_REFINEMENT = 4  # quadratic faces then follow the circles to 2e-7 of the mass


class EccentricTube(ActuatorFamily):
    """One design of the eccentric tube; the joint stands on the tube's axis, at mid-module."""

    config: EccentricTubeConfig

    def __init__(self, config: EccentricTubeConfig) -> None:
        super().__init__(config)
        self.section = Section(config.outer_radius_m, config.bore_radius_m, config.offset_m)
        self.section.check(config.module_length_m)

    @property
    def module_length_m(self) -> float:
        """l."""
        return self.config.module_length_m

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        """Half a module, half its width: half the joint's angle, a quarter of the module's energy.

        The section is uniform, so that mirror planes at both ends are exact; the pin holds the rigid motion
        along z.
        """
        half = self.module_length_m / 2
        return ModuleProblem(
            mesh=build_mesh(self.section, half, refinement),
            span_m=half,
            reference_z_m=0.0,
            deformation_scale=2.0,
            energy_scale=4.0,
            fixed={"start": (0,), "end": (0,), "symmetry": (1,), "pin": (2,)},
        )

    def mass(self, density_kg_m3: float, regions: Mapping[str, float] = UNIFORM) -> ModuleMass:
        """Masses of the meshed halves."""
        mesh = build_mesh(self.section, self.module_length_m / 2, MASS_REFINEMENT)
        return half_masses(mesh, density_kg_m3, regions=regions)
