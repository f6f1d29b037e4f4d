"""The fibre-reinforced tube as an `ActuatorFamily`: its section, its piece, masses and collision shapes.

Module frame: x along the tube; z = 0 is the middle of the sleeve at the bottom, where the sheet is. Angles φ about
the tube's axis start at the bottom: y = ρ sin φ, z = axis height − ρ cos φ. The sleeve is the outer part of the wall:
it contains the threads all around and the sheet, |φ| ≤ `sheet_angle`. The mesh consists of structured 27-node hexahedra
of half the section, one slice along x, with the threads in its sleeve.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from pydantic import Field

from pliant.families import Need, QuarterModule, design_geometry, half_cylinders
from pliant.interfaces.family import FamilyConfig
from pliant.meshing.grids import grid_cells, grid_faces, grid_lines, module_sets, numbered
from pliant.meshing.hexahedra import CENTRE, boundary_faces
from pliant.records.design import Array
from pliant.records.fem import Fibres, IntArray, ModuleMesh, ModuleProblem
from pliant.records.shape import HalfShapes
from pliant.units import Angle, Force, Length

SHEET = "sheet"
# Elements along the slice, around half the section in arcs of at most so much, through liner and sleeve.
ALONG, ARC_RAD, LINER, SLEEVE = 1, 0.45, 2, 1


@dataclass(frozen=True)
class TubeGeometry:
    """Module length, inner radius, whole wall, sleeve (m); half the sheet's opening and the threads' angle (rad)."""

    module_length_m: float
    radius_m: float
    wall_m: float
    sleeve_m: float
    thread_spacing_m: float
    sheet_angle_rad: float
    thread_angle_rad: float

    @property
    def axis_height_m(self) -> float:
        """Height of the tube's axis over the sheet."""
        return self.radius_m + self.wall_m - self.sleeve_m / 2

    def needs(self) -> Iterator[Need]:
        """Yield the conditions besides positive lengths; threads may run around the tube, at a right angle."""
        yield Need("sleeve < wall (it is the wall's outer part)", self.sleeve_m, self.wall_m)
        yield Need("sheet_angle > 0°", self.sheet_angle_rad, 0.0, "rad")
        yield Need("sheet_angle < 180°", self.sheet_angle_rad, np.pi, "rad")
        yield Need("thread_angle > 0°", self.thread_angle_rad, 0.0, "rad")
        yield Need("thread_angle ≤ 90°", self.thread_angle_rad, np.pi / 2, "rad")


class FibreReinforcedConfig(FamilyConfig):
    """A tube of rubber, wound with threads at ±`thread_angle` from its axis, with a sheet along its bottom.

    Which values make a valid design: `TubeGeometry.needs`. The sheet's material is the study's
    `material.regions.sheet`.
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


class FibreReinforced(QuarterModule):
    """One design of the bending tube (Galloway et al., ICAR 2013; Polygerinos et al., IEEE T-RO 31 (2015) 778–789).

    Threads around the tube keep it from growing fat, the sheet keeps one side from growing long, so that pressure
    bends it toward the sheet. The tube is uniform along x: one slice of cells is exact for any module's length. Threads
    are spread evenly over the sleeve, both windings, and resist being shortened as much as being stretched; they are as
    heavy as what they lie in.
    """

    config: FibreReinforcedConfig
    regions = (SHEET,)
    mass_refinement = 2  # quadratic faces then follow the circles to 1e-5 of the mass

    @cached_property
    def geometry(self) -> TubeGeometry:
        """The tube's lengths and angles."""
        return design_geometry(self.config, TubeGeometry)

    def needs(self) -> Iterator[Need]:
        return self.geometry.needs()

    def mesh(self, refinement: int = 1) -> ModuleMesh:
        return build_mesh(self.geometry, refinement)

    def piece(self, mesh: ModuleMesh, **other: Any) -> ModuleProblem:
        return super().piece(
            mesh, fibres=winding(self.geometry, mesh, self.config.thread_stiffness_n), **other
        )

    def shapes(self) -> HalfShapes:
        """Return a cylinder for each half."""
        g = self.geometry
        return half_cylinders(g.module_length_m, g.radius_m + g.wall_m, g.axis_height_m)


def build_mesh(geometry: TubeGeometry, refinement: int = 1) -> ModuleMesh:
    """Build the slice x ∈ [0, l/2], y ≥ 0, with the sheet as a region; `pin` is a bottom corner of the sleeve."""
    g = geometry
    ends = (0.0, g.sheet_angle_rad, np.pi)
    arcs = [refinement * int(np.ceil((high - low) / ARC_RAD)) for low, high in itertools.pairwise(ends)]
    phi = grid_lines(ends, arcs)
    outer = g.radius_m + g.wall_m
    radius = grid_lines((g.radius_m, outer - g.sleeve_m, outer), (refinement * LINER, refinement * SLEEVE))
    x = grid_lines((0.0, g.module_length_m / 2), refinement * ALONG)

    X, angle, rho = np.meshgrid(x, phi, radius, indexing="ij")
    places = np.stack([X, rho * np.sin(angle), g.axis_height_m - rho * np.cos(angle)], axis=-1)
    places[:, [0, -1], :, 1] = 0.0  # sin π leaves rounding
    nodes, ids = numbered(places)
    # the grid is left-handed in the module frame: one index runs backwards
    cells = grid_cells(ids[:, ::-1])
    skin, _ = boundary_faces(cells)
    sets = module_sets(nodes, g.module_length_m / 2, (0.0, 0.0, g.sleeve_m / 2))
    turn = _angles(g, nodes[cells[:, CENTRE]])
    sheet = np.intersect1d(in_sleeve(g, nodes, cells), np.flatnonzero(turn < g.sheet_angle_rad))
    return ModuleMesh(nodes, cells, grid_faces(ids[:, :, 0]), skin, sets, {SHEET: sheet})


def in_sleeve(geometry: TubeGeometry, nodes_m: Array, cells: IntArray) -> IntArray:
    """Return the numbers of the cells that contain threads."""
    y, z = nodes_m[cells[:, CENTRE], 1:].T
    beyond = geometry.radius_m + geometry.wall_m - geometry.sleeve_m
    return np.flatnonzero(np.hypot(y, z - geometry.axis_height_m) > beyond)


def winding(geometry: TubeGeometry, mesh: ModuleMesh, stiffness_n: float) -> tuple[Fibres, Fibres]:
    """Return both windings, ±α from the axis: a thread of EA = `stiffness_n` per spacing, smeared over the sleeve."""
    cells = in_sleeve(geometry, mesh.nodes_m, mesh.cells)
    phi = _angles(geometry, mesh.nodes_m[mesh.cells[cells]])
    around = np.stack([np.zeros_like(phi), np.cos(phi), np.sin(phi)], axis=-1)
    along = np.broadcast_to(np.array([1.0, 0.0, 0.0]), around.shape)
    spread = stiffness_n / (geometry.thread_spacing_m * geometry.sleeve_m)
    c, s = np.cos(geometry.thread_angle_rad), np.sin(geometry.thread_angle_rad)
    plus, minus = (Fibres(cells, c * along + sign * s * around, spread) for sign in (1.0, -1.0))
    return plus, minus


def _angles(geometry: TubeGeometry, places: Array) -> Array:
    """Return φ of places (..., 3), from 0 at the bottom to π at the top."""
    return np.asarray(np.arctan2(places[..., 1], geometry.axis_height_m - places[..., 2]))
