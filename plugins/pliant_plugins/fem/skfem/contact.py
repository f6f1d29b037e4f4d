"""Frictionless contact of a piece with its mirror planes: each wall meets its own mirror image.

In the rod frame the planes are the sections s = 0 and s = (1 + e) L, whatever the piece's angle, and y = 0 where half
the width is solved, so that a point of the skin is beyond one of them by

    d = −((1 + e) X + v_x),   d = (1 + e)(X − L) + v_x   or   d = −(Y + v_y),

linear in the unknowns. Contact stores the energy Π_c = ∫ φ(d) dA over the undeformed skin,

    φ = μ h d̂³/3,   φ' = μ d̂²,   d̂ = max(d, 0)/h,   h = `GIVE` · wall,

a penalty whose pressure reaches the shear modulus μ when walls are compressed by the share `GIVE` of their thickness
(penalty contact: Wriggers, Computational Contact Mechanics, 2006, ch. 5). It is C² in the unknowns: forces have a
potential, tangents are symmetric, slopes are exact, and without contact results are unchanged bit for bit. The kink of
the law at first contact of rigid walls is rounded over the pressure that closes the gap. For contact between walls
inside the piece see `walls`.
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
MIRROR = "symmetry"  # node set in the plane y = 0


@dataclass(frozen=True, eq=False)
class ContactSkin:
    """The skin that may come into contact; f faces, q points.

    Attributes:
        faces: quadrature of the skin, without faces in a plane of symmetry or on a fixed section.
        weight: (f, q) reference areas.
        wall_m: thickness of the wall, twice the volume over the skin's area.
        shear_pa: μ.
    """

    faces: FaceData
    weight: Array
    wall_m: float
    shear_pa: float

    @staticmethod
    def from_problem(problem: ModuleProblem, shear_pa: float, volume_m3: float) -> ContactSkin | None:
        """Build the skin of a problem; None if no faces remain."""
        mesh = problem.mesh
        skin = mesh.skin[~_in_planes(problem)]
        if not len(skin):
            return None
        faces = face_data(skin)
        along = np.einsum("fai,qja->fqji", mesh.nodes_m[faces.nodes], faces.slope)
        area = np.linalg.norm(np.cross(along[..., 0, :], along[..., 1, :]), axis=-1) * faces.weight
        return ContactSkin(faces, area, 2 * volume_m3 / float(area.sum()), shear_pa)

    def law(self, depth_m: Array) -> tuple[Array, Array, Array]:
        """Return φ (J/m²), φ' (Pa) and φ'' (Pa/m) of a wall at a penetration."""
        h = GIVE * self.wall_m
        beyond = np.maximum(depth_m, 0.0) / h
        return (
            self.shear_pa * h / 3 * beyond**3,
            self.shear_pa * beyond**2,
            2 * self.shear_pa / h * beyond,
        )


@dataclass(frozen=True, eq=False)
class PlaneContact:
    """The skin and the planes that it may meet.

    Attributes:
        skin: what may touch.
        normal: (n, 2) of each plane, its outward normal's x and y.
        ahead_m: (n, f, q) how far the points are beyond each plane at rest.
    """

    skin: ContactSkin
    normal: Array
    ahead_m: Array

    @staticmethod
    def from_problem(problem: ModuleProblem, skin: ContactSkin) -> PlaneContact | None:
        """Build the contact planes of a problem; None for one without planes."""
        nodes = problem.mesh.nodes_m[skin.faces.nodes]
        X, Y = (nodes[..., c] @ skin.faces.value.T for c in (0, 1))
        planes = {"start": ((-1.0, 0.0), -X), "end": ((1.0, 0.0), X - problem.span_m)}
        chosen = [planes[name] for name in problem.contact_planes]
        if 1 in problem.fixed.get(MIRROR, ()):
            chosen.append(((0.0, -1.0), -Y))
        if not chosen:
            return None
        normal, ahead = zip(*chosen, strict=True)
        return PlaneContact(skin, np.array(normal), np.array(ahead))

    def depth(self, x: Array, strain: float) -> Array:
        """Return (n, f, q) distances of points beyond each plane, m; negative before it."""
        dofs, value = 3 * self.skin.faces.nodes, self.skin.faces.value.T
        moved = np.stack([x[dofs] @ value, x[dofs + 1] @ value])
        return np.asarray(self._stretch(strain) * self.ahead_m + np.tensordot(self.normal, moved, axes=1))

    def _stretch(self, strain: float) -> Array:
        """Return (n, 1, 1): 1 + e across sections, 1 else."""
        return (1 + strain * np.abs(self.normal[:, 0]))[:, None, None]

    def deepest(self, x: Array, strain: float) -> float:
        """Return the largest compression as a share of the wall, 0 without contact."""
        return max(float(self.depth(x, strain).max()) / self.skin.wall_m, 0.0)

    def energy(self, x: Array, active: Globals) -> Pointwise | None:
        """Return φ in (v_x, v_y, globals) at the skin's points, all planes together; None without contact."""
        depth = self.depth(x, active.split(x)[1])
        if not np.any(depth > 0):
            return None
        energy, pressure, stiffness = self.skin.law(depth)
        # d depends on v and, among the globals, on e alone
        slope = np.zeros((*depth.shape, 2 + active.count))
        slope[..., :2] = self.normal[:, None, None]
        if active.stretches:
            slope[..., -1] = np.abs(self.normal[:, :1, None]) * self.ahead_m
        return Pointwise(
            energy.sum(axis=0),
            (pressure[..., None] * slope).sum(axis=0),
            np.einsum("nfq,nfqi,nfqj->fqij", stiffness, slope, slope),
        )


def _in_planes(problem: ModuleProblem) -> NDArray[np.bool_]:
    """Return (g,) which faces of the skin are cuts: all of their nodes in one section or one fixed set."""
    mesh, cuts = problem.mesh, np.zeros(len(problem.mesh.skin), bool)
    for name in {"start", "end", *problem.fixed}:
        if name in mesh.node_sets:
            cuts |= np.isin(mesh.skin, mesh.node_sets[name]).all(axis=1)
    return cuts
