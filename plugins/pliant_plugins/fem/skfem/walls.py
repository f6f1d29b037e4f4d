"""Frictionless self-contact of a piece: walls that meet away from the mirror planes.

Each quadrature point of the skin is projected onto the faces that it may meet. Where its penetration of the nearest is
D, the energy ∫ φ(D/2) dA is stored, φ that of `contact`: both walls are compressed by D/2, each in its own integral, so
that two mirror images press on each other as either presses on the plane between them. Points are compared in the frame
of the sections, (s, y, z): contact does not depend on the frame, and at contact ∂D is normal to the wall in any
coordinates, so that there is no friction; and positions are linear in v and e there.

With p the point, p̄ its projection, a_α the tangents there, n the normal out of the solid, w = δp − δp̄,
c_α = n·δp̄,α, m_αβ = a_α·a_β, b_αβ = n·p̄,αβ and g = −D = n·(p − p̄),

    δg = n·w,   δ²g = −2 c·δξ − δξ·b δξ + g (c + b δξ)·m⁻¹(c + b δξ),   (m − g b) δξ = a·w + g c

(closest-point projection: Wriggers, Computational Contact Mechanics, 2006, ch. 4; the second derivatives are exact).
Walls meet only where they face each other at rest and share no node; where one was pushed through another, there is
no energy, so that the solver takes a shorter step.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from pliant.meshing.cells import face_cell_kind
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleProblem
from pliant_plugins.fem.skfem.basis import ELEMENTS
from pliant_plugins.fem.skfem.contact import ContactSkin, PlaneContact
from pliant_plugins.fem.skfem.unknowns import Globals

NEAR = 0.1  # of the wall: walls within this distance are coupled in the matrix already, with zeros
DEEP = 0.25  # of the wall: points farther behind a face have not come through it
REACH = 4.0  # walls: beyond this distance a step that takes one through another may go undetected
EDGE = 0.01  # of a face: how far beyond its edge a point still meets it
DAMPED, MOST = 3, 12  # steps of a projection: the first without the faces' curvature, all at most
CLOSE = 1e-13  # the last step, in a face's own coordinates
FAR = 0.5  # how far outside a face's own coordinates a projection may stray


@dataclass(frozen=True, eq=False)
class Facet:
    """Shape functions of the faces of one kind, N = Σ coefficient · ξ^i η^j, nodes in scikit-fem's order.

    Attributes:
        powers: (n, 2).
        coefficients: (n, n) by monomial and node.
        triangle: whether faces are triangles, ξ + η ≤ 1.
    """

    powers: IntArray
    coefficients: Array
    triangle: bool

    def jets(self, at: Array) -> tuple[Array, Array, Array]:
        """Return N (p, n), ∂N (p, 2, n) and ∂²N (p, 2, 2, n) at (p, 2)."""
        one, zero = np.ones(len(at)), np.zeros(len(at))
        # 1, t, t² and their slopes, of ξ and of η
        xs, ys = (
            [
                np.stack([one, t, t * t], 1),
                np.stack([zero, one, 2 * t], 1),
                np.stack([zero, zero, 2 * one], 1),
            ]
            for t in at.T
        )
        i, j = self.powers.T

        def term(a: int, b: int) -> Array:
            return (xs[a][:, i] * ys[b][:, j]) @ self.coefficients

        first = np.stack([term(1, 0), term(0, 1)], axis=1)
        mixed = term(1, 1)
        second = np.stack([np.stack([term(2, 0), mixed], 1), np.stack([mixed, term(0, 2)], 1)], axis=1)
        return term(0, 0), first, second

    def outside(self, at: Array) -> Array:
        """Return (p,) distances of (p, 2) outside a face, in its coordinates; at most 0 on it."""
        beyond = [-at[:, 0], -at[:, 1]]
        beyond += [at.sum(axis=1) - 1] if self.triangle else [at[:, 0] - 1, at[:, 1] - 1]
        return np.max(beyond, axis=0)

    def project(self, points: Array, faces: Array) -> Array:
        """Return (p, 2) closest points to (p, 3) on the faces' nodes (p, n, 3), extended beyond their edges."""
        at = np.full((len(points), 2), 1 / 3 if self.triangle else 0.5)
        for number in range(MOST):
            value, first, second = self.jets(at)
            away = points - np.einsum("pn,pni->pi", value, faces)
            along = np.einsum("pan,pni->pai", first, faces)
            matrix = np.einsum("pai,pbi->pab", along, along)
            if number >= DAMPED:
                matrix = matrix - np.einsum("pabn,pni,pi->pab", second, faces, away)
            step = _solved(matrix, np.einsum("pai,pi->pa", along, away))
            before, at = at, np.clip(at + np.clip(step, -FAR, FAR), -FAR, 1 + FAR)
            if np.max(np.abs(at - before), initial=0.0) < CLOSE:
                break
        return at


