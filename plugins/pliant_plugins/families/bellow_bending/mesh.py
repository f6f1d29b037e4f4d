"""The bending bellow as a solid and as structured 27-node hexahedra of half a convolution, y ≥ 0.

The wall is outside the profile, with thickness t along its normal. A solid plate, 2t thick and 2R wide, is
fused to the crests: it reaches from z = −Rc to z = −Rc − 2t below the tube's axis.
Source of the shape: Yao, Howard, Maiolino (2026), doi 10.1002/aisy.70406.

Two grids share the crest's foot.

*Wall*: grid [i, j, k] along the profile, around the axis (j = 0 at the plate) and through the thickness.
*Plate*: grid [I, J, m] along x, along y and downwards; its top takes the wall's outer nodes over the crest's
foot, [I ≤ i1, J ≤ j1].

The plate's top plane z = −Rc cuts the crest's outer surface where (Rc + t) − (a + t)(1 − cos α) = Rc / cos φ.
With P² = (a + t)(1 − cos α)/t and Q² = (Rc/cos φ − Rc)/t that curve is the circle P² + Q² = 1, and the foot a
quarter disc. The elliptic map (s, q) → (s √(1 − β q²), q √(1 − β s²)) carries a square grid onto it; β = ½
would be exact with a straight angle at one node, the slightly smaller value leaves a small fillet there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pliant.families import Need
from pliant.meshing.grids import grid_cells, grid_faces, module_sets, numbered
from pliant.meshing.hexahedra import boundary_faces
from pliant.meshing.stacking import capped, stacked
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleMesh
from pliant.records.structure import StructureProblem
from pliant_plugins.families.bellow.profile import BellowProfile

SQUIRCLE = 0.42  # β
WIDEST_FOOT = 0.85  # of R: the rest belongs to the plate's side strip


@dataclass(frozen=True)
class BellowGeometry(BellowProfile):
    """Radii r and R, wall thickness t and module length l, in m."""

    @property
    def axis_height_m(self) -> float:
        """z of the tube's axis in the module frame: Rc + t above the plate's mid-plane."""
        return self.crest_radius_m + self.wall_m

    def needs(self) -> Iterator[Need]:
        """Yield the conditions besides positive lengths."""
        yield from self.profile_needs()
        outside = "module_length/4 > wall (or the trough's outer arc collapses)"
        yield Need(outside, self.arc_radius_m, self.wall_m)

    def plate_volume(self) -> float:
        """Return volume (m³) of one module's plate, 2t · 2R · l."""
        return 2 * self.wall_m * 2 * self.average_radius_m * self.module_length_m

    def overlap_volume(self, points: int = 64) -> float:
        """Return volume (m³) that wall and plate of one module share: the crest sunk into the plate.

        At x the wall's outer radius is ρ(x) = Rc − a + √((a + t)² − x²); the circle's segment beyond z = −Rc,
        cut at |y| ≤ R, is integrated over x by Gauss quadrature in the arc's angle.
        """
        a, t, Rc, R = self.arc_radius_m, self.wall_m, self.crest_radius_m, self.average_radius_m
        node, weight = np.polynomial.legendre.leggauss(points)
        last = np.arccos(a / (a + t))
        angle = last * (node + 1) / 2
        rho = Rc - a + (a + t) * np.cos(angle)
        chord = np.sqrt(np.maximum(rho**2 - Rc**2, 0.0))
        half_width = np.minimum(chord, R)
        # ∫0..w (√(ρ² − y²) − Rc) dy, twice for both signs of y
        segment = half_width * np.sqrt(rho**2 - half_width**2) + rho**2 * np.arcsin(half_width / rho)
        area = segment - 2 * Rc * half_width
        dx = (a + t) * np.cos(angle) * last / 2
        return float(2 * np.sum(weight * area * dx))

    def solid_volume(self) -> float:
        """Return volume (m³) of one module's material: wall and plate, their overlap counted once."""
        return self.wall_volume(0.0, self.wall_m) + self.plate_volume() - self.overlap_volume()

    def cavity_volume(self) -> float:
        """Return volume (m³) of one module's cavity."""
        return self.enclosed_volume(0.0)


@dataclass(frozen=True)
class BendingCounts:
    """Elements along each edge of the two grids."""

    foot_x: int
    shoulder: int
    flank: int
    trough: int
    foot_y: int
    around: int
    wall: int
    plate: int
    overhang: int
    side: int

    @staticmethod
    def from_geometry(geometry: BellowGeometry, refinement: int) -> BendingCounts:
        """Return counts of a design: all fixed but the flank's, which follows its length."""
        flank = int(np.ceil(geometry.flank_m / (0.2 * geometry.module_length_m)))
        base = (2, 2, flank, 3, 3, 7, 1, 1, 2, 1)
        return BendingCounts(*(refinement * n for n in base))


