"""One smooth surface per arm: halves of modules are bent along an arc from body to body across their joint.

Blending two bodies linearly would pin the surface at each joint and kink it between joints: a flat strip comes out
scalloped. So a joint has `KNOTS` frames on the screw motion from one body to the next, an arc of constant curvature
for a revolute joint, and a vertex follows the two that are nearest. Shapes marked as rigid keep their form. Skins are
for pictures only; engines use rigid bodies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from pliant.mechanics.kinematics import ChainGeometry, Pose
from pliant.mechanics.rotations import exp_map, left_jacobian, log_map
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.shape import Shape, TriangleMesh

AT_JOINT = 0.02  # of a half's length: closer than this, it ends at the joint
WELD_M = 1e-7
SLENDER = 0.02  # radius of a chain that has no shapes, of its length
KNOTS = 8  # steps of the arc across a joint
SIDES = 40  # of a drawn cylinder
CREASE_COSINE = np.cos(np.radians(35.0))


@dataclass(frozen=True, eq=False)
class ChainSkin:
    """A surface that follows the bodies of a chain.

    Attributes:
        rest: vertices (v, 3) and faces of the straight chain, in the world.
        body: (v,) the proximal of the two bodies that a vertex follows; the other is the next one.
        share: (v,) of the way to the next body, 0 to 1.
        ends_m: (n, 2) where the arc across each joint begins and ends, along x from the origins of its two bodies.
    """

    rest: TriangleMesh
    body: NDArray[np.int64]
    share: Array
    ends_m: Array

    def bones(self, pose: Pose) -> tuple[Array, Array]:
        """Return origins (b, 3) and rotations (b, 3, 3) of the skin's frames: `KNOTS` per joint, then the last body."""
        along = pose.rotations[:, :, 0]
        first = pose.origins[:-1] + self.ends_m[:, :1] * along[:-1]
        last = pose.origins[1:] + self.ends_m[:, 1:] * along[1:]
        turn = log_map(np.einsum("nji,njk->nik", pose.rotations[:-1], pose.rotations[1:]))
        way = np.einsum("nji,nj->ni", pose.rotations[:-1], last - first)
        velocity = np.linalg.solve(left_jacobian(turn), way[..., None])[..., 0]
        share = (np.arange(KNOTS) / KNOTS)[:, None]
        origins, rotations = [], []
        for joint in range(len(turn)):
            angle, base = share * turn[joint], pose.rotations[joint]
            moved = np.einsum("kij,kj->ki", left_jacobian(angle), share * velocity[joint])
            origins.append(first[joint] + moved @ base.T)
            rotations.append(base @ exp_map(angle))
        return (
            np.concatenate([*origins, pose.origins[-1:] + self._tail_m * along[-1:]]),
            np.concatenate([*rotations, pose.rotations[-1:]]),
        )

    def followed(self) -> tuple[NDArray[np.int64], Array]:
        """Return (v,) first of the two neighbouring bones that each vertex follows, and the weight of the second."""
        whole = self.body * KNOTS + self.share * KNOTS
        bone = np.minimum(np.floor(whole + 1e-9).astype(np.int64), KNOTS * len(self.ends_m))
        return bone, np.clip(whole - bone, 0.0, 1.0)

    def posed(self, straight: Pose, pose: Pose) -> Array:
        """Return (v, 3) vertices at a pose of the chain."""
        (rest, rest_turn), (there, turn) = self.bones(straight), self.bones(pose)
        bone, weight = self.followed()
        moved = []
        for own in (bone, np.minimum(bone + 1, len(rest) - 1)):
            turned = np.einsum("bij,bkj->bik", turn, rest_turn)[own]
            moved.append(np.einsum("vij,vj->vi", turned, self.rest.vertices_m - rest[own]) + there[own])
        return np.asarray((1.0 - weight[:, None]) * moved[0] + weight[:, None] * moved[1])

    @property
    def _tail_m(self) -> float:
        return float(self.ends_m[-1, 1]) if len(self.ends_m) else 0.0


def chain_skin(chain: ChainModel) -> ChainSkin | None:
    """Return the skin of a chain's meshes and cylinders; None if it has neither."""
    straight = ChainGeometry.from_chain(chain).forward(np.zeros((chain.n_joints, len(chain.axes))))
    parts, bodies, shares = [], [], []
    for number, shapes in enumerate(chain.shapes):
        for shape in shapes:
            mesh = shape_surface(shape)
            if mesh is None:
                continue
            body, share = _followed(chain, number, mesh.vertices_m[:, 0], shape.rigid)
            parts.append(mesh.placed(straight.rotations[number], straight.origins[number]))
            bodies.append(body)
            shares.append(share)
    if not parts:
        return None
    whole = parts[0]
    for part in parts[1:]:
        whole = whole.joined(part)
    skin = ChainSkin(whole, np.concatenate(bodies), np.concatenate(shares), _ends(chain))
    return _creased(_welded(skin))


def _ends(chain: ChainModel) -> Array:
    """Return (n, 2) ranges from the bodies' origins: half a body at each joint, the whole first and last body."""
    lengths = [joint.offset_m[0] for joint in chain.joints] + [chain.tip_offset_m[0]]
    last = len(lengths) - 1
    begins = [0.5 * lengths[k] if k else 0.0 for k in range(last)]
    ends = [0.5 * lengths[k + 1] if k + 1 < last else lengths[last] for k in range(last)]
    return np.stack([begins, ends], axis=1).reshape(-1, 2)


