"""The tendon joint as an `ActuatorFamily`: the solid, its tendon's path in closed form, its mesh.

Module frame: origin at mid-flexure, x along the chain, the tendon below the flexure at z = −h. The flexure is a
strip, x ∈ [−c/2, c/2] and t thick; the links' end faces lean back from it, so that their lower edges meet at the
closing angle and their upper edges at the opening angle of the other sign.

The mesh is of structured 27-node hexahedra. Flexure: a quarter, x ∈ [0, c/2], y ∈ [0, w/2], the whole thickness.
Link: three bands, exact for its flat faces; with its surface and its collision shapes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from pliant.families import Need, QuarterModule, design_geometry
from pliant.interfaces.family import FamilyConfig
from pliant.meshing.cells import SQUARE
from pliant.meshing.grids import block, grid_cells, grid_lines, module_sets, numbered
from pliant.meshing.hexahedra import boundary_faces
from pliant.meshing.masses import UNIFORM, meshed_mass, mirrored
from pliant.meshing.surfaces import mirrored as mirrored_surface
from pliant.records.design import Array, ModuleMass
from pliant.records.fem import ModuleMesh, ModuleProblem, Stop, Tendon
from pliant.records.shape import HalfShapes, HalfSurfaces, Shape, TriangleMesh
from pliant.units import Angle, Density, Length

ELEMENTS = (4, 3, 2)  # along x, y, z
CORNERS = [0, 2, 6, 8, 18, 20, 24, 26]  # local nodes of a 27-node cell
# The cube's faces as triangles over those corners, counter-clockwise seen from outside.
HULL = np.array(
    [
        [0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4],
        [2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5],
    ],
    np.int64,
)  # fmt: skip


@dataclass(frozen=True)
class JointGeometry:
    """Module length l, flexure c × t × w, tendon h below and b behind it, link section, angles of contact."""

    module_length_m: float
    flexure_length_m: float
    flexure_thickness_m: float
    flexure_width_m: float
    tendon_offset_m: float
    tendon_setback_m: float
    link_height_m: float
    link_width_m: float
    closing_angle_rad: float
    opening_angle_rad: float

    @property
    def span_m(self) -> float:
        """c/2, the solved half of the flexure."""
        return self.flexure_length_m / 2

    @property
    def hole_x_m(self) -> float:
        """x of the hole in the end link at rest; the tendon is twice as long between the holes."""
        return self.span_m + self.tendon_setback_m

    def edge_x_m(self, contact_rad: float) -> float:
        """Return x of an end link's edge, H/2 from the mid-plane, that meets its mirror image at a joint angle.

        At θ the arc of the flexure ends at x = (c/θ) sin(θ/2), turned by θ/2: an edge at depth H/2 and s behind it is
        at x = (c/θ) sin(θ/2) + s cos(θ/2) − (H/2) sin(θ/2), which is zero at contact.
        """
        reach = self.link_height_m / 2 - self.flexure_length_m / contact_rad
        return self.span_m + reach * float(np.tan(contact_rad / 2))

    @property
    def lower_edge_x_m(self) -> float:
        """x of the end link's edge on the tendon's side."""
        return self.edge_x_m(self.closing_angle_rad)

    @property
    def upper_edge_x_m(self) -> float:
        """x of the end link's edge on the other side."""
        return self.edge_x_m(self.opening_angle_rad)

    @property
    def stops(self) -> tuple[Stop, ...]:
        """The end link's edges below and above, half their width; they bear over a flexure's thickness."""
        area, edge = self.link_width_m / 2 * self.flexure_thickness_m, self.link_height_m / 2
        lower, upper = self.lower_edge_x_m - self.span_m, self.upper_edge_x_m - self.span_m
        return Stop(lower, -edge, area), Stop(upper, edge, area)

    def face_x_m(self, depth_m: float) -> float:
        """Return x of the end link's face at a depth below the mid-plane, t/2 ≤ depth ≤ H/2."""
        half = self.flexure_thickness_m / 2
        share = (depth_m - half) / (self.link_height_m / 2 - half)
        return self.span_m + share * (self.lower_edge_x_m - self.span_m)

    def tendon_length_m(self, angle_rad: float) -> float:
        """Return length of the tendon between its holes if the flexure bends as a circular arc of length c.

        L = 2 [(c/θ) sin(θ/2) + b cos(θ/2) − h sin(θ/2)].
        """
        half = angle_rad / 2
        arc = self.span_m * float(np.sinc(half / np.pi))
        return 2 * (arc + self.tendon_setback_m * np.cos(half) - self.tendon_offset_m * np.sin(half))

    def tendon_arm_m(self, angle_rad: float) -> float:
        """Return −dL/dθ of `tendon_length_m`: the moment of a unit force, which grows as the joint bends."""
        half = angle_rad / 2
        # −d/dx of sin(x)/x, by its series where the quotient cancels
        slope = half / 3 if abs(half) < 1e-4 else (np.sin(half) - half * np.cos(half)) / half**2
        guided = self.tendon_setback_m * np.sin(half) + self.tendon_offset_m * np.cos(half)
        return float(self.span_m * slope + guided)

    def needs(self) -> Iterator[Need]:
        """Yield the conditions besides positive lengths; each may be evaluated only if those before it are met."""
        contacts = {"closing_angle": self.closing_angle_rad, "opening_angle": self.opening_angle_rad}
        for name, angle in contacts.items():
            yield Need(f"{name} > 0°", angle, 0.0, "rad")
            yield Need(f"{name} < 180°", angle, np.pi, "rad")
        c, t, h, half = (
            self.flexure_length_m, self.flexure_thickness_m, self.tendon_offset_m, self.module_length_m / 2
        )  # fmt: skip
        yield Need("flexure_length < module_length (the links need room)", c, self.module_length_m)
        yield Need("flexure_thickness < link_height", t, self.link_height_m)
        yield Need("flexure_width ≤ link_width", self.flexure_width_m, self.link_width_m)
        folds = "flexure_thickness/2 · the larger contact angle < flexure_length (or its inside folds)"
        yield Need(folds, max(contacts.values()) * t / 2, c)
        for side, edge in (("closing", self.lower_edge_x_m), ("opening", self.upper_edge_x_m)):
            name = f"x of the link's edge that meets its image at the {side}_angle"
            yield Need(f"{name} > 0", edge, 0.0)
            yield Need(f"{name} < module_length/2", edge, half)
        yield Need("flexure_thickness/2 < tendon_offset", t / 2, h)
        yield Need("tendon_offset < link_height/2 (the hole lies in the link)", h, self.link_height_m / 2)
        hole = "flexure_length/2 + tendon_setback"
        yield Need(f"{hole} ≤ module_length/2", self.hole_x_m, half)
        yield Need(f"the link's face at the tendon ≤ {hole}", self.face_x_m(h), self.hole_x_m)


