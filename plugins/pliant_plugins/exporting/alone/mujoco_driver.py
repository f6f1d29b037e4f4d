"""Driver of an exported MJCF: applies the joint laws as passive forces of MuJoCo. Needs numpy and mujoco.

    model, data = load()             # the MJCF in this file's folder, laws installed
    data.ctrl[:] = 12e3              # Pa (N for tendons); actuators are named after their inputs
    settle(model, data)              # equilibrium; or mj_step(model, data) for motion
    print(data.site("tip").xpos)

`python <this file> --check` replays the check file in its folder: poses, efforts and equilibria of the study.
`install(model)` does as `load` for a model of your own that includes the file: joints are found by their names.
The callback is MuJoCo's own (`mjcb_passive`), so viewers and environments see the laws too. A process has one of these,
and MuJoCo cannot compile a model while it is set: compile your models first, or call `pause()` before and `resume()`
after. A law's slope enters as a damping h K that the integrators `implicitfast` and `implicit` take to the end of the
step, which keeps large steps stable and does not change equilibria.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

# Filled in by the export: the file, a function for each law, its number of actuations, its domain; the arms.
LAWS: list[Any] = []
TAKES: list[int] = []
ARMS: list[dict[str, Any]] = []
DOMAINS: list[np.ndarray] = []
MJCF = "robot.xml"
START: dict[str, dict[str, float]] = {"joints": {}, "ctrl": {}}

# --- the driver: everything below is the same in every export ---
_installed: dict[int, tuple[mujoco.MjModel, list[_Arm]]] = {}
_settling: set[int] = set()
SMALL_ANGLE = 0.1
SETTLE_STEP_S = 0.02


def load(path: str | Path | None = None) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Load the MJCF file (by default the one in this module's folder) and install its laws; return model and data."""
    pause()
    model = mujoco.MjModel.from_xml_path(str(path or Path(__file__).with_name(MJCF)))
    install(model)
    return model, mujoco.MjData(model)


