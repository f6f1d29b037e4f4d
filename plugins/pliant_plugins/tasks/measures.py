"""What can be measured on any settled chain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import ChainModel, Ring
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium

OF_CHAINS = ("tip_x_m", "tip_y_m", "tip_z_m", "tip_displacement_m")
OF_BENDING = ("bend_angle_rad", "max_joint_angle_rad")
OF_EXTENSION = ("extension_m", "extension_strain")


def chain_metrics(chain: ChainModel, final: Equilibrium) -> dict[str, Any]:
    """Tip position, its distance from the straight chain's tip, and bending or extension of the joints.

    `bend_angle_rad` is the sum of the joints' main-axis angles, `max_joint_angle_rad` the largest turn of one
    joint; prismatic chains have `extension_m` and `extension_strain` instead.
    """
    geometry = ChainGeometry.of(chain)
    straight: Array = geometry.markers(np.zeros_like(final.joint_angles))[-1]
    tip = final.tip_m
    metrics: dict[str, Any] = {
        "tip_x_m": float(tip[0]),
        "tip_y_m": float(tip[1]),
        "tip_z_m": float(tip[2]),
        "tip_displacement_m": float(np.linalg.norm(tip - straight)),
    }
    if geometry.kind == "prismatic":
        extension = float(final.joint_angles.sum())
        return metrics | {"extension_m": extension, "extension_strain": extension / chain.length_m}
    return metrics | {
        "bend_angle_rad": float(final.joint_angles[:, geometry.main].sum()),
        "max_joint_angle_rad": float(np.linalg.norm(final.joint_angles, axis=1).max()),
    }


def ring_positions(chain: ChainModel, joint_angles: Array) -> Array:
    """(r, 3) base, end of each segment and tip in the world at joint coordinates (n, a)."""
    ends = (Ring(0, np.zeros(3)), Ring(chain.n_joints, np.asarray(chain.tip_offset_m, float)))
    return _placed(chain, chain.rings or ends, joint_angles)


def backbone(chain: ChainModel, joint_angles: Array) -> Array:
    """(k, 3) the centre line in the world as a polyline; the markers where it runs through the joints."""
    if not chain.centre_line:
        return ChainGeometry.of(chain).markers(joint_angles)
    return _placed(chain, chain.centre_line, joint_angles)


def _placed(chain: ChainModel, points: Sequence[Ring], joint_angles: Array) -> Array:
    pose = ChainGeometry.of(chain).forward(joint_angles)
    return np.array([pose.origins[p.body] + pose.rotations[p.body] @ p.point_m for p in points])
