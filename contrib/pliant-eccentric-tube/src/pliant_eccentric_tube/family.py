"""The eccentric tube as an `ActuatorFamily`."""

from __future__ import annotations

import numpy as np

from pliant.interfaces.family import ActuatorFamily
from pliant.records.design import MassProperties, ModuleMass
from pliant.records.fem import ModuleProblem
from pliant_eccentric_tube.config import EccentricTubeConfig
from pliant_eccentric_tube.mesh import build_mesh
from pliant_eccentric_tube.section import Section


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

    def problem(self, refinement: int = 1) -> ModuleProblem:
        """Half a module, half its width: half the joint's angle, a quarter of the module's energy.

        The section is uniform, so that mirror planes at both ends are exact; the pin holds the rigid motion
        along z.
        """
        half = self.module_length_m / 2
        return ModuleProblem(
            mesh=build_mesh(self.section, half, refinement),
            span_m=half,
            reference_z_m=0.0,
            angle_scale=2.0,
            energy_scale=4.0,
            fixed={"start": (0,), "end": (0,), "symmetry": (1,), "pin": (2,)},
        )

    def mass(self, density_kg_m3: float) -> ModuleMass:
        """Each half is a cylinder less the cylinder of its bore."""
        s = self.section
        end = self._cylinder(density_kg_m3, s.outer_m, 0.0).joined(
            self._cylinder(-density_kg_m3, s.bore_m, s.offset_m)
        )
        mirror = np.diag([-1.0, 1.0, 1.0])
        start = MassProperties(end.mass_kg, mirror @ end.com_m, mirror @ end.inertia_kg_m2 @ mirror)
        return ModuleMass(start=start, end=end)

    def _cylinder(self, density: float, radius: float, height: float) -> MassProperties:
        """A cylinder over x ∈ [0, l/2] around the line z = height."""
        length = self.module_length_m / 2
        mass = density * np.pi * radius**2 * length
        across = mass * (3 * radius**2 + length**2) / 12
        inertia = np.diag([mass * radius**2 / 2, across, across])
        return MassProperties(float(mass), np.array([length / 2, 0.0, height]), inertia)