class TendonJointConfig(FamilyConfig):
    """A strip between two rigid links, and a tendon that crosses the gap below it between two holes.

    Which values make a valid design: `JointGeometry.needs`.
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


class TendonJoint(QuarterModule):
    """One design of the tendon joint.

    A module runs from mid-link to mid-link with its joint at mid-flexure. Only the flexure deforms: the solved
    piece is the half of it that moves with the child, cut by the mirror plane y = 0, and the rest of the module is
    rigid. The tendon, without friction, pulls its two holes toward each other along a straight line, below the
    flexure; positive tension turns the tip toward −z.
    """

    actuation: ClassVar[str] = "tendon_force_n"
    config: TendonJointConfig

    @cached_property
    def geometry(self) -> JointGeometry:
        """The joint's lengths and angles."""
        return design_geometry(self.config, JointGeometry)

    def needs(self) -> Iterator[Need]:
        return self.geometry.needs()

    def mesh(self, refinement: int = 1) -> ModuleMesh:
        return build_mesh(self.geometry, refinement)

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        """Return half the flexure, half its width: the angle is half the joint's, the energy a quarter of the module's.

        The end section is bonded to the rigid link, which moves with the frame: all of v is zero there, which also
        removes the rigid motion along z. At mid-flexure, the mirror plane, the section stays plane and free in its
        plane. Links meet at their edges, their stops; where contact is not solved, states in which they would overlap
        are marked.
        """
        geometry = self.geometry
        return self.piece(
            self.mesh(refinement),
            span_m=geometry.span_m,
            fixed={"start": (0,), "end": (0, 1, 2), "symmetry": (1,)},
            tendon=Tendon(x_m=geometry.tendon_setback_m, z_m=-geometry.tendon_offset_m),
            contact_planes=(),
            contact_range=(-geometry.opening_angle_rad, geometry.closing_angle_rad),
            stops=geometry.stops,
        )

    @cached_property
    def _link(self) -> ModuleMesh:
        return link_mesh(self.geometry)

    def shapes(self) -> HalfShapes:
        """Return the links' bands and the flexure."""
        return half_shapes(self.geometry)

    def surface(self) -> HalfSurfaces:
        """Return the skins of flexure and rigid links; where they are bonded, faces lie on each other."""
        flexure, link = super().surface(), link_surface(self._link)
        return HalfSurfaces(flexure.start, flexure.end, mirrored_surface(link, 0), link)

    def mass(self, density_kg_m3: float, regions: Mapping[str, float] = UNIFORM) -> ModuleMass:
        """Return the masses of the two halves: the flexure with the material's density, the links with
        `link_density_kg_m3`.
        """
        flexure = super().mass(density_kg_m3, regions)
        link = meshed_mass(self._link, self.config.link_density_kg_m3)
        return ModuleMass(start=flexure.start.joined(mirrored(link, 0)), end=flexure.end.joined(link))


