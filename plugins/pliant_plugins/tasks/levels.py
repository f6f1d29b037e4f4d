"""Levels of actuation and load at which a chain is settled, one from the other: metrics and failed levels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pliant.formatting import deformation_unit, effort_unit
from pliant.formatting import number as written
from pliant.interfaces.simulation import Simulation
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import ChainModel, Ring
from pliant.records.design import Array
from pliant.records.mount import Carrier
from pliant.records.rollout import Equilibrium, Inputs, OutsideDomain, Rollout, TaskResult

OF_CHAINS = ("tip_x_m", "tip_y_m", "tip_z_m", "tip_displacement_m")
OF_BENDING = ("bend_angle_rad", "max_joint_angle_rad")
OF_EXTENSION = ("extension_m", "extension_strain")
ON_MOUNTS = ("tip_on_mount_x_m", "tip_on_mount_y_m", "tip_on_mount_z_m", "mount_moved_m")
# What `levels_result` measures, of chains that bend and of chains that extend.
MEASURED = (*OF_CHAINS, *OF_BENDING, *OF_EXTENSION, *ON_MOUNTS, "unsettled_levels")


def chain_metrics(chain: ChainModel, final: Equilibrium) -> dict[str, Any]:
    """Return tip position, its distance from the straight chain's tip, and bending or extension of the joints.

    `bend_angle_rad` is the sum of the joints' main-axis angles, `max_joint_angle_rad` the largest turn of one
    joint; prismatic chains have `extension_m` and `extension_strain` instead. On an arm the straight chain is in the
    arm's final pose, and metrics include the tip in the frame of the mount, the distance of the mount from its initial
    position, and `mount_joints`, the final joint coordinates of the arm (rad or m).
    """
    geometry = ChainGeometry.from_chain(chain)
    straight: Array = geometry.markers(np.zeros_like(final.joint_angles))[-1]
    tip, carrier = final.markers_m[-1], final.carrier
    if carrier is not None:
        straight = carrier.in_world(straight)
    metrics: dict[str, Any] = {
        "tip_x_m": float(tip[0]),
        "tip_y_m": float(tip[1]),
        "tip_z_m": float(tip[2]),
        "tip_displacement_m": float(np.linalg.norm(tip - straight)),
    }
    if carrier is not None:
        metrics |= dict(zip(ON_MOUNTS, carrier.on_mount(tip).tolist(), strict=False))
        metrics["mount_moved_m"] = float(np.linalg.norm(carrier.moved_m))
        metrics["mount_joints"] = dict(zip(carrier.names, carrier.coordinates.tolist(), strict=True))
    if geometry.kind == "prismatic":
        extension = float(final.joint_angles.sum())
        return metrics | {"extension_m": extension, "extension_strain": extension / chain.length_m}
    return metrics | {
        "bend_angle_rad": float(final.joint_angles[:, geometry.main].sum()),
        "max_joint_angle_rad": float(np.linalg.norm(final.joint_angles, axis=1).max()),
    }


def ring_positions(chain: ChainModel, joint_angles: Array) -> Array:
    """Return (r, 3) base, end of each segment and tip in the world at joint coordinates (n, a)."""
    ends = (Ring(0, np.zeros(3)), Ring(chain.n_joints, np.asarray(chain.tip_offset_m, float)))
    return _placed(chain, chain.rings or ends, joint_angles)


def backbone(chain: ChainModel, joint_angles: Array) -> Array:
    """Return the (k,) polyline of the centre line in the world; the markers if it runs through the joints."""
    if not chain.centre_line:
        return ChainGeometry.from_chain(chain).markers(joint_angles)
    return _placed(chain, chain.centre_line, joint_angles)


def _placed(chain: ChainModel, points: Sequence[Ring], joint_angles: Array) -> Array:
    pose = ChainGeometry.from_chain(chain).forward(joint_angles)
    return np.array([pose.origins[p.body] + pose.rotations[p.body] @ p.point_m for p in points])


# A joint that is further outside its law's box than this share of the box's width, or turned further than this, is
# no answer: the law is a continuation there, and would carry any load.
FAR_WIDTHS = 0.25
FAR_TURN_RAD = np.pi


@dataclass(frozen=True, eq=False)
class Level:
    """Inputs to settle at; `time_s` is used in the history, `name` in sentences."""

    time_s: float
    inputs: Inputs
    name: str


def settle_levels(simulation: Simulation, levels: Iterable[Level]) -> list[Equilibrium]:
    """Settle each level from the one before."""
    found = []
    for level in levels:
        simulation.apply(level.inputs)
        found.append(simulation.settle())
    return found


def levels_result(
    chain: ChainModel,
    levels: Sequence[Level],
    equilibria: Sequence[Equilibrium],
    asked: Sequence[int] = (-1,),
) -> TaskResult:
    """Return the last level's equilibrium, metrics of the last valid one, and all levels as a history.

    `iterations` and `wall_s` of the result are those of all levels; its `outside_domain` contains the worst entry of
    each joint and variable over all of them. `asked` are the levels that the task requires: if one of them is not a
    valid equilibrium, `not_reached` says which, why, and which level was the last valid one.
    """
    worst: dict[tuple[int, str], OutsideDomain] = {}
    for level, one in zip(levels, equilibria, strict=True):
        for entry in one.outside_domain:
            key = (entry.module, entry.variable)
            if key not in worst or abs(entry.excess) > abs(worst[key].excess):
                worst[key] = replace(entry, time_s=level.time_s)
    final = replace(
        equilibria[-1],
        iterations=sum(one.iterations for one in equilibria),
        wall_s=sum(one.wall_s for one in equilibria),
        outside_domain=tuple(worst[key] for key in sorted(worst)),
    )
    inputs = list(levels[-1].inputs.actuation)
    rollout = Rollout(
        time_s=np.array([level.time_s for level in levels]),
        actuation=np.array([[level.inputs.actuation[name] for name in inputs] for level in levels]),
        joint_angles=np.array([one.joint_angles for one in equilibria]),
        markers_m=np.array([one.markers_m for one in equilibria]),
        carrier=None if chain.mount is None else Carrier.stacked([one.carrier for one in equilibria]),
    )
    unsettled = sum(not one.converged for one in equilibria)
    not_reached, last_held = _not_reached(chain, levels, equilibria, asked)
    metrics = {
        **chain_metrics(chain, final if last_held is None else equilibria[last_held]),
        "unsettled_levels": unsettled,
    }
    return TaskResult(final, metrics, rollout, not_reached=not_reached, last_held=last_held)


def why_not_held(chain: ChainModel, equilibrium: Equilibrium) -> str:
    """Return why this equilibrium is not valid, as the end of a sentence about the chain; empty if it is."""
    if not equilibrium.converged and not equilibrium.at_rest:
        return "could not be followed: its motion ran away, or it did not settle at the first sample"
    if not equilibrium.converged:
        return f"did not settle (residual {effort_unit(chain.laws[0]).text(equilibrium.residual, 2)})"
    if equilibrium.stable is False:
        return "has no stable equilibrium"
    for number, (joint, q) in enumerate(zip(chain.joints, equilibrium.joint_angles, strict=True), start=1):
        law = chain.laws[joint.law]
        box = law.domain.deformation
        several = len(law.actuations)
        acting = chain.actuators[slice(*chain.actuator_range(joint))]
        for actuator in acting if several == 1 else acting[:1]:
            turned = q[None] @ actuator.turn(len(q))
            excess = law.domain.excess(law.unactuated(1), turned)[0, several:]
            far = np.abs(excess) / np.ptp(box, axis=1)
            if far.max() > FAR_WIDTHS:
                k = int(far.argmax())
                unit = deformation_unit(law, law.axes[k])
                low, high = (written(side * unit.factor, 3) for side in box[k])
                return (
                    f"is held by no data: joint {number} stands {100 * far[k]:.0f} % of its law's range outside that "
                    f"range, {unit.attached(f'{low} to {high}')} about {law.axes[k]} (FEM of more actuation, a shorter "
                    "or a lighter chain may stay inside)"
                )
        if law.joint != "prismatic" and np.linalg.norm(q) > FAR_TURN_RAD:
            return f"folds: joint {number} is turned by {np.degrees(np.linalg.norm(q)):.0f}°"
    return ""


def _not_reached(
    chain: ChainModel, levels: Sequence[Level], equilibria: Sequence[Equilibrium], asked: Sequence[int]
) -> tuple[str, int | None]:
    """Return sentence and the index of the last valid level before the first invalid one; empty if all are valid."""
    for index in sorted(k % len(levels) for k in asked):
        reason = why_not_held(chain, equilibria[index])
        if reason:
            held = [k for k in range(index) if not why_not_held(chain, equilibria[k])]
            last = (
                f"the last level that held is {levels[held[-1]].name}" if held else "no level before it held"
            )
            return f"At {levels[index].name} the chain {reason}; {last}.", held[-1] if held else None
    return "", None


def as_list(points: Array) -> list[object]:
    """Return an array as a metric: nested lists of numbers."""
    listed: list[object] = np.asarray(points, float).tolist()
    return listed
