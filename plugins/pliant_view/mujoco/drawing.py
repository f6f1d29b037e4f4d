"""A scene as a MuJoCo model for drawing only: every body is placed explicitly, without simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from pliant.mechanics.kinematics import ChainGeometry, Pose
from pliant.mechanics.rotations import quaternion_from_matrix
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.scene import Scene, SceneFrames
from pliant.records.shape import Shape
from pliant_view.mujoco.skins import ChainSkin, chain_skin, dressed, shape_surface

ARM = ((0.98, 0.85, 0.67, 1.0), (0.55, 0.72, 0.86, 1.0), (0.72, 0.82, 0.60, 1.0), (0.87, 0.64, 0.62, 1.0))
OBJECT = ((0.86, 0.42, 0.30, 1.0), (0.30, 0.52, 0.72, 1.0), (0.45, 0.62, 0.35, 1.0))
STEEL = (0.56, 0.60, 0.66, 1.0)  # an arm that carries a chain
DARK = (0.24, 0.27, 0.33, 1.0)
PAPER, LINE = (0.95, 0.96, 0.97), (0.62, 0.66, 0.73)
MOUNT = 0.035  # thickness of the base plate, of the extent
STEEL_KG_M3 = 7850.0
THREAD = 0.06  # radius of the payload's thread, as a share of the ball's
SIGNS = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
GEOMS = {
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID,
}


@dataclass(frozen=True, eq=False)
class Extent:
    """The box (2, 3) around all that moves, and the points (k, 3) that a camera must see."""

    box: Array
    points: Array

    @property
    def size_m(self) -> float:
        """Diagonal of the bounding box of the drawn scene, m."""
        return float(np.linalg.norm(self.box[1] - self.box[0]))


class SceneDrawing:
    """The model, its data, and the transfer of a frame into them.

    Args:
        scene: arms' shapes are what is drawn of them (surfaces rather than collision shapes); objects' too.
        frames: the motion; the camera and the floor's grid are fitted to it.
        picture: (width, height) of the largest picture in pixels.
        sliders: name → range of controls that the interactive window offers; they move nothing here.
    """

    def __init__(
        self,
        scene: Scene,
        frames: SceneFrames,
        picture: tuple[int, int],
        sliders: Mapping[str, tuple[float, float]] | None = None,
    ) -> None:
        self.scene = replace(scene, arms=tuple(replace(arm, chain=dressed(arm.chain)) for arm in scene.arms))
        scene = self.scene
        self._geometries = [ChainGeometry.from_chain(arm.chain) for arm in scene.arms]
        self._straight = [g.forward(np.zeros((g.n_joints, len(g.axes)))) for g in self._geometries]
        self._skins = [chain_skin(arm.chain) for arm in scene.arms]
        self.extent = self._extent(frames)
        target = self.extent.size_m / 8
        power = 10.0 ** np.floor(np.log10(target))
        # The largest of 1, 2, 5 × 10ⁿ that is not above the target.
        self.square_m = float(max(f * power for f in (1.0, 2.0, 5.0) if f * power <= target * (1 + 1e-9)))
        spec = self._spec(picture)
        _add_sliders(spec, sliders or {})
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._mocap = np.array(self.model.body_mocapid)
        self.place(frames, 0)

    def place(self, frames: SceneFrames, index: int) -> None:
        """Put every body where frame `index` has it."""
        for number, geometry in enumerate(self._geometries):
            pose = self._pose(geometry, frames, number, index)
            for body in range(geometry.n_joints + 1):
                self._put(f"arm{number}_{body}", pose.origins[body], pose.rotations[body])
            if (skin := self._skins[number]) is not None:
                for bone, (origin, turn) in enumerate(zip(*skin.bones(pose), strict=True)):
                    self._put(f"bone{number}_{bone}", origin, turn)
            if self.scene.arms[number].chain.payload_kg > 0:
                tip = pose.origins[-1] + pose.rotations[-1] @ geometry.tip_offset
                self._put(f"payload{number}", tip, self._upright)
        for number in range(len(self.scene.objects)):
            self._put(f"object{number}", frames.positions_m[index, number], frames.rotations[index, number])
        mujoco.mj_forward(self.model, self.data)

    def _put(self, name: str, position_m: Array, rotation: Array) -> None:
        slot = self._mocap[self.model.body(name).id]
        self.data.mocap_pos[slot] = position_m
        self.data.mocap_quat[slot] = quaternion_from_matrix(rotation)

    def _spec(self, picture: tuple[int, int]) -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        spec.modelname = "pliant"
        box, size = self.extent.box, self.extent.size_m
        spec.stat.center, spec.stat.extent = box.mean(axis=0), size
        glob = spec.visual.global_
        glob.offwidth, glob.offheight, glob.fovy = int(picture[0]), int(picture[1]), 30.0
        glob.azimuth, glob.elevation = 120.0, -18.0
        spec.visual.map.znear, spec.visual.map.zfar = 0.02, 60.0
        spec.visual.quality.shadowsize, spec.visual.quality.offsamples = 4096, 4
        spec.visual.headlight.ambient = [0.36] * 3
        spec.visual.headlight.diffuse = [0.32] * 3
        spec.visual.headlight.specular = [0.06] * 3
        floor = self.scene.floor_m
        below = float(box[0, 2] - 0.12 * size)  # all that moves
        _surroundings(spec, below if floor is None else floor, self.square_m, box.mean(axis=0), size)
        for number, arm in enumerate(self.scene.arms):
            self._add_arm(spec, number, arm.chain, self._skins[number])
        for number, thing in enumerate(self.scene.objects):
            body = spec.worldbody.add_body(name=f"object{number}", mocap=True)
            colour = STEEL if number < self.scene.carriers else OBJECT[number % len(OBJECT)]
            for k, shape in enumerate(thing.shapes):
                _add_shape(spec, body, shape, colour, f"object{number}_{k}")
        for number, obstacle in enumerate(self.scene.obstacles):
            for k, shape in enumerate(obstacle.shapes):
                _add_shape(spec, spec.worldbody, shape, STEEL, f"obstacle{number}_{k}")
        return spec

    def _add_arm(self, spec: mujoco.MjSpec, number: int, chain: ChainModel, skin: ChainSkin | None) -> None:
        colour = ARM[number % len(ARM)]
        bodies = [
            spec.worldbody.add_body(name=f"arm{number}_{k}", mocap=True) for k in range(chain.n_joints + 1)
        ]
        for k, shapes in enumerate(chain.shapes):
            for i, shape in enumerate(shapes):
                if shape_surface(shape) is None:
                    _add_shape(spec, bodies[k], shape, colour, f"arm{number}_{k}_{i}")
        if chain.payload_kg > 0:
            radius, thread = self._hung(number)
            hung = spec.worldbody.add_body(name=f"payload{number}", mocap=True)
            weight = hung.add_geom(type=GEOMS["sphere"], pos=[0.0, 0.0, -thread - radius], rgba=DARK)
            weight.size = [radius, 0, 0]
            line = hung.add_geom(type=GEOMS["cylinder"], pos=[0.0, 0.0, -thread / 2], rgba=DARK)
            line.size = [THREAD * radius, thread / 2, 0]
        if skin is not None:
            self._add_skin(spec, number, skin, colour)
        if skin is not None and self.scene.arms[number].base_object is None:
            plate = bodies[0].add_geom(type=GEOMS["box"], rgba=DARK)
            plate.pos, plate.size = _mount(skin, self._straight[number], MOUNT * self.extent.size_m)

    def _hung(self, number: int) -> tuple[float, float]:
        """Return the radius of a steel ball of the payload's mass, and the length of a thread that clears the tip."""
        chain, skin = self.scene.arms[number].chain, self._skins[number]
        radius = float((3 * chain.payload_kg / (4 * np.pi * STEEL_KG_M3)) ** (1 / 3))
        if skin is None:
            return radius, radius
        straight = self._straight[number]
        tip = straight.origins[-1] + straight.rotations[-1] @ self._geometries[number].tip_offset
        local = (skin.rest.vertices_m - tip) @ straight.rotations[-1]
        return radius, radius + float(np.linalg.norm(local[:, 1:], axis=1).max())

    @property
    def _upright(self) -> Array:
        """(3, 3) a rotation whose z points against gravity, up without any."""
        gravity = self.scene.gravity_m_s2
        size = float(np.linalg.norm(gravity))
        z = -gravity / size if size > 0 else np.array([0.0, 0.0, 1.0])
        x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
        x /= np.linalg.norm(x)
        return np.column_stack([x, np.cross(z, x), z])

    def _add_skin(self, spec: mujoco.MjSpec, number: int, skin: ChainSkin, colour: tuple[float, ...]) -> None:
        origins, turns = skin.bones(self._straight[number])
        followed, share = skin.followed()
        names, ids, weights = [], [], []
        for bone in range(len(origins)):
            spec.worldbody.add_body(name=f"bone{number}_{bone}", mocap=True)
            first = followed == bone
            second = (followed + 1 == bone) & (share > 0.0)
            mine = np.flatnonzero(first | second)
            if len(mine):
                names.append(bone)
                ids.append(mine.tolist())
                weights.append(np.where(first, 1.0 - share, share)[mine].tolist())
        drawn = spec.add_skin(name=f"skin{number}", rgba=colour)
        drawn.vert = skin.rest.vertices_m.ravel().tolist()
        drawn.face = skin.rest.faces.ravel().tolist()
        drawn.bodyname = [f"bone{number}_{bone}" for bone in names]
        drawn.bindpos = np.concatenate([origins[bone] for bone in names]).tolist()
        quaternions = [quaternion_from_matrix(turns[bone]) for bone in names]
        drawn.bindquat = np.concatenate(quaternions).tolist()
        drawn.vertid, drawn.vertweight = ids, weights

    def _extent(self, frames: SceneFrames) -> Extent:
        """Return the extent of the arms and objects of some frames."""
        chosen = np.unique(np.linspace(0, len(frames.time_s) - 1, 12).astype(int))
        points = []
        for index in chosen.tolist():
            for number, geometry in enumerate(self._geometries):
                pose = self._pose(geometry, frames, number, index)
                skin = self._skins[number]
                tip = pose.origins[-1] + pose.rotations[-1] @ geometry.tip_offset
                seen = [pose.origins, tip[None]]
                if self.scene.arms[number].chain.payload_kg > 0:
                    radius, thread = self._hung(number)
                    seen.append(tip + (SIGNS * radius - [0.0, 0.0, thread + radius]) @ self._upright.T)
                if skin is not None:
                    seen.append(skin.posed(self._straight[number], pose)[::7])
                    middle, half = _mount(
                        skin, self._straight[number], MOUNT * np.ptp(pose.origins, axis=0).max()
                    )
                    seen.append((middle + SIGNS * half) @ pose.rotations[0].T + pose.origins[0])
                points.append(np.vstack(seen))
            for number, thing in enumerate(self.scene.objects):
                corners = np.concatenate([np.zeros((1, 3)), *(_corners(shape) for shape in thing.shapes)])
                turn = frames.rotations[index, number]
                points.append(corners @ turn.T + frames.positions_m[index, number])
        points += [_corners(shape) for obstacle in self.scene.obstacles for shape in obstacle.shapes]
        every = np.concatenate(points)
        return Extent(np.array([every.min(axis=0), every.max(axis=0)]), every)

    def _pose(self, geometry: ChainGeometry, frames: SceneFrames, number: int, index: int) -> Pose:
        """Return an arm of the scene in the world at a frame."""
        place = frames.carriage_m[index], frames.positions_m[index], frames.rotations[index]
        moved, turn = self.scene.base_motion(number, *place)
        if turn is None and frames.carriage_turns is not None:
            turn = frames.carriage_turns[index]
        return geometry.forward(frames.coordinates[number][index]).moved(moved, turn)