def build_mesh(geometry: JointGeometry, refinement: int = 1) -> ModuleMesh:
    """Build the quarter; node sets `start` (x = 0), `end` (x = c/2), `symmetry` (y = 0), `pin` (the origin).

    Bonded corners are where strains change fastest: the cells at the link and at the free edge are the smaller.
    """
    t = geometry.flexure_thickness_m
    along, across, through = (refinement * n for n in ELEMENTS)
    nodes, ids = numbered(
        block(
            geometry.span_m * _graded(along),
            geometry.flexure_width_m / 2 * _graded(across),
            grid_lines((-t / 2, t / 2), through),
        )
    )
    cells = grid_cells(ids)
    skin, _ = boundary_faces(cells)
    sets = module_sets(nodes, geometry.span_m)
    return ModuleMesh(nodes, cells, np.empty((0, 9), np.int64), skin, sets)


def _graded(elements: int) -> Array:
    """Return grid lines from 0 to 1, mid-nodes included, closer toward 1: s ↦ s (2 − s)."""
    ends = np.linspace(0, 1, elements + 1)
    return grid_lines(ends * (2 - ends), 1)


def link_mesh(geometry: JointGeometry) -> ModuleMesh:
    """Return the mesh of the end link over its whole width: bands below, at and above the flexure's end."""
    half, edge = geometry.flexure_thickness_m / 2, geometry.link_height_m / 2
    z = np.array([-edge, -half, half, edge])
    face = np.array([geometry.lower_edge_x_m, geometry.span_m, geometry.span_m, geometry.upper_edge_x_m])
    z, face = (np.interp(np.arange(7) / 2, np.arange(4), line) for line in (z, face))
    back = geometry.module_length_m / 2
    y = geometry.link_width_m / 2 * np.array([-1.0, 0.0, 1.0])
    share = np.array([0.0, 0.5, 1.0])[:, None, None]
    positions = np.empty((3, 3, 7, 3))
    positions[..., 0] = face + share * (back - face)
    positions[..., 1] = y[:, None]
    positions[..., 2] = z
    nodes, ids = numbered(positions)
    cells = grid_cells(ids)
    return ModuleMesh(nodes, cells, np.empty((0, 9), np.int64), boundary_faces(cells)[0], {})


def link_surface(mesh: ModuleMesh) -> TriangleMesh:
    """Return the end link's skin as triangles."""
    return TriangleMesh(mesh.nodes_m, mesh.skin[:, SQUARE].reshape(-1, 3))


def half_shapes(geometry: JointGeometry) -> HalfShapes:
    """Return for each half the link's three bands and half of the flexure, all convex."""
    mesh, z = link_mesh(geometry), geometry.flexure_thickness_m / 2
    x, y = (0.0, geometry.span_m), geometry.flexure_width_m / 2
    flexure = np.array([(i, j, k) for k in (-z, z) for j in (-y, y) for i in x])
    hulls = [TriangleMesh(corners, HULL) for corners in (*mesh.nodes_m[mesh.cells[:, CORNERS]], flexure)]

    def convex(hull: TriangleMesh) -> Shape:
        return Shape("mesh", (), np.zeros(3), np.eye(3), hull)

    start = tuple(convex(mirrored_surface(hull, 0)) for hull in hulls)
    return HalfShapes(start=start, end=tuple(map(convex, hulls)))
