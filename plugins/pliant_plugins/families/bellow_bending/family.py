"""The bending bellow as an `ActuatorFamily`."""

from __future__ import annotations

from functools import cached_property

from pliant.interfaces.family import ActuatorFamily
from pliant.meshing.masses import half_masses
from pliant.meshing.surfaces import half_skins
from pliant.records.design import ModuleMass
from pliant.records.fem import ModuleMesh, ModuleProblem
from pliant.records.shape import HalfShapes, HalfSurfaces
from pliant.records.structure import StructureProblem
from pliant_plugins.families.bellow_bending.config import BellowBendingConfig
from pliant_plugins.families.bellow_bending.geometry import BellowGeometry
from pliant_plugins.families.bellow_bending.mesh import build_mesh
from pliant_plugins.families.bellow_bending.shapes import half_shapes
from pliant_plugins.families.bellow_bending.structure import build_structure


class BellowBending(ActuatorFamily):
    """One design of the bending bellow.

    A module runs from mid-trough to mid-trough with its joint at mid-crest, on the plate's mid-plane: modules
    meet at the narrow section, where the tube ends anyway and least mass crosses the border. The solved piece
    is the half that moves with the child, x ∈ [0, l/2], cut by the mirror plane y = 0.
    """

    def __init__(self, config: BellowBendingConfig) -> None:
        super().__init__(config)
        self.geometry = BellowGeometry(
            config.inner_radius_m, config.average_radius_m, config.wall_m, config.module_length_m
        )
        self.geometry.check()

    @property
    def module_length_m(self) -> float:
        return self.geometry.module_length_m

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        """Half a module, half its width: the angle is half the joint's, the energy a quarter of the module's.

        The pinned node, at the origin, removes the rigid motion along z; the line z = 0, whose strain is e,
        is the plate's mid-plane.
        """
        return ModuleProblem(
            mesh=build_mesh(self.geometry, refinement),
            span_m=self.geometry.half_length_m,
            reference_z_m=0.0,
            deformation_scale=2.0,
            energy_scale=4.0,
            fixed={"start": (0,), "end": (0,), "symmetry": (1,), "pin": (2,)},
        )

    def structure(self, modules: int, refinement: int = 1) -> StructureProblem:
        """`modules` of them as one body."""
        return build_structure(self.geometry, modules, refinement)

    @cached_property
    def _mesh(self) -> ModuleMesh:
        return build_mesh(self.geometry)

    def shapes(self) -> HalfShapes:
        """Plate and bellow of the two halves."""
        return half_shapes(self.geometry)

    def surface(self) -> HalfSurfaces:
        """The skin of the mesh: the undulating wall, open at both ends as the modules are, and the plate."""
        return half_skins(self._mesh)

    def mass(self, density_kg_m3: float) -> ModuleMass:
        """Masses of the two halves, by Gauss quadrature over the mesh and its mirror images."""
        return half_masses(self._mesh, density_kg_m3)