def mount(
    onto: str | Path, at: str, prefix: str = "soft_", path: str | Path | None = None
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Mount this robot on a named site or body of another MJCF; return the model with its laws and its data.

    The world of this file becomes the frame of the site or body, so that the study's `chain.base` is the robot's pose
    in it. All its names get the prefix. The integrator becomes `implicitfast`, which the laws need. The other file
    begins at its first keyframe, and its joints and actuators where the study put them (`START`).
    """
    pause()
    whole = mujoco.MjSpec.from_file(str(onto))
    robot = mujoco.MjSpec.from_file(str(path or Path(__file__).with_name(MJCF)))
    robot.option.integrator, robot.option.timestep = whole.option.integrator, whole.option.timestep
    robot.option.gravity = whole.option.gravity  # all options are those of the whole
    site, body = whole.site(at), whole.body(at)
    if site is not None:
        whole.attach(robot, prefix=prefix, site=site)
    elif body is not None:
        whole.attach(robot, prefix=prefix, frame=body.add_frame())
    else:
        named = [one.name for one in (*whole.sites, *whole.bodies) if one.name]
        raise ValueError(
            f"{onto} has no site or body '{at}'; it has {', '.join(named) or 'none with a name'}."
        )
    model = whole.compile()
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    install(model, prefix)
    return model, _at_start(model)


def _at_start(model: mujoco.MjModel) -> mujoco.MjData:
    """Return the data of a model at its first keyframe, named joints and actuators as the study has them."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    joints = {model.joint(k).name: int(model.jnt_qposadr[k]) for k in range(model.njnt)}
    for name, value in START["joints"].items():
        if name in joints:
            data.qpos[joints[name]] = value
    for k in range(model.nu):
        data.ctrl[k] = START["ctrl"].get(model.actuator(k).name, data.ctrl[k])
    mujoco.mj_forward(model, data)
    return data


def install(model: mujoco.MjModel, prefix: str = "") -> None:
    """Install the laws in this model; `prefix` is that of all names if the file was attached."""
    _installed[id(model)] = (model, [_Arm(model, arm, prefix) for arm in ARMS])
    resume()


def pause() -> None:
    """Take the callback away: models can be compiled, and no law acts."""
    mujoco.set_mjcb_passive(None)


def resume() -> None:
    """Set the callback again: laws act in all models that they were installed in."""
    mujoco.set_mjcb_passive(_passive)


def settle(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    tolerance: float = 1e-9,
    most_steps: int = 20_000,
    step_s: float = SETTLE_STEP_S,
) -> bool:
    """Move to the static equilibrium under the present `data.ctrl` and loads; return whether it was reached.

    Kinetic damping: the chain swings freely and is halted whenever it begins to slow down. Slides combined with balls
    are stiff: they keep their implicit damping, step times stiffness, and approach their equilibrium slowly.
    `tolerance` is the largest unbalanced effort, N·m (N on slides). Stiff servos of an arm that the robot is mounted on
    need their own short `step_s`.
    """
    usual_s, model.opt.timestep = model.opt.timestep, step_s
    before = 0.0
    _settling.add(id(model))
    try:
        for _ in range(most_steps):
            mujoco.mj_step(model, data)
            energy = float(data.qvel @ data.qvel)
            if energy <= before:
                data.qvel[:] = 0.0
                mujoco.mj_forward(model, data)
                energy = 0.0
                if np.abs(data.qfrc_smooth + data.qfrc_constraint).max() < tolerance:
                    return True
            before = energy
    finally:
        _settling.discard(id(model))
        model.opt.timestep = usual_s
        mujoco.mj_forward(model, data)
    return False


def outside(model: mujoco.MjModel, data: mujoco.MjData) -> list[str]:
    """Return the names of joints whose law has no data at their position."""
    found: list[str] = []
    for arm in _installed[id(model)][1]:
        found += arm.outside(data)
    return found


def check(path: str | Path | None = None) -> list[str]:
    """Return sentences on deviations of this robot from the study's predictions, by the check file in this folder."""
    file = Path(path) if path else Path(__file__).with_name(f"{MJCF}.check.json")
    said = json.loads(file.read_text(encoding="utf-8"))
    model, data = load()
    found = [] if said["states"] else [f"{file.name} has no states of a robot"]
    for state in said["states"]:
        name, near = state["name"], said["tolerance"]
        off = _posed(model, data, state)
        found += [f"{name}: {what} {off[what]:.3g}" for what in off if not off[what] <= near[f"same_{what}"]]
        if state["equilibrium"]:
            away = _away(model, data, state)
            found += [] if away <= near["tip_m"] else [f"{name}: the tip settles {1e3 * away:.3g} mm away"]
    return found


def _posed(model: mujoco.MjModel, data: mujoco.MjData, state: dict[str, Any]) -> dict[str, float]:
    """Return the deviations of tip, attitude and efforts from those of a state, at its coordinates."""
    mujoco.mj_resetData(model, data)
    arm = _commanded(model, data, state)
    arm.place(data, np.array(state["coordinates"]))
    mujoco.mj_forward(model, data)
    tip, efforts = data.site(state["prefix"] + "tip"), np.array(state["efforts"])
    turned = tip.xmat.reshape(3, 3) @ np.array(state["tip_rotation"]).T
    return {
        "tip_m": float(np.linalg.norm(tip.xpos - state["tip_m"])),
        "rotation": float(np.abs(turned - np.eye(3)).max()),
        "efforts_of_largest": float(
            np.abs(arm.efforts(data)[1] - efforts).max() / (np.abs(efforts).max() or 1.0)
        ),
    }


def _away(model: mujoco.MjModel, data: mujoco.MjData, state: dict[str, Any]) -> float:
    """Return the distance of the settled tip from the state's, in m; infinite if it does not settle."""
    mujoco.mj_resetData(model, data)
    _commanded(model, data, state)
    data.xfrc_applied[model.body(state["prefix"] + "tip").id, :3] = state["tip_force_n"]
    if not settle(model, data):
        return float("inf")
    return float(np.linalg.norm(data.site(state["prefix"] + "tip").xpos - state["tip_m"]))


def _commanded(model: mujoco.MjModel, data: mujoco.MjData, state: dict[str, Any]) -> _Arm:
    """Set the inputs of a state and return its arm."""
    for name, value in state["inputs"].items():
        data.ctrl[model.actuator(state["prefix"] + name).id] = value
    arms = _installed[id(model)][1]
    return next(arm for arm in arms if arm.names[0] == state["prefix"] + "joint_1")


def _passive(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    known = _installed.get(id(model))
    for arm in known[1] if known else ():
        arm.push(model, data)


class _Arm:
    """One chain of joints with its laws."""

    def __init__(self, model: mujoco.MjModel, arm: dict[str, Any], prefix: str) -> None:
        self.names = [prefix + name for name in arm["joints"]]
        joints = [model.joint(name).id for name in self.names]
        self.ball, self.axes = arm["ball"], np.array(arm["axes"])
        n = len(joints)
        width, dofs = (4, 3) if self.ball else (1, 1)
        if arm["slides"]:  # the slide of a body comes behind its ball
            width, dofs = width + 1, dofs + 1
            model.jnt_stiffness[[model.joint(f"{name}_extension").id for name in self.names]] = 0.0
        self.qpos = model.jnt_qposadr[joints][:, None] + np.arange(width)
        self.dofs = model.jnt_dofadr[joints][:, None] + np.arange(dofs)
        self.inputs = np.array([model.actuator(prefix + name).id for name in arm["inputs"]])
        self.turns = np.array(arm["turns"], float)
        self.groups = [(g["law"], np.array(g["joints"]), slice(*g["drives"])) for g in arm["groups"]]
        self.damping = model.dof_damping[self.dofs].copy()
        self.shape, self.reach = (n, len(self.axes)), np.array(arm["reach"])
        model.jnt_stiffness[joints] = 0.0  # the file's stiffness at rest: the laws have it

    def coordinates(self, data: mujoco.MjData) -> np.ndarray:
        """Return (n, a) joint coordinates: angles, rotation vectors, with extensions or extensions alone."""
        if not self.ball:
            return data.qpos[self.qpos]
        found = data.qpos[self.qpos]
        return np.hstack([_rotation_vectors(found[:, :4]), found[:, 4:]])[:, self.axes]

    def acting(self, u: np.ndarray, values: np.ndarray) -> Any:
        """Yield joints, law, actuation, deformation and turn of each group of joints and each law on it."""
        for law, joints, drives in self.groups:
            if TAKES[law] > 1:
                yield joints, law, np.tile(values[drives], (len(joints), 1)), u[joints], np.eye(self.shape[1])
                continue
            for value, turn in zip(values[drives], self.turns[drives], strict=True):
                yield joints, law, np.full(len(joints), value), u[joints] @ turn, turn

    def place(self, data: mujoco.MjData, u: np.ndarray) -> None:
        """Put the joints at coordinates (n, a)."""
        if not self.ball:
            data.qpos[self.qpos] = u
            return
        whole = self._vectors(u)
        length = np.linalg.norm(whole[:, :3], axis=1, keepdims=True)
        part = np.divide(np.sin(0.5 * length), length, out=np.full_like(length, 0.5), where=length > 0.0)
        data.qpos[self.qpos] = np.hstack([np.cos(0.5 * length), part * whole[:, :3], whole[:, 3:]])

    def efforts(self, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return coordinates (n, a), the laws' efforts (n, a) and their slopes (n, a, a)."""
        u = self.coordinates(data)
        tau, slopes = np.zeros(self.shape), np.zeros((*self.shape, self.shape[1]))
        for joints, law, p, turned, turn in self.acting(u, data.ctrl[self.inputs]):
            effort, _, slope = LAWS[law](p, turned)
            tau[joints] += effort @ turn.T
            slopes[joints] += turn @ slope @ turn.T
        return u, tau, slopes

    def push(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Add the efforts of the laws to the passive forces, and their slopes to the damping."""
        u, tau, slopes = self.efforts(data)
        slopes = np.abs(slopes + slopes.transpose(0, 2, 1)) * self.reach
        implicit = model.opt.timestep * slopes.sum(axis=2) / self.reach / 2
        if self.ball:
            inverse = _right_jacobian_inverse(self._vectors(u)[:, :3])
            tau = self._vectors(tau)
            tau[:, :3] = np.einsum("nji,nj->ni", inverse, tau[:, :3])
            implicit = self._vectors(implicit)
        # MuJoCo has taken the damping of the last call, the implicit part in it, off the forces already.
        held = (model.dof_damping[self.dofs] - self.damping) * data.qvel[self.dofs]
        if self.ball and id(model) in _settling:
            held[:, 3:] = 0.0
        data.qfrc_passive[self.dofs] += tau + held
        model.dof_damping[self.dofs] = self.damping + implicit

    def outside(self, data: mujoco.MjData) -> list[str]:
        """Return the names of joints whose law has no data at their position."""
        found: set[int] = set()
        for joints, law, p, u, _ in self.acting(self.coordinates(data), data.ctrl[self.inputs]):
            at, domain = np.column_stack([p, u]), DOMAINS[law]
            found |= set(joints[np.any((at < domain[:, 0]) | (at > domain[:, 1]), axis=1)].tolist())
        return [self.names[k] for k in sorted(found)]

    def _vectors(self, values: np.ndarray) -> np.ndarray:
        out = np.zeros(self.dofs.shape)
        out[:, self.axes] = values
        return out


def _rotation_vectors(q: np.ndarray) -> np.ndarray:
    """Return (n, 3) rotation vectors of unit quaternions (n, 4) of either sign."""
    q = np.where(q[:, :1] < 0.0, -q, q)
    length = np.linalg.norm(q[:, 1:], axis=1, keepdims=True)
    ratio = np.divide(2.0 * np.arctan2(length, q[:, :1]), length, out=2.0 / q[:, :1], where=length > 1e-9)
    return ratio * q[:, 1:]


def _right_jacobian_inverse(phi: np.ndarray) -> np.ndarray:
    """Return (n, 3, 3) rates of the rotation vector per angular velocity in the child's frame (MuJoCo's qvel)."""
    square = np.einsum("ni,ni->n", phi, phi)
    theta = np.sqrt(square)
    small = theta < SMALL_ANGLE
    t = np.where(small, 1.0, theta)
    closed = (1.0 - 0.5 * t / np.tan(0.5 * t)) / t**2
    d = np.where(small, 1 / 12 + square / 720 + square**2 / 30240 + square**3 / 1209600, closed)
    x, y, z = phi.T
    skew = np.zeros((len(phi), 3, 3))
    skew[:, 0, 1], skew[:, 0, 2], skew[:, 1, 2] = -z, y, -x
    skew[:, 1, 0], skew[:, 2, 0], skew[:, 2, 1] = z, -y, x
    outer = phi[:, :, None] * phi[:, None, :] - square[:, None, None] * np.eye(3)
    return np.eye(3) + 0.5 * skew + d[:, None, None] * outer


if __name__ == "__main__":
    if "--check" not in sys.argv:
        sys.exit(f"{__doc__}")
    differences = check()
    print("\n".join(differences) or "It does what the study predicts.")
    sys.exit(1 if differences else 0)
