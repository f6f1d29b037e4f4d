"""An external arm in MJCF: the parts that a study names, its first pose, one model of it with a chain on it."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from pliant.errors import UserError, closest
from pliant.mechanics.rotations import matrix_from_quaternion
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.mount import Mount
from pliant.records.shape import Shape, ShapeKind, TriangleMesh
from pliant_plugins.physics.mujoco.mjcf import chain_mjcf
from pliant_plugins.physics.mujoco.warned import silent

PREFIX = "soft_"
KEY = "chain.base.mount"
HIDDEN_GROUP = 3  # MuJoCo's viewers show the groups before it
# Joints of one coordinate, and its unit. MuJoCo's numbers are compared as plain ones.
ONE_COORDINATE = {int(mujoco.mjtJoint.mjJNT_HINGE): "rad", int(mujoco.mjtJoint.mjJNT_SLIDE): "m"}
FREE, ON_JOINT = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtTrn.mjTRN_JOINT)
# Of an actuator with a filter, which is at rest where its activation is its command.
FILTERS = tuple(
    map(int, (mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT, mujoco.mjtDyn.mjDYN_MUSCLE))
)
MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
KINDS: dict[int, ShapeKind] = {
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "ellipsoid",
}
SIZES = {"box": 3, "sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3}


@dataclass(frozen=True, eq=False)
class MountedArm:
    """An arm with its first pose; `qpos`, `ctrl` and `act` are in the order of the arm's model."""

    mount: Mount
    model: mujoco.MjModel
    qpos: Array
    ctrl: Array
    act: Array

    @staticmethod
    def from_mount(mount: Mount) -> MountedArm:
        """Read the file and find the parts that the study names.

        Raises:
            UserError: no file, no MJCF, an unknown name, an arm that is not fixed to the world.
        """
        model = _compiled(_spec(mount), mount)
        _check_place(model, mount)
        qpos, ctrl, act = _first_pose(model, mount)
        return MountedArm(mount, model, qpos, ctrl, act)

    def with_chain(self, chain: ChainModel) -> tuple[mujoco.MjModel, str]:
        """Return one model of both, and the prefix of the chain's names in it.

        Options are the arm's but for the integrator, which takes the laws' slopes implicitly, and gravity, the chain's.
        """
        whole, robot = _spec(self.mount), mujoco.MjSpec.from_string(chain_mjcf(chain))
        names = [one.name for one in (*whole.bodies, *whole.joints, *whole.sites)]
        prefix = PREFIX
        while any(name.startswith(prefix) for name in names):
            prefix = PREFIX + prefix
        whole.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        whole.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        whole.option.gravity = np.asarray(chain.gravity_m_s2, float)
        for name in ("integrator", "jacobian", "gravity", "timestep"):
            setattr(robot.option, name, getattr(whole.option, name))
        site = whole.site(self.mount.at)
        if site is not None:
            whole.attach(robot, prefix=prefix, site=site)
        else:
            whole.attach(robot, prefix=prefix, frame=whole.body(self.mount.at).add_frame())
        whole.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        return _compiled(whole, self.mount), prefix

    def shapes(self) -> tuple[tuple[Shape, ...], ...]:
        """Return the shapes of each body that MuJoCo's viewers show, the world's first, without planes."""
        return tuple(tuple(_body_shapes(self.model, body)) for body in range(self.model.nbody))