def _solved(matrix: Array, right: Array) -> Array:
    """Return solutions (p, 2) of 2 × 2 systems."""
    (a, b), (c, d) = matrix[:, 0].T, matrix[:, 1].T
    determinant = a * d - b * c
    determinant = np.where(np.abs(determinant) > 1e-12 * (a * d + 1e-300), determinant, np.inf)
    f, g = right.T
    return np.stack([d * f - b * g, a * g - c * f], axis=1) / determinant[:, None]


@cache
def _facet(name: str) -> Facet:
    of = ELEMENTS[name]
    places, triangle = np.asarray(of.face.doflocs, float), of.vertices == 4
    powers = np.array([(i, j) for i in range(3) for j in range(3) if not triangle or i + j <= 2])
    monomials = places[:, None, 0] ** powers[:, 0] * places[:, None, 1] ** powers[:, 1]
    return Facet(powers, np.linalg.inv(monomials), triangle)


def mesh_facet(faces: IntArray) -> Facet:
    """Return the shape functions of a mesh's faces."""
    return _facet(face_cell_kind(faces).name)


@dataclass(frozen=True, eq=False)
class Met:
    """Pairs of a point of the skin and a face that it is near or behind, p of them.

    Attributes:
        face, point: (p,) numbers of the point's face and of the quadrature point on it.
        other: (p,) numbers of the faces.
        at: (p, 2) projections, in those faces' coordinates.
        depth_m: (p,) D, negative where they are apart.
    """

    face: IntArray
    point: IntArray
    other: IntArray
    at: Array
    depth_m: Array

    def select(self, chosen: NDArray[np.bool_] | IntArray) -> Met:
        """Select some of the pairs."""
        own, other = (self.face[chosen], self.point[chosen]), self.other[chosen]
        return Met(*own, other, self.at[chosen], self.depth_m[chosen])


@dataclass(frozen=True, eq=False)
class Pressing:
    """Contact energy of walls, by pairs of faces (m) and the globals (G).

    Attributes:
        value_j: of all.
        dofs: (m, d) displacements of the points' faces, then of the others'.
        columns: (m, d + G, 1 + G) gradient and the Hessian's columns of the globals.
        matrix: (m, d, d) Hessian over the displacements, zero for pairs that are near only.
    """

    value_j: float
    dofs: IntArray
    columns: Array
    matrix: Array


