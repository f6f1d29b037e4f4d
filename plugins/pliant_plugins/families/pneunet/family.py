"""The fast PneuNet as an `ActuatorFamily`: one chamber as a solid, its piece, masses and collision shapes.

Module frame: x along the row with the chamber's middle at x = 0 and the middle of a gap at x = ±l/2; z = 0 is the
mid-plane of the layer. Above the layer a floor, on it the chamber; a channel through walls and gap joins the chambers.
The mesh is of structured 27-node hexahedra of a quarter of the chamber: x ∈ [0, l/2], y ∈ [0, w/2].
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from pydantic import Field

from pliant.families import Need, QuarterModule, design_geometry
from pliant.interfaces.family import FamilyConfig
from pliant.meshing.grids import block, carved, grid_cells, grid_lines, module_sets, numbered
from pliant.meshing.hexahedra import CENTRE, boundary_faces
from pliant.meshing.surfaces import box
from pliant.records.design import Array
from pliant.records.fem import ModuleMesh
from pliant.records.shape import HalfShapes, Shape
from pliant.units import Length

LAYER = "layer"
# Elements between neighbouring lines: chamber, wall, half a gap; channel, chamber, shell; layer … top.
ALONG, ACROSS, UPWARD = (2, 1, 1), (1, 2, 1), (1, 1, 1, 1, 3, 1)


@dataclass(frozen=True)
class ChamberGeometry:
    """Module length l, section, walls, gap, channel and layer; all in m."""

    module_length_m: float
    width_m: float
    height_m: float
    wall_m: float
    shell_m: float
    gap_m: float
    floor_m: float
    bridge_m: float
    channel_width_m: float
    channel_height_m: float
    layer_m: float

    @property
    def x_lines(self) -> tuple[float, ...]:
        """From mid-chamber to mid-gap: the wall's inner and outer face between."""
        half = self.module_length_m / 2
        outer = half - self.gap_m / 2
        return 0.0, outer - self.wall_m, outer, half

    @property
    def y_lines(self) -> tuple[float, ...]:
        """From the mirror plane: channel, chamber, outside."""
        return 0.0, self.channel_width_m / 2, self.width_m / 2 - self.shell_m, self.width_m / 2

    @property
    def z_lines(self) -> tuple[float, ...]:
        """Layer, floor, channel, its bridge over the gap, chamber, top."""
        low = self.layer_m / 2
        floor = low + self.floor_m
        channel = floor + self.channel_height_m
        top = low + self.height_m
        return -low, low, floor, channel, channel + self.bridge_m, top - self.shell_m, top

    def needs(self) -> Iterator[Need]:
        """Yield the conditions besides positive lengths."""
        along = "2 wall + gap < module_length (the chamber needs room)"
        yield Need(along, 2 * self.wall_m + self.gap_m, self.module_length_m)
        across = "2 shell + channel_width < width (the channel is narrower than the chamber)"
        yield Need(across, 2 * self.shell_m + self.channel_width_m, self.width_m)
        stacked = self.floor_m + self.channel_height_m + self.bridge_m + self.shell_m
        upward = "floor + channel_height + bridge + shell < height (the chamber is higher than the channel's bridge)"
        yield Need(upward, stacked, self.height_m)


class PneunetConfig(FamilyConfig):
    """A chamber with thin front walls, open to its neighbours by a channel, on a layer of another material.

    Which values make a valid design: `ChamberGeometry.needs`. The layer's material is the study's
    `material.regions.layer`.
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


class Pneunet(QuarterModule):
    """One design of the fast PneuNet (Mosadegh et al., Adv. Funct. Mater. 24 (2014) 2163–2170).

    A module runs from mid-gap to mid-gap with its joint at mid-chamber, on the layer's mid-plane. The row is taken as
    long: its mirror planes x = 0 and x = l/2 are exact in the middle of a row. Under pressure the front walls bulge
    until they touch their neighbours' at mid-gap; beyond that the state is one of self-contact.
    """

    regions = (LAYER,)

    @cached_property
    def geometry(self) -> ChamberGeometry:
        """The chamber's lengths."""
        return design_geometry(self.config, ChamberGeometry)

    def needs(self) -> Iterator[Need]:
        return self.geometry.needs()

    def mesh(self, refinement: int = 1) -> ModuleMesh:
        return build_mesh(self.geometry, refinement)

    def shapes(self) -> HalfShapes:
        """Return for each half a slab up to the channel's bridge and the chamber; the layer's side grips."""
        _, _, outer, half = self.geometry.x_lines
        low, *_, bridge, _, top = self.geometry.z_lines
        y = self.geometry.width_m / 2

        def between(a: float, b: float, low_m: float, high_m: float) -> Shape:
            return box(np.array([a, -y, low_m]), np.array([b, y, high_m]))

        start = (between(-half, 0.0, low, bridge), between(-outer, 0.0, bridge, top))
        return HalfShapes(
            start=start, end=(between(0.0, half, low, bridge), between(0.0, outer, bridge, top))
        )


def build_mesh(geometry: ChamberGeometry, refinement: int = 1) -> ModuleMesh:
    """Build the quarter with its layer as a region; `pin` is the corner above the layer at x = y = 0."""
    ends = (geometry.x_lines, geometry.y_lines, geometry.z_lines)
    counted = zip(ends, (ALONG, ACROSS, UPWARD), strict=True)
    return mesh_on(geometry, [grid_lines(e, [refinement * n for n in counts]) for e, counts in counted])


def mesh_on(geometry: ChamberGeometry, lines_m: Sequence[Array]) -> ModuleMesh:
    """Build the quarter on grid lines of x, y and z, two intervals per cell, with the geometry's own lines."""
    x, y, z = geometry.x_lines, geometry.y_lines, geometry.z_lines
    nodes, ids = numbered(block(*lines_m))
    cells = grid_cells(ids)

    # between the chambers of neighbouring modules there is air
    cx, _, cz = nodes[cells[:, CENTRE]].T
    nodes, cells, _ = carved(nodes, cells, (cx > x[2]) & (cz > z[4]))
    cx, cy, cz = nodes[cells[:, CENTRE]].T
    chamber = (cx < x[1]) & (cy < y[2]) & (cz > z[2]) & (cz < z[5])
    channel = (cx > x[1]) & (cy < y[1]) & (cz > z[2]) & (cz < z[3])
    nodes, cells, cavity = carved(nodes, cells, chamber | channel)

    skin, _ = boundary_faces(cells)
    sets = module_sets(nodes, geometry.module_length_m / 2, (0.0, 0.0, geometry.layer_m / 2))
    regions = {LAYER: np.flatnonzero(nodes[cells[:, CENTRE], 2] < z[1])}
    return ModuleMesh(nodes, cells, cavity, skin, sets, regions)