def _spec(mount: Mount) -> mujoco.MjSpec:
    path = mount.file
    if not path.is_file():
        beside = sorted(p.name for p in path.parent.glob("*.xml")) if path.parent.is_dir() else []
        raise UserError(f"{KEY}.file: {path} is no file{closest(path.name, beside)}")
    try:
        with silent(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return mujoco.MjSpec.from_file(str(path))
    except (ValueError, mujoco.FatalError) as error:
        raise UserError(f"{KEY}.file: {path} is no MJCF that MuJoCo reads ({_short(error)}).") from None


def _compiled(spec: mujoco.MjSpec, mount: Mount) -> mujoco.MjModel:
    try:
        with silent(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise UserError(f"{KEY}.file: MuJoCo cannot build {mount.file} ({_short(error)}).") from None


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:160]


def _names(model: mujoco.MjModel, kind: mujoco.mjtObj, count: int) -> list[str]:
    """Return names by number; "" for an object without a name."""
    return [mujoco.mj_id2name(model, kind, k) or "" for k in range(count)]


def _number(name: str, names: Iterable[str], what: str) -> int:
    """Return the index of a name; raise `UserError` with the closest one, or all of them if they are few."""
    known = list(names)
    if name in known:
        return known.index(name)
    told = [one for one in known if one]
    few = (
        f" It has {', '.join(told)}." if 0 < len(told) <= 12 else "" if told else " It has none with a name."
    )
    raise UserError(f"{KEY}.{what} '{name}'{closest(name, told)}{few}")


def _check_place(model: mujoco.MjModel, mount: Mount) -> None:
    """Raise `UserError` for a place that does not exist or is not attached to the world."""
    sites = _names(model, mujoco.mjtObj.mjOBJ_SITE, model.nsite)
    bodies = _names(model, mujoco.mjtObj.mjOBJ_BODY, model.nbody)
    if mount.at in sites:
        body = int(model.site_bodyid[sites.index(mount.at)])
    else:
        body = _number(mount.at, [*bodies, *sites], f"at: {mount.file.name} has no site or body")
    while body:
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        if any(int(model.jnt_type[k]) == FREE for k in range(first, first + count)):
            raise UserError(
                f"{KEY}.at: '{mount.at}' stands on the body '{bodies[body]}', which moves freely, so nothing holds "
                "the arm: take its free joint out of the file."
            )
        body = int(model.body_parentid[body])


def _first_pose(model: mujoco.MjModel, mount: Mount) -> tuple[Array, Array, Array]:
    """Return initial coordinates, commands and activations of the arm."""
    qpos, ctrl, act = model.qpos0.copy(), np.zeros(model.nu), np.zeros(model.na)
    keys = _names(model, mujoco.mjtObj.mjOBJ_KEY, model.nkey)
    file = mount.file.name
    if mount.keyframe is not None or model.nkey:
        key = (
            0
            if mount.keyframe is None
            else _number(mount.keyframe, keys, f"keyframe: {file} has no keyframe")
        )
        qpos, ctrl, act = model.key_qpos[key].copy(), model.key_ctrl[key].copy(), model.key_act[key].copy()
    joints = _names(model, mujoco.mjtObj.mjOBJ_JOINT, model.njnt)
    for name, value in mount.joints.items():
        joint = _number(name, joints, f"joints: {file} has no joint")
        if int(model.jnt_type[joint]) not in ONE_COORDINATE:
            raise UserError(f"{KEY}.joints: '{name}' has more than one coordinate; give hinges and slides.")
        unit = ONE_COORDINATE[int(model.jnt_type[joint])]
        if mount.units.get(name, unit) != unit:
            wanted = (
                "a hinge; give an angle such as '30 deg'"
                if unit == "rad"
                else "a slide; give a length such as '20 mm'"
            )
            raise UserError(f"{KEY}.joints: '{name}' is {wanted}.")
        qpos[model.jnt_qposadr[joint]] = value
        for k in range(model.nu):
            if _is_servo(model, k, joint):
                ctrl[k] = value * model.actuator_gear[k, 0]
    actuators = _names(model, mujoco.mjtObj.mjOBJ_ACTUATOR, model.nu)
    for name, value in mount.ctrl.items():
        ctrl[_number(name, actuators, f"ctrl: {file} has no actuator")] = value
    for k in range(model.nu):
        if int(model.actuator_dyntype[k]) in FILTERS and model.actuator_actnum[k] == 1:
            act[model.actuator_actadr[k]] = ctrl[k]
    return qpos, ctrl, act


def _is_servo(model: mujoco.MjModel, actuator: int, joint: int) -> bool:
    """Return whether the actuator is a position servo of this joint."""
    on_joint = int(model.actuator_trntype[actuator]) == ON_JOINT
    stiffness, bias = float(model.actuator_gainprm[actuator, 0]), float(model.actuator_biasprm[actuator, 1])
    held = stiffness > 0.0 and math.isclose(stiffness, -bias)
    return on_joint and int(model.actuator_trnid[actuator, 0]) == joint and held


def _body_shapes(model: mujoco.MjModel, body: int) -> Iterable[Shape]:
    first = int(model.body_geomadr[body])
    for geom in range(first, first + int(model.body_geomnum[body])):
        if model.geom_group[geom] >= HIDDEN_GROUP or model.geom_rgba[geom, 3] == 0.0:
            continue
        kind = int(model.geom_type[geom])
        place = np.array(model.geom_pos[geom]), matrix_from_quaternion(np.array(model.geom_quat[geom]))
        if kind == MESH:
            yield Shape("mesh", (), *place, _surface(model, int(model.geom_dataid[geom])))
        elif kind in KINDS:
            size: Any = tuple(model.geom_size[geom, : SIZES[KINDS[kind]]].tolist())
            yield Shape(KINDS[kind], size, *place)


def _surface(model: mujoco.MjModel, mesh: int) -> TriangleMesh:
    vertex, face = int(model.mesh_vertadr[mesh]), int(model.mesh_faceadr[mesh])
    vertices = model.mesh_vert[vertex : vertex + int(model.mesh_vertnum[mesh])]
    faces = model.mesh_face[face : face + int(model.mesh_facenum[mesh])]
    return TriangleMesh(np.array(vertices, float), np.array(faces, np.int64))