@dataclass(frozen=True, eq=False)
class WallContact:
    """The skin of a piece that may meet itself, at nodes of rest (n, 3)."""

    skin: ContactSkin
    nodes_m: Array

    @cached_property
    def _facet(self) -> Facet:
        return mesh_facet(self.skin.faces.nodes)

    @cached_property
    def _rest(self) -> tuple[Array, Array]:
        """(f, 3) means of the nodes and normals of the faces at rest."""
        nodes = self.nodes_m[self.skin.faces.nodes]
        return nodes.mean(axis=1), self._across(nodes)

    def _across(self, nodes: Array) -> Array:
        """Return (f, 3) normals at the middles of faces (f, n, 3)."""
        along = self._facet.jets(np.full((1, 2), 1 / 3 if self._facet.triangle else 0.5))[1][0]
        return _normal(np.einsum("an,fni->fai", along, nodes))

    def deepest(self, x: Array, strain: float) -> float:
        """Return the largest compression as a share of the wall, 0 without contact."""
        met = self.near(x, strain)
        assert met is not None  # x is a state
        return max(0.0, float(np.max(met.depth_m, initial=0.0)) / 2 / self.skin.wall_m)

    def near(self, x: Array, strain: float) -> Met | None:
        """Return the points near a face at x, or behind it, each with the nearest face; None if walls are swapped."""
        skin, wall = self.skin, self.skin.wall_m
        nodes = self._placed(x, strain)
        points = np.einsum("qa,fai->fqi", skin.faces.value, nodes)
        found = self._facing(nodes)
        if found is None:
            return None
        first, second = found
        low, high = nodes.min(axis=1)[second] - DEEP * wall, nodes.max(axis=1)[second] + DEEP * wall
        at = points[first]
        pair, point = np.nonzero(np.all((at >= low[:, None]) & (at <= high[:, None]), axis=2))
        face, other = first[pair], second[pair]
        faces, away = nodes[other], points[face, point]
        projected = self._facet.project(away, faces)
        value, along, _ = self._facet.jets(projected)
        away = away - np.einsum("pn,pni->pi", value, faces)
        normal = _normal(np.einsum("pan,pni->pai", along, faces))
        own = _normal(np.einsum("pan,pni->pai", skin.faces.slope[point], nodes[face]))
        depth = -np.sum(normal * away, axis=1)
        kept = (depth > -NEAR * wall) & (depth < DEEP * wall) & (np.sum(normal * own, axis=1) < 0)
        kept &= self._facet.outside(projected) <= EDGE
        met = Met(face, point, other, projected, depth).select(kept)
        order = np.lexsort((np.abs(met.depth_m), met.point, met.face))
        _, best = np.unique(met.face[order] * len(skin.faces.weight) + met.point[order], return_index=True)
        return met.select(order[best])

    def _placed(self, x: Array, strain: float) -> Array:
        """Return (f, n, 3) section coordinates (s, y, z) of the faces' nodes."""
        nodes = self.nodes_m * np.array([1 + strain, 1.0, 1.0]) + x[: self.nodes_m.size].reshape(-1, 3)
        return nodes[self.skin.faces.nodes]

    def _facing(self, nodes: Array) -> tuple[IntArray, IntArray] | None:
        """Return ordered pairs of close faces that face each other at rest and share no node.

        None where two of them have changed sides.
        """
        (centres, normals), ids, wall = self._rest, self.skin.faces.nodes, self.skin.wall_m
        here = nodes.mean(axis=1)
        radius = np.linalg.norm(nodes - here[:, None], axis=2).max()
        first, second = KDTree(here).query_pairs(2 * radius + REACH * wall, output_type="ndarray").T
        before, behind = _sides(centres, normals, first, second)
        first, second = first[(before > 0) & (behind > 0)], second[(before > 0) & (behind > 0)]
        apart = ~np.any(ids[first][:, :, None] == ids[second][:, None, :], axis=(1, 2))
        first, second = first[apart], second[apart]
        before, behind = _sides(here, self._across(nodes), first, second)
        away = np.linalg.norm(here[first] - here[second], axis=1)
        swapped = (before < -DEEP * wall) & (behind < -DEEP * wall)
        if np.any(swapped & (np.minimum(before, behind) < -0.7 * away)):
            return None
        close = away <= 2 * radius + DEEP * wall
        first, second = first[close], second[close]
        return np.concatenate([first, second]), np.concatenate([second, first])

    def pressing(self, met: Met, x: Array, active: Globals) -> Pressing:
        """Return the contact energy of walls to second order."""
        slope, bend = self._closest(met, self._placed(x, active.split(x)[1]), active)
        weight = self.skin.weight[met.face, met.point]
        energy, pressure, stiffness = (weight * part for part in self.skin.law(met.depth_m / 2))
        # D = −g, and each wall is compressed by half of it
        hessian = stiffness[:, None, None] / 4 * slope[:, :, None] * slope[:, None, :]
        hessian -= pressure[:, None, None] / 2 * bend
        gradient = -pressure[:, None] / 2 * slope
        # points of one pair of faces add up
        pairs, place = np.unique(np.column_stack([met.face, met.other]), axis=0, return_inverse=True)
        total = np.zeros((len(pairs), *hessian.shape[1:])), np.zeros((len(pairs), gradient.shape[1]))
        np.add.at(total[0], place.ravel(), hessian)
        np.add.at(total[1], place.ravel(), gradient)
        d = slope.shape[1] - active.count
        columns = np.concatenate([total[1][:, :, None], total[0][:, :, d:]], axis=2)
        nodes = self.skin.faces.nodes[pairs].reshape(len(pairs), -1)
        dofs = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(pairs), -1)
        return Pressing(float(energy.sum()), dofs, columns, total[0][:, :d, :d])

    def _closest(self, met: Met, nodes: Array, active: Globals) -> tuple[Array, Array]:
        """Return ∂g (p, d + G) and ∂²g (p, d + G, d + G) in the displacements of both faces and the globals."""
        faces, ids, G = self.skin.faces, self.skin.faces.nodes, active.count
        value, first, second = self._facet.jets(met.at)
        other, X = nodes[met.other], self.nodes_m[ids, 0]
        along = np.einsum("pan,pni->pai", first, other)
        normal = _normal(along)
        own = faces.value[met.point]

        def operator(mine: Array, theirs: Array) -> Array:
            """Return (p, d + G, 3) of Σ mine δp − Σ theirs δp̄, from the nodes' weights (p, n)."""
            nodal = np.concatenate([mine, -theirs], axis=1)[:, :, None, None] * np.eye(3)
            out = np.zeros((len(nodal), 3 * nodal.shape[1] + G, 3))
            out[:, : out.shape[1] - G] = nodal.reshape(len(nodal), -1, 3)
            if active.stretches:
                out[:, -1, 0] = np.sum(mine * X[met.face], axis=1) - np.sum(theirs * X[met.other], axis=1)
            return out

        w = operator(own, value)
        slope = np.einsum("pdi,pi->pd", w, normal)
        c = np.stack([-operator(0 * own, first[:, a]) @ normal[:, :, None] for a in (0, 1)], axis=1)[..., 0]
        metric = np.einsum("pai,pbi->pab", along, along)
        b = np.einsum("pabn,pni,pi->pab", second, other, normal)
        g = -met.depth_m[:, None, None]
        xi = np.linalg.solve(metric - g * b, np.einsum("pai,pdi->pad", along, w) + g * c)
        turned = c + b @ xi
        cross = np.swapaxes(c, 1, 2) @ xi
        bend = -cross - np.swapaxes(cross, 1, 2) - np.swapaxes(xi, 1, 2) @ b @ xi
        return slope, bend + g * (np.swapaxes(turned, 1, 2) @ np.linalg.solve(metric, turned))