def _surroundings(spec: mujoco.MjSpec, floor_m: float, square_m: float, centre: Array, size_m: float) -> None:
    """Add a white sky, a floor with a grid of `square_m` and a lamp with shadows."""
    sky = {"builtin": mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, "rgb1": [1.0] * 3, "width": 256, "height": 256}
    spec.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, rgb2=PAPER, **sky)
    edge = {"builtin": mujoco.mjtBuiltin.mjBUILTIN_FLAT, "mark": mujoco.mjtMark.mjMARK_EDGE, "markrgb": LINE}
    flat = {"rgb1": PAPER, "rgb2": PAPER, "width": 80, "height": 80}
    spec.add_texture(name="grid", type=mujoco.mjtTexture.mjTEXTURE_2D, **edge, **flat)
    material = spec.add_material(name="floor", texrepeat=[1 / square_m, 1 / square_m], texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "grid"
    material.specular, material.reflectance, material.emission = 0.0, 0.0, 0.15
    plane = {"pos": [0.0, 0.0, floor_m], "size": [40 * size_m, 40 * size_m, square_m], "material": "floor"}
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, **plane)
    lamp = spec.worldbody.add_light(pos=centre + size_m * np.array([0.9, -1.3, 3.0]))
    lamp.dir = [-0.3, 0.43, -1.0]
    lamp.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    lamp.diffuse, lamp.specular, lamp.castshadow = [0.42] * 3, [0.1] * 3, True


