"""The robots' bodies: hinges in a row, with the truth's changes, and the readings of an ideal bench.

A skeleton is described straight, hanging along −z; every hinge's axis, the vector to the next one and the mass of the
piece that it carries are given in that pose. Modules bend about −y, so that positive angles turn the tip toward +x.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.evidence.robots import B_E, Array, Robot

# A sixth of the critical damping of a joint with the largest bars: after a second an eighth of the swing is left.
BARS_DRAG_1_S = 4.0


@dataclass(frozen=True)
class Body:
    """Changes of the bodies by a truth; the defaults change nothing.

    Attributes:
        fitting_kg, fitting_share, fitting_side_m: a point mass on every piece, at a share of its length, off its axis.
        crossbar_kg_m2: a balanced bar on every piece: inertia without weight.
        bar_drag_1_s: damping of the bars over their inertia.
        joint_friction: MuJoCo's own.
        interface: compliance of each connection between modules over that of a joint at rest.
        interface_cubic: its torque's third power, over the linear one at 0.1 rad.
        twist_rad, twist_tilt: the bending axes' turn about the chain, and its share by which they differ along it.
        twist_bow: its share that grows with the square of the position along the chain.
        stretch: strain of the pieces at the largest pressure, along a power of the pressure or soon and then no more.
        stretch_taper: by how much more the last piece stretches than one in the middle, over it.
        tilt_x_rad, tilt_y_rad, tilt_z_rad: rotation vector of the base, in world axes of the bench at rest.
        gravity_x_m_s2, gravity_y_m_s2, gravity_z_m_s2: in world axes.
    """

    fitting_kg: float = 0.0
    fitting_share: float = 0.9
    fitting_side_m: float = 0.0
    crossbar_kg_m2: float = 0.0
    bar_drag_1_s: float = BARS_DRAG_1_S
    joint_friction: float = 0.0
    interface: float = 0.0
    interface_cubic: float = 0.0
    twist_rad: float = 0.0
    twist_tilt: float = 0.0
    twist_bow: float = 0.0
    stretch: float = 0.0
    stretch_power: float = 1.0
    stretch_saturating: float = 0.0
    stretch_taper: float = 0.0
    tilt_x_rad: float = 0.0
    tilt_y_rad: float = 0.0
    tilt_z_rad: float = 0.0
    gravity_x_m_s2: float = 0.0
    gravity_y_m_s2: float = 0.0
    gravity_z_m_s2: float = -9.81

    @property
    def drag(self) -> float:
        """Damping of what swings, N·m·s: it ends what the bars begin before the dense samples do."""
        return self.bar_drag_1_s * self.crossbar_kg_m2

    @property
    def tilt(self) -> Array:
        """(3, 3) turn of the base."""
        return turn(np.array([self.tilt_x_rad, self.tilt_y_rad, self.tilt_z_rad]))


@dataclass(frozen=True, eq=False)
class Skeleton:
    """n hinges and the pieces that hang on them.

    Attributes:
        axes: (n, 3) unit axes.
        offsets_m: (n, 3) to each hinge from the one before (the base); tip_m: (3,) from the last.
        masses_kg: (n,); centres_m: (n, 3) from the hinge; inertias_kg_m2: (n,) about the centre, across the chain.
        module: (n,) index of the module whose joint it is; −1 for a connection between modules.
        spring_n_m: (n, 2) torque per θ and per θ³ of connections.
    """

    axes: Array
    offsets_m: Array
    tip_m: Array
    masses_kg: Array
    centres_m: Array
    inertias_kg_m2: Array
    module: Array
    spring_n_m: Array


def skeleton(robot: Robot, body: Body, payload_kg: float = 0.0) -> Skeleton:
    """Return the robot's hinges with the body's changes, and a point mass at the tip."""
    down = np.array([0.0, 0.0, -1.0])
    rows: list[tuple[Array, Array, float, Array, float, int, float]] = []
    before = robot.length_m / 2 * down
    last = robot.modules - 1
    for i, (length, mass) in enumerate(zip(robot.piece_lengths_m, robot.piece_masses_kg, strict=True)):
        place = 2.0 * i / last - 1.0 if last else 0.0
        angle = body.twist_rad * (1.0 + body.twist_tilt * place + body.twist_bow * (place * place - 0.5))
        axis = np.array([np.sin(angle), -np.cos(angle), 0.0])
        split = body.interface > 0.0 and i < last
        part = length / 2 if split else length
        rows.append((axis, before, *_piece(part, mass * part / length, body, split), i, 0.0))
        before = part * down
        if split:
            stiffness = B_E / body.interface
            rows.append(
                (np.array([0.0, -1.0, 0.0]), before, *_piece(part, mass / 2, body, False), -1, stiffness)
            )
    if payload_kg > 0.0:
        axis, offset, mass, centre, inertia, module_of, spring = rows[-1]
        total = mass + payload_kg
        middle = (mass * centre + payload_kg * before) / total
        inertia += mass * float(np.sum((centre - middle) ** 2)) + payload_kg * float(
            np.sum((before - middle) ** 2)
        )
        rows[-1] = (axis, offset, total, middle, inertia, module_of, spring)
    axes, offsets, masses, centres, inertias, module, springs = zip(*rows, strict=True)
    linear = np.array(springs)
    return Skeleton(
        np.array(axes),
        np.array(offsets),
        before,
        np.array(masses),
        np.array(centres),
        np.array(inertias),
        np.array(module),
        np.column_stack([linear, linear * body.interface_cubic / 0.1**2]),
    )


def _piece(length: float, rod_kg: float, body: Body, bare: bool) -> tuple[float, Array, float]:
    """Return mass, centre and inertia of a uniform rod with its fittings; `bare` without them."""
    fitting = 0.0 if bare else body.fitting_kg
    mass = rod_kg + fitting
    rod, point = (
        np.array([0, 0, -length / 2]),
        np.array([body.fitting_side_m, 0, -body.fitting_share * length]),
    )
    centre = (rod_kg * rod + fitting * point) / mass
    about = rod_kg * (length**2 / 12 + np.sum((rod - centre) ** 2)) + fitting * np.sum((point - centre) ** 2)
    return mass, centre, float(about + (0.0 if bare else body.crossbar_kg_m2))


def turn(vector: Array) -> Array:
    """Return the (3, 3) rotation by a rotation vector (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def base_turn(angles_rad: tuple[float, float, float], body: Body) -> Array:
    """Return (3, 3) attitude of the base: turned about world x, y, z in that order, with the mount's tilt inside."""
    x, y, z = (turn(angle * np.eye(3)[k]) for k, angle in enumerate(angles_rad))
    return z @ y @ x @ body.tilt


def gravity_on(angles_rad: tuple[float, float, float], body: Body) -> Array:
    """Return (3,) gravity in the frame of the base, m/s²."""
    gravity = np.array([body.gravity_x_m_s2, body.gravity_y_m_s2, body.gravity_z_m_s2])
    return base_turn(angles_rad, body).T @ gravity


def stretches(body: Body, count: int, share: Array) -> Array:
    """Return (t, count + 1) stretches of every piece, base first, at shares (t,) of the largest pressure."""
    if body.stretch_saturating > 0.0:
        grown = -np.expm1(-body.stretch_saturating * share) / -np.expm1(-body.stretch_saturating)
    else:
        grown = np.maximum(share, 0.0) ** body.stretch_power
    uneven = 1.0 + body.stretch_taper * np.linspace(-1.0, 1.0, count + 1)
    return 1.0 + body.stretch * np.outer(grown, uneven)


def tips(bones: Skeleton, angles: Array, base: Array, longer: Array | None = None) -> Array:
    """Return (t, 3) the tip in the world, of hinge angles (t, n), with pieces stretched by `longer` (t, n + 1)."""
    if longer is None:
        longer = np.ones((len(angles), len(bones.axes) + 1))
    rotation = np.broadcast_to(base, (len(angles), 3, 3))
    place = np.zeros((len(angles), 3))
    for j, axis in enumerate(bones.axes):
        place = place + longer[:, j, None] * (rotation @ bones.offsets_m[j])
        cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        s, c = np.sin(angles[:, j])[:, None, None], np.cos(angles[:, j])[:, None, None]
        rotation = rotation @ (np.eye(3) + s * cross + (1 - c) * cross @ cross)
    return place + longer[:, -1:] * (rotation @ bones.tip_m)


def joint_angles(bones: Skeleton, angles: Array) -> Array:
    """Return the readings (t, modules) of a sensor on each module: its joint and half of each adjacent connection."""
    columns = []
    for i in range(int(bones.module.max()) + 1):
        (j,) = np.flatnonzero(bones.module == i)
        beside = [k for k in (j - 1, j + 1) if 0 <= k < len(bones.module) and bones.module[k] < 0]
        columns.append(angles[:, j] + 0.5 * angles[:, beside].sum(axis=1))
    return np.column_stack(columns)


def readings(
    robot: Robot,
    angles: Array,
    base_angles_rad: tuple[float, float, float] = (0.0, 0.0, 0.0),
    body: Body | None = None,
    share: Array | None = None,
) -> dict[str, Array]:
    """Return all ideal readings of hinge angles (t, n), (t,) each; `share` (t,) of pressure."""
    body = body or Body()
    bones = skeleton(robot, body)
    longer = None if share is None else stretches(body, len(bones.axes), share)
    tip = tips(bones, angles, base_turn(base_angles_rad, body), longer)
    each = joint_angles(bones, angles)
    return {
        "angle_rad": angles.sum(axis=1),
        **{f"joint_{k + 1}_angle_rad": each[:, k] for k in range(each.shape[1])},
        **{f"tip_{axis}_m": tip[:, k] for k, axis in enumerate("xyz")},
    }
