"""The tendon joint as an `ActuatorFamily`, and its parameters."""

from __future__ import annotations

from dataclasses import fields
from functools import cached_property
from typing import ClassVar, Literal

from pydantic import Field

from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.meshing.masses import half_masses, meshed_mass, mirrored
from pliant.meshing.surfaces import half_skins
from pliant.meshing.surfaces import mirrored as mirrored_surface
from pliant.records.design import ModuleMass
from pliant.records.fem import ModuleMesh, ModuleProblem, Tendon
from pliant.records.shape import HalfShapes, HalfSurfaces
from pliant.units import Angle, Density, Length
from pliant_plugins.families.tendon_joint.geometry import JointGeometry
from pliant_plugins.families.tendon_joint.mesh import build_mesh, half_shapes, link_mesh, link_surface


class TendonJointConfig(FamilyConfig):
    """A strip between two rigid links, and a tendon that crosses the gap below it between two holes.

    Which values make a valid design is the family's own check (`JointGeometry.check`), so that its message can
    name the inequality.
    """

    kind: Literal["tendon_joint"] = "tendon_joint"
    module_length_m: Length = Field(description="l: from mid-link to mid-link")
    flexure_length_m: Length = Field(description="gap between the links that the flexure bridges")
    flexure_thickness_m: Length = Field(description="the flexure's height along z")
    flexure_width_m: Length = Field(description="the flexure's width along y")
    tendon_offset_m: Length = Field(description="of the tendon's holes, below the flexure's mid-plane")
    tendon_setback_m: Length = Field(
        description="of the tendon's holes, from the flexure's end into the link"
    )
    link_height_m: Length = Field(description="the links' height along z, centred on the flexure")
    link_width_m: Length = Field(description="the links' width along y")
    link_density_kg_m3: Density = Field(gt=0, description="mean mass per volume of the links")
    closing_angle_rad: Angle = Field(description="joint angle at which the links touch below the flexure")
    opening_angle_rad: Angle = Field(description="joint angle the other way at which they touch above it")


class TendonJoint(ActuatorFamily):
    """One design of the tendon joint.

    A module runs from mid-link to mid-link with its joint at mid-flexure. Only the flexure deforms: the solved
    piece is the half of it that moves with the child, cut by the mirror plane y = 0, and the rest of the module is
    rigid. The tendon, without friction, pulls its two holes toward each other along a straight line, below the
    flexure; positive tension turns the tip toward −z.
    """

    actuation: ClassVar[str] = "tendon_force_n"

    def __init__(self, config: TendonJointConfig) -> None:
        super().__init__(config)
        self.geometry = JointGeometry(**{f.name: getattr(config, f.name) for f in fields(JointGeometry)})
        self.geometry.check()
        self.link_density_kg_m3 = config.link_density_kg_m3

    @property
    def module_length_m(self) -> float:
        return self.geometry.module_length_m

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        """Half the flexure, half its width: the angle is half the joint's, the energy a quarter of the module's.

        The end section is bonded to the rigid link, which moves with the frame: all of v is zero there, which also
        removes the rigid motion along z. At mid-flexure, the mirror plane, the section stays plane and free in its
        plane. There is no contact between the links: states in which they would overlap are marked.
        """
        geometry = self.geometry
        return ModuleProblem(
            mesh=build_mesh(geometry, refinement),
            span_m=geometry.span_m,
            reference_z_m=0.0,
            deformation_scale=2.0,
            energy_scale=4.0,
            fixed={"start": (0,), "end": (0, 1, 2), "symmetry": (1,)},
            actuation="tendon_force_n",
            tendon=Tendon(x_m=geometry.tendon_setback_m, z_m=-geometry.tendon_offset_m),
            contact_planes=(),
            contact_range=(-geometry.opening_angle_rad, geometry.closing_angle_rad),
        )

    @cached_property
    def _flexure(self) -> ModuleMesh:
        return build_mesh(self.geometry)

    @cached_property
    def _link(self) -> ModuleMesh:
        return link_mesh(self.geometry)

    def shapes(self) -> HalfShapes:
        """The links' bands and the flexure."""
        return half_shapes(self.geometry)

    def surface(self) -> HalfSurfaces:
        """The skins of flexure and rigid links; where they are bonded, faces lie on each other."""
        flexure, link = half_skins(self._flexure), link_surface(self._link)
        return HalfSurfaces(flexure.start, flexure.end, mirrored_surface(link, 0), link)

    def mass(self, density_kg_m3: float) -> ModuleMass:
        """Masses of the two halves: the flexure of the material's density, the links of their own."""
        flexure = half_masses(self._flexure, density_kg_m3)
        link = meshed_mass(self._link, self.link_density_kg_m3)
        return ModuleMass(start=flexure.start.joined(mirrored(link, 0)), end=flexure.end.joined(link))