def _add_sliders(spec: mujoco.MjSpec, sliders: Mapping[str, tuple[float, float]]) -> None:
    """Add a control per slider, each on a body without shape that is never simulated."""
    for name, limits in sliders.items():
        dummy = spec.worldbody.add_body(name=f"slider {name}", gravcomp=1.0)
        dummy.mass, dummy.inertia, dummy.explicitinertial = 1.0, [1.0, 1.0, 1.0], True
        dummy.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE)
        control = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        control.ctrllimited, control.ctrlrange = True, limits


def _add_shape(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, shape: Shape, colour: tuple[float, ...], name: str
) -> None:
    geom = body.add_geom(rgba=colour, pos=shape.position_m, quat=quaternion_from_matrix(shape.rotation))
    if shape.kind == "mesh" and shape.mesh is not None:
        mesh = spec.add_mesh(name=name)
        mesh.uservert = shape.mesh.vertices_m.ravel().tolist()
        mesh.userface = shape.mesh.faces.ravel().tolist()
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # open surfaces have no volume
        geom.type, geom.meshname = mujoco.mjtGeom.mjGEOM_MESH, name
        return
    geom.type = GEOMS[shape.kind]
    geom.size = np.pad(np.array(shape.size_m, float), (0, 3 - len(shape.size_m)))


def _corners(shape: Shape) -> Array:
    """Return corners of a box around the shape, in the body's frame; a mesh's own vertices."""
    if shape.kind == "mesh" and shape.mesh is not None:
        return shape.mesh.placed(shape.rotation, shape.position_m).vertices_m
    size = shape.size_m
    half = np.array(size if len(size) == 3 else [size[0]] * 3)
    if shape.kind in ("capsule", "cylinder"):
        half = np.array([size[0], size[0], size[1] + (size[0] if shape.kind == "capsule" else 0.0)])
    return np.asarray((SIGNS * half) @ shape.rotation.T + shape.position_m)


def _mount(skin: ChainSkin, straight: Pose, thickness_m: float) -> tuple[Array, Array]:
    """Return middle and half edges, in the base frame, of a plate behind the base as wide as the straight arm."""
    local = (skin.rest.vertices_m - straight.origins[0]) @ straight.rotations[0]
    low, high = local.min(axis=0), local.max(axis=0)
    middle, half = 0.5 * (low + high), 0.575 * (high - low)
    return np.array([-0.5 * thickness_m, *middle[1:]]), np.array([0.5 * thickness_m, *half[1:]])