def build_mesh(geometry: BellowGeometry, refinement: int = 1) -> ModuleMesh:
    """Mesh of x ∈ [0, l/2], y ≥ 0 in the module frame, origin on the plate's mid-plane under the crest.

    Node sets: `start` (x = 0), `end` (x = l/2), `symmetry` (y = 0), `pin` (the origin's node).
    """
    counts = BendingCounts.from_geometry(geometry, refinement)
    wall = _wall(geometry, counts)
    foot = (2 * counts.foot_x + 1, 2 * counts.foot_y + 1)
    plate = _plate(geometry, counts, wall[: foot[0], : foot[1], -1])

    wall_nodes, wall_ids = numbered(wall)
    shared = np.zeros(plate.shape[:3], bool)
    shared[: foot[0], : foot[1], 0] = True
    plate_ids = np.empty(plate.shape[:3], np.int64)
    plate_ids[shared] = wall_ids[: foot[0], : foot[1], -1].ravel()
    plate_ids[~shared] = wall_ids.size + np.arange((~shared).sum())

    nodes = np.vstack([wall_nodes, plate[~shared]])
    # both grids are left-handed in the module frame: one index runs backwards
    cells = np.vstack([grid_cells(wall_ids[:, ::-1]), grid_cells(plate_ids[:, :, ::-1])])
    skin, _ = boundary_faces(cells)
    sets = module_sets(nodes, geometry.half_length_m)
    return ModuleMesh(nodes, cells, grid_faces(wall_ids[:, :, 0]), skin, sets)


def _wall(geometry: BellowGeometry, counts: BendingCounts) -> Array:
    """Return wall nodes [i, j, k, 3] in the module frame."""
    alpha, phi = _crest_angles(geometry, counts)
    depth = geometry.wall_m * np.linspace(0, 1, 2 * counts.wall + 1)
    x, radius = geometry.crest(alpha[..., None], depth)
    # past the crest the lines run straight along the profile
    rest_phi = phi[-1]
    parts = [(x, radius, phi)]
    if counts.flank:
        fraction = np.linspace(0, 1, 2 * counts.flank + 1)[1:, None]
        parts.append(_spread(*geometry.flank(fraction, depth), rest_phi))
    angle = np.linspace(0, np.pi / 2, 2 * counts.trough + 1)[1:, None]
    parts.append(_spread(*geometry.trough(angle, depth), rest_phi))
    x, radius, phi = (np.concatenate(p) for p in zip(*parts, strict=True))
    y = radius * np.sin(phi)[..., None]
    z = geometry.axis_height_m - radius * np.cos(phi)[..., None]
    nodes = np.stack([x, y, z], axis=-1)
    # sin π and cos π/2 leave rounding on the mirror planes
    nodes[:, -1, :, 1] = 0.0
    nodes[-1, ..., 0] = geometry.half_length_m
    return nodes


def _spread(x: Array, radius: Array, phi: Array) -> tuple[Array, Array, Array]:
    """Return profile points [i, k] repeated around the axis: x and radius [i, j, k], angles [i, j]."""
    shape = (x.shape[0], len(phi), x.shape[1])
    return (
        np.broadcast_to(x[:, None], shape),
        np.broadcast_to(radius[:, None], shape),
        np.broadcast_to(phi, shape[:2]),
    )


def _crest_angles(geometry: BellowGeometry, counts: BendingCounts) -> tuple[Array, Array]:
    """Return angles [i, j] of the crest's nodes: α along the arc, φ around the axis from the plate."""
    a, t, Rc = geometry.arc_radius_m, geometry.wall_m, geometry.crest_radius_m
    i1, j1 = 2 * counts.foot_x, 2 * counts.foot_y
    i, j = np.arange(i1 + 2 * counts.shoulder + 1)[:, None], np.arange(j1 + 2 * counts.around + 1)[None]
    s, q = np.minimum(i / i1, 1.0), np.minimum(j / j1, 1.0)
    past_i = np.maximum(i - i1, 0) / (2 * counts.shoulder)
    past_j = np.maximum(j - j1, 0) / (2 * counts.around)
    # the foot's curved edges straighten out with distance from it
    P = s * np.sqrt(1 - SQUIRCLE * q**2 * (1 - past_j))
    Q = _foot_width(geometry) * q * np.sqrt(1 - SQUIRCLE * s**2 * (1 - past_i))
    alpha = np.arccos(1 - t * P**2 / (a + t))
    phi = np.arccos(Rc / (Rc + t * Q**2))
    return alpha + (np.pi / 2 - alpha) * past_i, phi + (np.pi - phi) * past_j