def dressed(chain: ChainModel) -> ChainModel:
    """Return the chain, with slender rods for bodies if it has no shapes at all."""
    if any(chain.shapes):
        return chain
    radius = SLENDER * chain.length_m
    ends = [joint.offset_m for joint in chain.joints] + [chain.tip_offset_m]
    shapes = []
    for end in ends:
        length = max(float(np.linalg.norm(end)), 1e-9)
        x, helper = end / length, np.eye(3)[int(np.argmin(np.abs(end)))]
        y = np.cross(helper, x) / np.linalg.norm(np.cross(helper, x))
        shapes.append(
            (Shape("cylinder", (radius, length / 2), 0.5 * end, np.column_stack([y, np.cross(x, y), x])),)
        )
    return chain.with_(shapes=tuple(shapes))


def shape_surface(shape: Shape) -> TriangleMesh | None:
    """Return the surface of a mesh or cylinder in the body's frame."""
    if shape.kind == "mesh" and shape.mesh is not None:
        return shape.mesh.placed(shape.rotation, shape.position_m)
    if shape.kind == "cylinder":
        return cylinder(*shape.size_m).placed(shape.rotation, shape.position_m)
    return None


def cylinder(radius_m: float, half_m: float) -> TriangleMesh:
    """Return a cylinder along z about the origin; rings along it, so that it can bend."""
    turn = np.linspace(0.0, 2 * np.pi, SIDES, endpoint=False)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1) * radius_m
    heights = np.linspace(-half_m, half_m, 9)
    rings = [np.column_stack([circle, np.full(SIDES, z)]) for z in heights]
    vertices = np.concatenate([*rings, [[0.0, 0.0, -half_m], [0.0, 0.0, half_m]]])
    here = np.arange(SIDES)
    there = (here + 1) % SIDES
    faces = []
    for ring in range(len(heights) - 1):
        low, high = ring * SIDES, (ring + 1) * SIDES
        faces += [
            np.stack([low + here, low + there, high + there], axis=1),
            np.stack([low + here, high + there, high + here], axis=1),
        ]
    bottom, top = len(vertices) - 2, len(vertices) - 1
    rim = (len(heights) - 1) * SIDES
    faces.append(np.stack([np.full(SIDES, bottom), there, here], axis=1))
    faces.append(np.stack([np.full(SIDES, top), rim + here, rim + there], axis=1))
    return TriangleMesh(vertices, np.concatenate(faces).astype(np.int64))


def _followed(
    chain: ChainModel, number: int, x: Array, rigid: bool = False
) -> tuple[NDArray[np.int64], Array]:
    """Return the proximal of the two bodies that each vertex of a piece follows, and the share of the next one."""
    if rigid:
        return np.full(len(x), number), np.zeros(len(x))
    low, high = float(x.min()), float(x.max())
    length = max(high - low, 1e-12)
    begins = number > 0 and abs(low) < AT_JOINT * length
    ends = number < chain.n_joints and abs(high - chain.joints[number].offset_m[0]) < AT_JOINT * length
    body, share = np.full(len(x), number), np.zeros(len(x))
    reach = length / 2 if begins and ends else length
    if begins:
        near = x <= low + reach
        body[near], share[near] = number - 1, 0.5 + 0.5 * (x[near] - low) / reach
    if ends:
        near = x > high - reach
        share[near] = 0.5 - 0.5 * (high - x[near]) / reach
    return body, share


def _welded(skin: ChainSkin) -> ChainSkin:
    """Weld vertices at one place and remove walls between welded pieces."""
    key = np.round(skin.rest.vertices_m / WELD_M).astype(np.int64)
    _, first, renumbered = np.unique(key, axis=0, return_index=True, return_inverse=True)
    faces = renumbered.ravel()[skin.rest.faces]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    _, which, count = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    faces = faces[count[which.ravel()] == 1]
    return ChainSkin(
        TriangleMesh(skin.rest.vertices_m[first], faces), skin.body[first], skin.share[first], skin.ends_m
    )


def _creased(skin: ChainSkin) -> ChainSkin:
    """Split vertices on sharp edges, so that smooth shading keeps the edge."""
    corners = skin.rest.vertices_m[skin.rest.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    order = np.argsort(skin.rest.faces.ravel(), kind="stable")
    faces = skin.rest.faces.copy().ravel()
    starts = np.searchsorted(faces[order], np.arange(len(skin.body) + 1))
    source = list(range(len(skin.body)))
    for vertex in range(len(skin.body)):
        corners_here = order[starts[vertex] : starts[vertex + 1]]
        own = normal[corners_here // 3]
        _, group = connected_components(own @ own.T > CREASE_COSINE, directed=False)
        for number in range(1, int(group.max(initial=0)) + 1):
            faces[corners_here[group == number]] = len(source)
            source.append(vertex)
    take = np.array(source)
    mesh = TriangleMesh(skin.rest.vertices_m[take], faces.reshape(-1, 3))
    return ChainSkin(mesh, skin.body[take], skin.share[take], skin.ends_m)
