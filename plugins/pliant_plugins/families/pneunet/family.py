"""The fast PneuNet as an `ActuatorFamily`: its parameters, its piece, masses and collision shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import cached_property
from typing import Literal

import numpy as np
from pydantic import Field

from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.meshing.masses import UNIFORM, half_masses
from pliant.meshing.surfaces import box, half_skins
from pliant.records.design import ModuleMass
from pliant.records.fem import ModuleMesh, ModuleProblem
from pliant.records.shape import HalfShapes, HalfSurfaces, Shape
from pliant.units import Length
from pliant_plugins.families.pneunet.geometry import ChamberGeometry
from pliant_plugins.families.pneunet.mesh import LAYER, build_mesh


class PneunetConfig(FamilyConfig):
    """A chamber with thin front walls, open to its neighbours by a channel, on a layer of another material.

    Which values make a valid design is the family's own check (`ChamberGeometry.check`). The layer's material is the
    study's `material.regions.layer`.
    """

    kind: Literal["pneunet"] = "pneunet"
    module_length_m: Length = Field(description="from mid-gap to mid-gap: one chamber and one gap")
    width_m: Length = Field(description="outer width along y")
    height_m: Length = Field(description="of the body along z, from the layer to the top")
    wall_m: Length = Field(description="thickness of the walls that face the gaps; they bulge")
    shell_m: Length = Field(description="thickness of the sides and of the top")
    gap_m: Length = Field(description="air between neighbouring chambers at rest")
    floor_m: Length = Field(description="body material between chamber and layer")
    bridge_m: Length = Field(description="thickness of the channel's roof in the gap")
    channel_width_m: Length = Field(description="of the channel that joins the chambers, along y")
    channel_height_m: Length = Field(description="of the channel, along z")
    layer_m: Length = Field(
        description="thickness of the strain-limiting layer, a region of its own material"
    )


class Pneunet(ActuatorFamily):
    """One design of the fast PneuNet (Mosadegh et al., Adv. Funct. Mater. 24 (2014) 2163–2170).

    A module runs from mid-gap to mid-gap with its joint at mid-chamber, on the layer's mid-plane. The row is taken as
    long: its mirror planes x = 0 and x = l/2 are exact in the middle of a row. Under pressure the front walls bulge
    until they touch their neighbours' at mid-gap; beyond that the state is one of self-contact.
    """

    regions = (LAYER,)

    def __init__(self, config: PneunetConfig) -> None:
        super().__init__(config)
        self.geometry = ChamberGeometry(**{f.name: getattr(config, f.name) for f in fields(ChamberGeometry)})
        self.geometry.check()

    @property
    def module_length_m(self) -> float:
        return self.geometry.module_length_m

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        """Half a module, half its width: the angle is half the joint's, the energy a quarter of the module's."""
        return ModuleProblem(
            mesh=build_mesh(self.geometry, refinement),
            span_m=self.geometry.module_length_m / 2,
            reference_z_m=0.0,
            deformation_scale=2.0,
            energy_scale=4.0,
            fixed={"start": (0,), "end": (0,), "symmetry": (1,), "pin": (2,)},
        )

    @cached_property
    def _half(self) -> ModuleMesh:
        return build_mesh(self.geometry)

    def surface(self) -> HalfSurfaces:
        """The skin of the mesh, open at both ends as the modules are."""
        return half_skins(self._half)

    def shapes(self) -> HalfShapes:
        """For each half a slab, as high as the channel's bridge, and the chamber on it; the layer's side grips."""
        _, _, outer, half = self.geometry.x_lines
        low, *_, bridge, _, top = self.geometry.z_lines
        y = self.geometry.width_m / 2

        def between(a: float, b: float, low_m: float, high_m: float) -> Shape:
            return box(np.array([a, -y, low_m]), np.array([b, y, high_m]))

        start = (between(-half, 0.0, low, bridge), between(-outer, 0.0, bridge, top))
        return HalfShapes(
            start=start, end=(between(0.0, half, low, bridge), between(0.0, outer, bridge, top))
        )

    def mass(self, density_kg_m3: float, regions: Mapping[str, float] = UNIFORM) -> ModuleMass:
        """Masses of the two halves, exact for the mesh's flat faces; `layer` has its own density."""
        return half_masses(self._half, density_kg_m3, regions=regions)
