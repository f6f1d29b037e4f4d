"""Metrics of an episode: turn, drift, tilt, hold, forces, slip and work (docs/hold_and_turn.md)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from pliant.mechanics.efforts import JointEfforts
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.rotations import quaternion_from_matrix
from pliant.records.design import Array
from pliant.records.scene import Arm, Contact, SceneState
from pliant_plugins.tasks.hold_and_turn.config import HoldAndTurnConfig
from pliant_plugins.tasks.hold_and_turn.episode import Episode


def unit_axis(config: HoldAndTurnConfig) -> Array:
    """Return the unit vector (3,) about which the turn is measured."""
    return np.array(config.axis, float) / np.linalg.norm(config.axis)


def turns_rad(rotations: Array, axis: Array) -> Array:
    """Return (t,) turn about a unit axis since the first of the rotations (t, 3, 3), continuous over full turns.

    It is the twist about the axis of the whole rotation, which is the product of that twist and a tilt of the axis.
    """
    q = quaternion_from_matrix(rotations @ rotations[0].T)
    return np.unwrap(2.0 * np.arctan2(q[:, 1:] @ axis, q[:, 0]))


def tilt_rad(rotation: Array, axis: Array) -> float:
    """Return the angle by which a rotation moves the axis."""
    moved = rotation @ axis
    return float(np.arctan2(np.linalg.norm(np.cross(axis, moved)), axis @ moved))


def centre_m(state: SceneState, com_m: Array) -> Array:
    """Return (3,) the centre of mass of the object from the carriage."""
    return np.asarray(state.positions_m[0] + state.rotations[0] @ com_m - state.carriage_m)


def fingers_on_object(contacts: Sequence[Contact]) -> dict[int, float]:
    """Return the sum of the normal forces (N) on the object of each finger that presses on it."""
    forces: dict[int, float] = {}
    for c in contacts:
        if (c.first.kind, c.second.kind) == ("arm", "object") and c.normal_n > 0.0:
            forces[c.first.number] = forces.get(c.first.number, 0.0) + c.normal_n
    return forces


def is_held(contacts: Sequence[Contact], config: HoldAndTurnConfig) -> bool:
    """Return whether two fingers press on the object and, if it is carried, it does not stand."""
    stands = any({"object", "floor"} == {c.first.kind, c.second.kind} and c.normal_n > 0.0 for c in contacts)
    pressing = len(fingers_on_object(contacts)) >= min(2, config.fingers)
    return pressing and not (stands and config.support == "carried")


def metrics(episode: Episode, config: HoldAndTurnConfig) -> dict[str, float]:
    """Return the numbers of an episode; forces, slip and work are those of the turning."""
    record, begin, last = episode.record, episode.ends[0], episode.last
    axis = unit_axis(config)
    states, seen = record.states[begin:], record.contacts[begin : last + 1]
    turns = turns_rad(np.array([state.rotations[0] for state in states]), axis)
    com = np.asarray(record.scene.objects[0].mass.com_m)
    drifts = [float(np.linalg.norm(centre_m(s, com) - centre_m(states[0], com))) for s in states]
    held = [is_held(contacts, config) for contacts in record.contacts[begin:]]
    arms = range(len(record.scene.arms))
    numbers = {
        "turn_rad": float(turns[-1]),
        "drift_m": drifts[-1],
        "largest_drift_m": max(drifts),
        "tilt_rad": tilt_rad(states[-1].rotations[0] @ states[0].rotations[0].T, axis),
        "held": bool(held[-1]),
        "held_share": float(np.mean(held)),
        "peak_force_n": max(max(fingers_on_object(one).values(), default=0.0) for one in seen),
        "slip_m": max(_slip_m(episode, arm) for arm in arms),
        "work_j": sum(_work_j(episode, arm) for arm in arms),
    }
    each = cycle_turns_rad(episode, turns)
    if len(each) > 1:
        numbers["repeatability_rad"] = float(np.std(each, ddof=1))
    return numbers


def cycle_turns_rad(episode: Episode, turns: Array) -> list[float]:
    """Return the turn of each cycle, from the turns (t,) of the frames since the turning began."""
    return [float(turns[b - episode.ends[0]] - turns[a - episode.ends[0]]) for a, b in pairwise(episode.ends)]


def _slip_m(episode: Episode, number: int) -> float:
    """Return the length of the path on which a finger slides over the object while both touch.

    Between two frames it is the motion of the finger's material point at a contact relative to the object's, along the
    surface; of several contacts the mean by normal force. Rolling is no slip.
    """
    record, path = episode.record, 0.0
    arm = record.scene.arms[number]
    poses = [_poses(arm, state, number) for state in record.states]
    for k in range(episode.ends[0], episode.last):
        touching = [c for c in record.contacts[k] if (c.first.kind, c.first.number) == ("arm", number)]
        touching = [c for c in touching if c.second.kind == "object" and c.normal_n > 0.0]
        if not touching or number not in fingers_on_object(record.contacts[k + 1]):
            continue
        slips = []
        for c in touching:
            body = c.first.body
            own = _moved(c.position_m, *(pose[body] for pose in (*poses[k], *poses[k + 1])))
            before, after = record.states[k], record.states[k + 1]
            frames = before.rotations[0], before.positions_m[0], after.rotations[0], after.positions_m[0]
            apart = own - _moved(c.position_m, *frames)
            slips.append(np.linalg.norm(apart - (apart @ c.normal) * c.normal))
        path += float(np.average(slips, weights=[c.normal_n for c in touching]))
    return path


def _poses(arm: Arm, state: SceneState, number: int) -> tuple[Array, Array]:
    """Return rotations (n + 1, 3, 3) and origins (n + 1, 3) of a finger's bodies in the world."""
    pose = ChainGeometry.from_chain(arm.chain).forward(state.coordinates[number])
    return pose.rotations, pose.origins + state.carriage_m


def _moved(point: Array, turn: Array, place: Array, next_turn: Array, next_place: Array) -> Array:
    """Return where a point of a body goes when the body's frame moves."""
    return np.asarray(next_place + next_turn @ (turn.T @ (point - place)))


def _work_j(episode: Episode, number: int) -> float:
    """Return the work of the actuation on a finger's joints: ∫ Σ (τ(p, u) − τ(0, u)) du.

    It is the pressures' work ∫ p dV by the joints' motion where the law is linear in the pressure.
    """
    chain = episode.record.scene.arms[number].chain
    efforts = JointEfforts(chain.with_(terms=()))
    frames = range(episode.ends[0], episode.last + 1)
    q = np.array([episode.record.states[k].coordinates[number] for k in frames])
    none = dict.fromkeys(chain.inputs, 0.0)
    driven = np.array(
        [
            efforts.evaluate(one, episode.inputs[k][number]).tau - efforts.evaluate(one, none).tau
            for k, one in zip(frames, q, strict=True)
        ]
    )
    return float(np.sum(0.5 * (driven[1:] + driven[:-1]) * np.diff(q, axis=0)))
