"""The systems: files of packages that others wrote, with sensors where they have none, and without their meshes.

What the diagnoser gets is such a file. Packages that are not installed leave their systems out.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

HERE = Path(__file__).parent
SENSOR = mujoco.mjtSensor


@dataclass(frozen=True)
class Robot:
    """A system of the bed.

    Attributes:
        package: that has the file; "" for the bed's own.
        read: returns its specification from the folder of the package.
        inputs: column → actuator, centre and amplitude of its commands, in ctrl.
        joints: column → joint that is read; `sites`: stem of columns → site, and the axes along which it moves.
        start: joint → position at the start of every run; empty: at rest under the first inputs.
        settle_s: time that the truth takes to come to rest.
        lowest_hz: frequency of slow cycles.
        without: kinds that do not show here, whatever their strength.
        alike: an effect may be at all joints, by one number; not where hinges and slides are mixed.
        integrator: of the truth, another than the file's.
        weight: of its number of sets; less where a diagnosis takes long.
    """

    name: str
    package: str
    read: Callable[[Path], Any]
    inputs: Mapping[str, tuple[str, float, float]]
    joints: Mapping[str, str]
    sites: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)
    settle_s: float = 0.0
    lowest_hz: float = 0.25
    duration_s: float = 6.0
    sampled_hz: float = 50.0
    without: tuple[str, ...] = ()
    alike: bool = True
    integrator: str = "implicit"
    weight: float = 1.0

    @property
    def columns(self) -> dict[str, str]:
        """Return column → sensor, with the component behind a point."""
        vectors = {f"{stem}_{c}_m": f"{stem}.{c}" for stem, (_, axes) in self.sites.items() for c in axes}
        return {**{column: column for column in self.joints}, **vectors}

    @property
    def is_there(self) -> bool:
        """Return whether its package is installed."""
        return not self.package or importlib.util.find_spec(self.package) is not None


@cache
def mjcf(name: str) -> str:
    """Return the file that the diagnoser gets: bodies as numbers, no geoms, a sensor for every output."""
    robot, folder = ROBOTS[name], HERE
    if robot.package:
        found = importlib.util.find_spec(robot.package)
        assert found is not None and found.origin is not None
        folder = Path(found.origin).parent
    spec = robot.read(folder)
    strip(spec)
    for column, joint in robot.joints.items():
        spec.add_sensor(
            name=column, type=SENSOR.mjSENS_JOINTPOS, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=joint
        )
    for column, (site, _) in robot.sites.items():
        spec.add_sensor(
            name=column, type=SENSOR.mjSENS_FRAMEPOS, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site
        )
    spec.compile()
    return str(spec.to_xml())


def strip(spec: Any) -> None:
    """Write masses and inertias as numbers; take out geoms, meshes, contacts, sensors and what is only seen."""
    model = spec.compile()
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    for body in spec.bodies[1:]:
        body.explicitinertial, body.mass = True, float(model.body_mass[body.id])
        body.ipos, body.iquat = model.body_ipos[body.id].copy(), model.body_iquat[body.id].copy()
        body.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        body.inertia, body.fullinertia = model.body_inertia[body.id].copy(), np.full(6, np.nan)
    listed = (spec.sensors, spec.pairs, spec.excludes, spec.geoms, spec.cameras, spec.lights, spec.meshes)
    for some in (*listed, spec.materials, spec.textures, spec.keys):
        for one in list(some):
            spec.delete(one)


def delete_bodies(spec: Any, *names: str) -> None:
    """Take bodies out, with tendons and actuators that need their joints."""
    gone = {joint.name for name in names for joint in spec.body(name).find_all("joint")}
    model = spec.compile()
    for tendon in list(spec.tendons):
        k = model.tendon(tendon.name).id
        start, count = int(model.tendon_adr[k]), int(model.tendon_num[k])
        if {model.joint(int(j)).name for j in model.wrap_objid[start : start + count]} & gone:
            spec.delete(tendon)
    for some in (spec.actuators, spec.sensors):
        for one in list(some):
            if getattr(one, "target", getattr(one, "objname", "")) in gone:
                spec.delete(one)
    for name in names:
        spec.delete(spec.body(name))


def _gym(name: str, *without: str, site: tuple[str, Any] | None = None) -> Callable[[Path], Any]:
    """Return the reader of a file of gymnasium, without some bodies, with a site `tip` on a body."""

    def read(folder: Path) -> Any:
        spec = mujoco.MjSpec.from_file(str(folder / "envs" / "mujoco" / "assets" / name))
        if without:
            delete_bodies(spec, *without)
        for k, actuator in enumerate(spec.actuators):
            actuator.name = f"motor{k + 1}"
        if site:
            spec.body(site[0]).add_site(name="tip", pos=site[1])
        return spec

    return read


FRANKA = """<mujoco model="franka"><compiler inertiafromgeom="auto" inertiagrouprange="3 5" angle="radian"/>
<include file="franka_assets/assets.xml"/><include file="franka_assets/actuator.xml"/>
<worldbody><include file="franka_assets/chain.xml"/></worldbody></mujoco>"""


def _franka(folder: Path) -> Any:
    """Return the arm of the kitchen of gymnasium-robotics, without the gripper's fingers."""
    kitchen = folder / "envs" / "assets" / "kitchen_franka"
    files = {str(p.relative_to(kitchen)): p.read_bytes() for p in (kitchen / "franka_assets").glob("*.xml")}
    meshes = kitchen / "franka_assets" / "meshes"
    stls = {f"franka_assets/meshes/{p.relative_to(meshes)}": p.read_bytes() for p in meshes.rglob("*.stl")}
    spec = mujoco.MjSpec.from_string(FRANKA, include=files, assets=stls)
    delete_bodies(spec, "panda0_leftfinger", "panda0_rightfinger")
    return spec