def _foot_width(geometry: BellowGeometry) -> float:
    """Return largest Q of the foot: 1, or less where the crest is wider than the plate can carry."""
    t, Rc = geometry.wall_m, geometry.crest_radius_m
    sine = WIDEST_FOOT * geometry.average_radius_m / (Rc + t)
    return float(min(1.0, np.sqrt((Rc / np.sqrt(1 - sine**2) - Rc) / t)))


def _plate(geometry: BellowGeometry, counts: BendingCounts, foot: Array) -> Array:
    """Return the plate's nodes [I, J, m, 3]: columns below the foot and, outside it, below the top plane."""
    t, half, R = geometry.wall_m, geometry.half_length_m, geometry.average_radius_m
    edge_x, edge_y = foot[-1], foot[:, -1]  # the foot's far edges along x and along y
    f = np.linspace(0, 1, 2 * counts.overhang + 1)[1:, None, None]
    g = np.linspace(0, 1, 2 * counts.side + 1)[1:, None]
    # where the foot's lines arrive at the end plane and at the plate's side
    corner = foot[-1, -1]
    y_end = edge_x[:, 1] * (0.5 * (corner[1] + edge_y[0, 1]) / corner[1])
    x_side = edge_y[:, 0] * (0.5 * (corner[0] + edge_x[0, 0]) / corner[0])
    end = np.stack([np.full_like(y_end, half), y_end, np.full_like(y_end, t)], axis=-1)
    side = np.stack([x_side, np.full_like(x_side, R), np.full_like(x_side, t)], axis=-1)

    beyond_x = edge_x + f * (end - edge_x)
    beyond_y = edge_y[:, None] + g * (side - edge_y)[:, None]
    far = np.array([half, R, t])
    both = (1 - f) * ((1 - g) * corner + g * side[-1]) + f * ((1 - g) * end[-1] + g * far)
    top = np.block([[[foot], [beyond_y]], [[beyond_x], [both]]])

    plate = np.repeat(top[:, :, None], 2 * counts.plate + 1, axis=2)
    m = np.linspace(0, 1, 2 * counts.plate + 1)
    plate[..., 2] += m * (-t - top[..., 2])[..., None]
    return plate


CAP_WALLS = 2.0  # thickness of the end cap over that of the wall: as thick as the plate
NEAR = 1e-6  # of the module: nodes nearer than this lie on a line


def build_structure(geometry: BellowGeometry, modules: int, refinement: int = 1) -> StructureProblem:
    """Build modules in a row as one body, clamped at the base, closed at the tip by a plate of the same rubber.

    The body occupies x ∈ [0, N l + cap], half its width, y ≥ 0; the section x = 0 (mid-trough) is clamped all over.

    The tip's force acts on the plate's mid-plane at the end of the last module, across its width, so that its line
    of action is that of the chain's tip.
    """
    length = geometry.module_length_m
    body = stacked(build_mesh(geometry, refinement), geometry.half_length_m, modules)
    mesh = capped(body, modules * length, CAP_WALLS * geometry.wall_m, layers=refinement)
    x, y, z = mesh.nodes_m.T
    near = NEAR * length

    def nodes(at_x: float) -> Array:
        return np.abs(x - at_x) < near

    def upwards(ids: IntArray) -> IntArray:
        return ids[np.argsort(z[ids])]

    centre_line = (np.abs(y) < near) & (np.abs(z) < near)
    stations = [0.0, *(length * (k + 0.5) for k in range(modules)), modules * length]
    markers: IntArray = np.array([np.flatnonzero(nodes(s) & centre_line)[0] for s in stations])
    plate = (np.abs(y) < near) & (z < geometry.wall_m + near)
    sections = tuple(upwards(np.flatnonzero(nodes(k * length) & plate)) for k in range(modules + 1))
    tip = np.flatnonzero(
        nodes(modules * length) & (np.abs(z) < near) & (y < geometry.average_radius_m + near)
    )
    tip = tip[np.argsort(y[tip])]
    shares = np.gradient(y[tip]) * np.r_[0.5, np.ones(len(tip) - 2), 0.5]
    clamp = np.flatnonzero(nodes(0.0))
    mesh = replace(mesh, node_sets={**mesh.node_sets, "base": clamp})
    return StructureProblem(
        mesh=mesh,
        fixed={"base": (0, 1, 2), "symmetry": (1,)},
        tip=tip,
        tip_shares=shares / shares.sum(),
        markers=markers,
        sections=sections,
        modules=modules,
    )
