# ruff: noqa: UP018 - Warp takes float(0.0) for a variable, 0.0 for a constant
"""On the device: joint laws as tables of bicubic cells, and the control of a relaxation, chain by chain.

A slope k of −τ enters as the damping dt · k of the step, which MuJoCo takes implicitly, so that the stiffness is
implicit and the force stays exactly τ (`pliant_plugins.physics.mujoco.joints`). Where the kinetic energy of a chain
has peaked it is halted (kinetic damping: Cundall 1976; `pliant.mechanics.relaxation`).
"""

from __future__ import annotations

import warp as wp

# A step that turns a joint further is undone, and repeated with more caution.
LONGEST_TURN = wp.constant(0.4)
REGAIN = wp.constant(0.8)


@wp.func
def power_sum(c0: float, c1: float, c2: float, c3: float, y: float) -> float:
    """Return c0 + c1 y + c2 y² + c3 y³."""
    return c0 + y * (c1 + y * (c2 + y * c3))


@wp.kernel
def drive(
    qpos: wp.array2d(dtype=float),  # type: ignore[valid-type]
    cells: wp.array3d(dtype=wp.mat44),  # type: ignore[valid-type]
    grids: wp.array(dtype=wp.vec4),  # type: ignore[valid-type]
    law: wp.array2d(dtype=int),  # type: ignore[valid-type]
    pressure: wp.array(dtype=float),  # type: ignore[valid-type]
    sign: wp.array(dtype=float),  # type: ignore[valid-type]
    moment: wp.array(dtype=float),  # type: ignore[valid-type]
    extra: wp.array2d(dtype=float),  # type: ignore[valid-type]
    caution: wp.array(dtype=float),  # type: ignore[valid-type]
    dt: float,
    force: wp.array2d(dtype=float),  # type: ignore[valid-type]
    damping: wp.array2d(dtype=float),  # type: ignore[valid-type]
    before: wp.array2d(dtype=float),  # type: ignore[valid-type]
) -> None:
    """Compute force τ − M and damping of each joint at the present state.

    Args:
        cells, grids: of each law, coefficients of xᵃ yᵇ by cell (laws · rows, columns) and first p, step, first u,
            step; `LawTable`.
        law: (worlds, n) number of each joint's law.
        pressure, sign, moment: of each world.
        extra: (worlds, n) bound of the loads' stiffness.
    """
    world, i = wp.tid()  # type: ignore[misc]
    number = law[world, i]
    grid = grids[number]
    rows = cells.shape[1]
    s = sign[world]
    u = qpos[world, i]
    x = (pressure[world] - grid[0]) / grid[1]
    y = (s * u - grid[2]) / grid[3]
    row = wp.clamp(int(wp.floor(x)), 0, rows - 1)
    column = wp.clamp(int(wp.floor(y)), 0, cells.shape[2] - 1)
    x = x - float(row)
    y = y - float(column)
    c = cells[number, row, column]
    tau = float(0.0)
    slope = float(0.0)
    weight = float(1.0)
    for a in range(4):
        tau = tau + weight * power_sum(c[a, 0], c[a, 1], c[a, 2], c[a, 3], y)
        slope = slope + weight * power_sum(c[a, 1], 2.0 * c[a, 2], 3.0 * c[a, 3], 0.0, y)
        weight = weight * x
    slope = slope / grid[3]
    force[world, i] = s * tau - moment[world]
    damping[world, i] = dt * caution[world] * (wp.abs(slope) + extra[world, i])
    before[world, i] = u


@wp.kernel
def judge(
    qpos: wp.array2d(dtype=float),  # type: ignore[valid-type]
    qvel: wp.array2d(dtype=float),  # type: ignore[valid-type]
    before: wp.array2d(dtype=float),  # type: ignore[valid-type]
    energy: wp.array(dtype=float),  # type: ignore[valid-type]
    caution: wp.array(dtype=float),  # type: ignore[valid-type]
    moved: wp.array(dtype=float),  # type: ignore[valid-type]
) -> None:
    """Undo too long a step of each chain, halt it at a peak of kinetic energy, and store the longest move."""
    world = wp.tid()
    n = qpos.shape[1]
    longest = float(0.0)
    now = float(0.0)
    for i in range(n):
        longest = wp.max(longest, wp.abs(qpos[world, i] - before[world, i]))
        now = now + qvel[world, i] * qvel[world, i]
    if not (longest <= LONGEST_TURN):
        for i in range(n):
            qpos[world, i] = before[world, i]
            qvel[world, i] = 0.0
        energy[world] = 0.0
        caution[world] = 2.0 * caution[world]
        moved[world] = LONGEST_TURN
        return
    caution[world] = wp.max(1.0, REGAIN * caution[world])
    moved[world] = wp.max(moved[world], longest)
    if now < energy[world]:
        for i in range(n):
            qvel[world, i] = 0.0
        now = 0.0
    energy[world] = now