def _shadow(folder: Path) -> Any:
    """Return the Shadow hand of gymnasium-robotics with its first finger only: four joints, seven tendons."""
    spec = mujoco.MjSpec.from_file(str(folder / "envs" / "assets" / "hand" / "reach.xml"))
    fingers = ("mfknuckle", "rfknuckle", "lfmetacarpal", "thbase")
    for some in (spec.pairs, spec.excludes, spec.sensors):
        for one in list(some):
            spec.delete(one)
    delete_bodies(spec, *(f"robot0:{one}" for one in fingers), "floor0")
    return spec


def _own(folder: Path) -> Any:
    return mujoco.MjSpec.from_file(str(folder / "soft_finger.xml"))


PUSHER = (
    *("shoulder_pan", "shoulder_lift", "upper_arm_roll", "elbow_flex"),
    *("forearm_roll", "wrist_flex", "wrist_roll"),
)
PUSHER_N_M = (0.6, 0.4, 0.06, 0.1, 0.05, 0.04, 0.05)
PANDA_RAD = ((0.0, 0.5), (0.3, 0.4), (0.0, 0.5), (-1.8, 0.5), (0.0, 0.5), (0.3, 0.5), (0.0, 0.5))
FLAT = ("gravity_scale", "gravity_direction", "base_misalignment")
LIGHT = ("body_mass", "centre_of_mass", "body_inertia", "payload", "varying_payload")
ROBOTS: Mapping[str, Robot] = {
    one.name: one
    for one in (
        Robot(
            "reacher",
            "gymnasium",
            _gym("reacher.xml", "target", site=("fingertip", [0, 0, 0])),
            {f"drive{k}": (f"motor{k}", 0.0, a) for k, a in ((1, 0.012), (2, 0.012))},
            {"angle1_rad": "joint0", "angle2_rad": "joint1"},
            {"tip": ("tip", "xy")},
            without=(*FLAT, *LIGHT),
        ),
        Robot(
            "pusher",
            "gymnasium",
            _gym("pusher_v5.xml", "object", "goal", site=("tips_arm", [0.1, 0, 0])),
            {f"{n}_n_m": (f"motor{k + 1}", 0.0, PUSHER_N_M[k]) for k, n in enumerate(PUSHER)},
            {f"{n}_rad": f"r_{n}_joint" for n in PUSHER},
            {"tip": ("tip", "xyz")},
            {"r_elbow_flex_joint": -1.1, "r_wrist_flex_joint": -0.5},
            without=FLAT,
        ),
        Robot(
            "swimmer",
            "gymnasium",
            _gym("swimmer.xml", site=("torso", [1.5, 0, 0])),
            {f"drive{k}": (f"motor{k}", 0.0, 0.13) for k in (1, 2)},
            {"front_rad": "motor1_rot", "back_rad": "motor2_rot", "heading_rad": "free_body_rot"},
            {"nose": ("tip", "xy")},
            without=FLAT,
            alike=False,
        ),
        Robot(
            "soft_finger",
            "",
            _own,
            {"pull_m": ("pull", 0.129, 0.008)},
            {f"bend{k}_rad": f"bend{k}" for k in (1, 3, 6)},
            {"tip": ("tip", "xz")},
            without=(
                "dead_zone",
                "saturation",
                "centre_of_mass",
                "body_inertia",
                "joint_coupling",
                "varying_payload",
            ),
            settle_s=1.5,
        ),
        Robot(
            "franka",
            "gymnasium_robotics",
            _franka,
            {f"drive{k + 1}_rad": (f"panda0_joint{k + 1}", *PANDA_RAD[k]) for k in range(7)},
            {f"angle{k}_rad": f"robot:panda0_joint{k}" for k in range(1, 8)},
            {"hand": ("end_effector", "xyz")},
            {f"robot:panda0_joint{k + 1}": PANDA_RAD[k][0] for k in range(7)},
            settle_s=0.8,
            lowest_hz=0.35,
            duration_s=4.0,
            weight=0.3,
        ),
        Robot(
            "shadow_finger",
            "gymnasium_robotics",
            _shadow,
            {
                f"{n}_rad": (f"robot0:A_{n}", c, a)
                for n, c, a in (
                    ("WRJ1", -0.15, 0.2),
                    ("WRJ0", -0.1, 0.3),
                    ("FFJ3", 0, 0.2),
                    ("FFJ2", 0.7, 0.5),
                    ("FFJ1", 0.7, 0.5),
                )
            },
            {f"{n}_angle_rad": f"robot0:{n}" for n in ("WRJ1", "WRJ0", "FFJ3", "FFJ2", "FFJ1", "FFJ0")},
            {"fingertip": ("robot0:S_fftip", "xyz")},
            settle_s=1.0,
            lowest_hz=0.35,
            duration_s=4.0,
            weight=0.12,
        ),
    )
}


def present(names: tuple[str, ...] = ()) -> list[Robot]:
    """Return the wanted systems, all by default, whose package is installed; say which are left out."""
    found = []
    for name in names or tuple(ROBOTS):
        robot = ROBOTS[name]
        if robot.is_there:
            found.append(robot)
        else:
            print(f"{name} left out: the package {robot.package} is not installed", flush=True)
    return found