@dataclass(frozen=True, eq=False)
class Contacts:
    """All that the skin of a piece may meet: mirror planes, if it has some, and itself."""

    skin: ContactSkin
    planes: PlaneContact | None
    walls: WallContact

    @staticmethod
    def from_problem(problem: ModuleProblem, shear_pa: float, volume_m3: float) -> Contacts | None:
        """Build the contacts of a problem; None if no skin may come into contact."""
        skin = ContactSkin.from_problem(problem, shear_pa, volume_m3)
        if skin is None:
            return None
        return Contacts(
            skin, PlaneContact.from_problem(problem, skin), WallContact(skin, problem.mesh.nodes_m)
        )

    def deepest(self, x: Array, strain: float) -> float:
        """Return the largest compression as a share of the wall, 0 without contact."""
        planes = 0.0 if self.planes is None else self.planes.deepest(x, strain)
        return max(planes, self.walls.deepest(x, strain))


def _sides(centres: Array, normals: Array, first: IntArray, second: IntArray) -> tuple[Array, Array]:
    """Return the distance of the first faces in front of the second ones, and of the second in front of the first."""
    between = centres[first] - centres[second]
    return np.sum(between * normals[second], axis=1), -np.sum(between * normals[first], axis=1)


def _normal(along: Array) -> Array:
    """Return (…, 3) unit normals of tangents (…, 2, 3)."""
    across = np.cross(along[..., 0, :], along[..., 1, :])
    return np.asarray(across / np.linalg.norm(across, axis=-1, keepdims=True))
