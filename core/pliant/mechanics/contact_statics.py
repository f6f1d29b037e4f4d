"""Statics of a chain that presses on fixed obstacles without friction.

Points on the axes of the chain's capsules and spheres, with radius r, at signed distance d from an obstacle, add

    V = ½ k Σ max(0, r − d)²

to the chain's potential: forces k (r − d) n along the gradient n of d. Its Hessian is Jᵀ (k n nᵀ − k (r − d) ∂²d) J and
the geometric stiffness of the forces, which `ChainStatics` has for point forces. So an equilibrium in contact is a
minimum as any other, with exact slopes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.mechanics.kinematics import ChainGeometry, Pose
from pliant.mechanics.signed_distance import Solid
from pliant.mechanics.statics import Balance, ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import PointForce
from pliant.records.shape import Shape

# Points on the axis of a capsule, its ends included.
POINTS = 33


@dataclass(frozen=True, eq=False)
class AxisPoints:
    """Points on the axes of a chain's collision shapes: body (m,), local_m (m, 3), radius_m (m,)."""

    body: NDArray[np.int64]
    local_m: Array
    radius_m: Array

    @staticmethod
    def from_chain(chain: ChainModel) -> AxisPoints:
        """Return the points of all moving bodies.

        Raises:
            UserError: a shape that is neither a capsule nor a sphere.
        """
        bodies, points, radii = [], [], []
        for body, shapes in enumerate(chain.shapes):
            for shape in shapes if body else ():
                along = _axis(shape)
                bodies += [body] * len(along)
                points.append(along)
                radii += [shape.size_m[0]] * len(along)
        local = np.concatenate(points) if points else np.zeros((0, 3))
        return AxisPoints(np.array(bodies, np.int64), local, np.array(radii))

    def placed(self, pose: Pose) -> Array:
        """Return (m, 3) the points in the world."""
        turned = np.einsum("mij,mj->mi", pose.rotations[self.body], self.local_m)
        return np.asarray(pose.origins[self.body] + turned)


@dataclass(frozen=True, eq=False)
class Press:
    """A force (N) on one axis point along the obstacle's normal.

    Attributes:
        point: number of the axis point; `obstacle`: number of the solid.
        position_m: (3,) of the axis point; `normal`: (3,) out of the obstacle.
        depth_m, force_n: r − d > 0 and k (r − d).
    """

    point: int
    obstacle: int
    position_m: Array
    normal: Array
    depth_m: float
    force_n: float


class ContactStatics(ChainStatics):
    """Residual, stiffness and potential of one chain among obstacles."""

    def __init__(self, chain: ChainModel, solids: Sequence[Solid], stiffness_n_m: float) -> None:
        super().__init__(chain)
        self.points, self._solids, self._k = AxisPoints.from_chain(chain), tuple(solids), stiffness_n_m

    def presses(self, pose: Pose) -> list[Press]:
        """Return the contacts of a pose."""
        points, found = self.points.placed(pose), []
        for number, solid in enumerate(self._solids):
            value, normal = solid.distance(points)
            depth = self.points.radius_m - value
            for k in np.flatnonzero(depth > 0.0).tolist():
                deep = float(depth[k])
                found.append(Press(k, number, points[k], normal[k], deep, self._k * deep))
        return found

    def residual(self, q: Array, loads: Loads) -> Array:
        return super().residual(q, self._loaded(self.presses(self.geometry.forward(q)), loads))

    def balance(self, q: Array, loads: Loads) -> Balance:
        pose = self.geometry.forward(q)
        presses = self.presses(pose)
        balance = super().balance(q, self._loaded(presses, loads))
        if not presses:
            return balance
        points, normals = (np.array([getattr(p, name) for p in presses]) for name in ("position_m", "normal"))
        of_solid, forces = (np.array([getattr(p, name) for p in presses]) for name in ("obstacle", "force_n"))
        by_place = self._k * normals[:, :, None] * normals[:, None, :]
        for number in np.unique(of_solid).tolist():
            rows = of_solid == number
            by_place[rows] -= forces[rows, None, None] * self._solids[number].curvature(points[rows])
        bodies = self.points.body[[p.point for p in presses]]
        jacobian = self._point_jacobians(pose, bodies, points).reshape(len(presses), 3, -1)
        added = np.einsum("mik,mij,mjl->kl", jacobian, by_place, jacobian, optimize=True)
        return Balance(balance.residual, balance.stiffness + added)

    def _point_jacobians(self, pose: Pose, bodies: NDArray[np.int64], points_m: Array) -> Array:
        """Return (m, 3, n, a) `point_jacobian` of many points, at once."""
        directions = pose.directions.transpose(0, 2, 1)
        moved = np.broadcast_to(directions, (len(points_m), *directions.shape)).copy()
        if self.geometry.turns:
            arms = points_m[:, None] - pose.pivots
            moved = np.cross(directions, arms[:, :, None])
            slide = self.geometry.slide
            if slide is not None:
                moved[:, :, slide] = directions[:, slide]
        moved[np.arange(self.geometry.n_joints) >= bodies[:, None]] = 0.0
        return np.asarray(moved.transpose(0, 3, 1, 2))

    def potential(self, q: Array, loads: Loads) -> float:
        pressed = sum(0.5 * self._k * p.depth_m**2 for p in self.presses(self.geometry.forward(q)))
        return super().potential(q, loads) + pressed

    def _loaded(self, presses: Sequence[Press], loads: Loads) -> Loads:
        """Return the loads with the contact forces as point forces."""
        forces = tuple(
            PointForce(int(self.points.body[p.point]), self.points.local_m[p.point], p.force_n * p.normal)
            for p in presses
        )
        return replace(loads, forces=(*loads.forces, *forces)) if forces else loads


def with_capsules(chain: ChainModel, radius_m: float) -> ChainModel:
    """Return the chain with one capsule about each straight piece, or a sphere where a piece has no length."""
    geometry = ChainGeometry.from_chain(chain)
    ends = [*geometry.offsets, geometry.tip_offset]
    return chain.with_(shapes=tuple((_capsule(np.asarray(end, float), radius_m),) for end in ends))


def _capsule(end_m: Array, radius_m: float) -> Shape:
    length = float(np.linalg.norm(end_m))
    if length < 1e-9:
        return Shape("sphere", (radius_m,), 0.5 * end_m, np.eye(3))
    z = end_m / length
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x)
    turn = np.column_stack([x, np.cross(z, x), z])
    return Shape("capsule", (radius_m, 0.5 * length), 0.5 * end_m, turn)


def _axis(shape: Shape) -> Array:
    """Return points (m, 3) on the shape's axis in the body's frame.

    Raises:
        UserError: a shape that is neither a capsule nor a sphere.
    """
    if shape.kind == "sphere":
        return np.asarray(shape.position_m, float)[None]
    if shape.kind != "capsule":
        raise UserError(f"statics in contact needs capsules or spheres on the chain, not '{shape.kind}'.")
    heights = np.linspace(-shape.size_m[1], shape.size_m[1], POINTS)
    return np.asarray(shape.position_m + heights[:, None] * np.asarray(shape.rotation)[:, 2])
