"""Frictionless contact with the mirror planes of a piece: neighbouring walls that meet, each its mirror image.

In the rod frame the planes are the sections s = 0 and s = (1 + e) L, whatever the piece's angle, so that a point of
the skin lies beyond one of them by

    d = −((1 + e) X + v_x)   or   d = (1 + e)(X − L) + v_x,

linear in the unknowns. Contact stores the energy Π_c = ∫ φ(d) dA over the undeformed skin,

    φ = μ h d̂³/3,   φ' = μ d̂²,   d̂ = max(d, 0)/h,   h = `GIVE` · wall,

a penalty whose pressure reaches the shear modulus μ where walls have given way by the share `GIVE` of their thickness
(penalty contact: Wriggers, Computational Contact Mechanics, 2006, ch. 5). It is C² in the unknowns: forces have a
potential, tangents are symmetric, slopes are exact, and what does not touch is left as it was, bit for bit. The kink
that hard walls give the law where they meet is rounded over the pressure that first closes the gap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.fem import ModuleProblem
from pliant_plugins.fem.skfem.basis import FaceData, face_data
from pliant_plugins.fem.skfem.kinematics import Pointwise
from pliant_plugins.fem.skfem.unknowns import Globals

GIVE = 0.01  # of the wall: how deep a pressure of one shear modulus presses
DEEPEST = 0.02  # of the wall: beyond it a state is no longer trusted, at 4 μ


@dataclass(frozen=True, eq=False)
class PlaneContact:
    """The skin that may meet a plane; f faces, q points.

    Attributes:
        faces: quadrature of the skin, without what lies in a plane of symmetry or is held.
        weight: (f, q) reference areas.
        side: (n,) of each plane, −1 at the start, 1 at the end.
        ahead_m: (n, f, q) X of the points from each plane, positive beyond it.
        wall_m: thickness of the wall, twice the volume over the skin's area.
        shear_pa: μ.
    """

    faces: FaceData
    weight: Array
    side: Array
    ahead_m: Array
    wall_m: float
    shear_pa: float

    @staticmethod
    def of(problem: ModuleProblem, shear_pa: float, volume_m3: float) -> PlaneContact | None:
        """None for a problem without planes."""
        mesh = problem.mesh
        skin = mesh.skin[~_in_planes(problem)]
        if not problem.contact_planes or not len(skin):
            return None
        faces = face_data(skin)
        nodes = mesh.nodes_m[faces.nodes]
        along = np.einsum("fai,qja->fqji", nodes, faces.slope)
        area = np.linalg.norm(np.cross(along[..., 0, :], along[..., 1, :]), axis=-1) * faces.weight
        X = nodes[..., 0] @ faces.value.T
        planes = {"start": (-1.0, -X), "end": (1.0, X - problem.span_m)}
        side, ahead = zip(*(planes[name] for name in problem.contact_planes), strict=True)
        wall = 2 * volume_m3 / float(area.sum())
        return PlaneContact(faces, area, np.array(side), np.array(ahead), wall, shear_pa)

    def depth(self, x: Array, strain: float) -> Array:
        """(n, f, q) by how much points lie beyond each plane, m; negative before it."""
        moved = x[3 * self.faces.nodes] @ self.faces.value.T
        return np.asarray((1 + strain) * self.ahead_m + self.side[:, None, None] * moved)

    def deepest(self, x: Array, strain: float) -> float:
        """Largest share of the wall by which one has given way, 0 where nothing touches."""
        return max(float(self.depth(x, strain).max()) / self.wall_m, 0.0)

    def energy(self, x: Array, active: Globals) -> Pointwise | None:
        """φ in (v_x, globals) at the skin's points, all planes together; None where nothing touches."""
        depth = self.depth(x, active.split(x)[1])
        if not np.any(depth > 0):
            return None
        h = GIVE * self.wall_m
        beyond = np.maximum(depth, 0.0) / h
        pressure, stiffness = self.shear_pa * beyond**2, 2 * self.shear_pa / h * beyond
        # d depends on v_x and, among the globals, on e alone
        slope = np.zeros((*depth.shape, 1 + active.count))
        slope[..., 0] = self.side[:, None, None]
        if active.stretches:
            slope[..., -1] = self.ahead_m
        return Pointwise(
            (self.shear_pa * h / 3 * beyond**3).sum(axis=0),
            (pressure[..., None] * slope).sum(axis=0),
            np.einsum("nfq,nfqi,nfqj->fqij", stiffness, slope, slope),
        )


def _in_planes(problem: ModuleProblem) -> NDArray[np.bool_]:
    """(g,) which faces of the skin are cuts: all of their nodes in one section or one set that is held."""
    mesh, cuts = problem.mesh, np.zeros(len(problem.mesh.skin), bool)
    for name in {"start", "end", *problem.fixed}:
        if name in mesh.node_sets:
            cuts |= np.isin(mesh.skin, mesh.node_sets[name]).all(axis=1)
    return cuts
