"""Metrics of an episode: rise, forces, slip, creep, the mode of the grasp and its reward (docs/grasping.md)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pliant.formatting import quantity
from pliant.records.design import Array
from pliant.records.scene import Contact, Part, Scene
from pliant_plugins.tasks.grasp.config import GraspConfig
from pliant_plugins.tasks.grasp.episode import GraspEpisode

Mode = Literal["miss", "touch", "slip", "stable"]
MODES: tuple[Mode, ...] = ("miss", "touch", "slip", "stable")
SCORES: dict[Mode, float] = {"miss": -1.0, "touch": 0.5, "slip": 1.0, "stable": 2.0}
LIFTED_M = 0.005  # a smaller rise is a tilt or a push, no lifting
HELD_SHARE = 0.5  # of the lift: an object that ends lower was not carried
DEEP = 0.05  # of the object's radius: fingers deeper in it feel the contact's spring, not its surface
SINKING_M_S = 0.002  # an object that sinks faster in the final hold is on its way out


@dataclass(frozen=True)
class Grip:
    """Touching of fingers and object at one instant: sums of forces (N), and the share of bodies that touch."""

    normal_n: float
    friction_n: float
    touching_share: float

    @staticmethod
    def from_contacts(contacts: Sequence[Contact], scene: Scene) -> Grip:
        """Return sums over the contacts between arms and objects."""
        held = [c for c in contacts if c.first.kind == "arm" and c.second.kind == "object" and c.normal_n > 0]
        bodies = sum(1 for arm in scene.arms for shapes in arm.chain.shapes[1:] if shapes)
        return Grip(
            sum(c.normal_n for c in held),
            float(sum(np.linalg.norm(c.friction_n) for c in held)),
            len({c.first for c in held}) / max(bodies, 1),
        )


def pressing_between_fingers_n(contacts: Sequence[Contact]) -> float:
    """Return Σ of the normal forces (N) of fingers on each other, and on themselves."""
    return sum(c.normal_n for c in contacts if c.first.kind == c.second.kind == "arm")


def contact_rows(contacts: Sequence[Contact]) -> list[dict[str, Any]]:
    """Return a row per contact that carries a force, SI: the two bodies, the position, the normal and friction forces.

    Fingers and their bodies are numbered from 1, the base piece is body 0. `force_n` (3,) is the whole force on the
    second body in the world, `normal_n` and `friction_n` are the sizes of its parts across and along the surface.
    """

    def name(part: Part) -> str:
        return f"finger {part.number + 1}, body {part.body}" if part.kind == "arm" else part.kind

    return [
        {
            "first": name(c.first),
            "second": name(c.second),
            "position_m": c.position_m.tolist(),
            "force_n": (c.normal_n * c.normal + c.friction_n).tolist(),
            "normal_n": c.normal_n,
            "friction_n": float(np.linalg.norm(c.friction_n)),
        }
        for c in contacts
        if c.normal_n > 0.0
    ]


def deepest_m(episode: GraspEpisode) -> float:
    """Return how far any finger was in the object during an episode."""
    touches = (contact for contacts in episode.contacts for contact in contacts)
    return max(
        (c.depth_m for c in touches if {c.first.kind, c.second.kind} == {"arm", "object"}), default=0.0
    )


def sunk_in(depth_m: float, radius_m: float) -> str:
    """Return a sentence where fingers were deeper in the object than contact is meant to be, or ""."""
    if depth_m <= DEEP * radius_m:
        return ""
    return (
        f"Fingers sink up to {quantity(depth_m, 'm', 2)} into the object, of {quantity(radius_m, 'm', 2)} radius: "
        "contact is that soft in the engine, and forces and rise are no surer than that. Press less, or make it harder "
        "(physics.contact_stiffness of mujoco)."
    )


@dataclass(frozen=True)
class TrialMetrics:
    """One trial, SI. Heights are rises of the object's centre of mass over its place at the start.

    Attributes:
        z_max_m, z_end_m: largest and final rise.
        normal_n, friction_n: sums over all contacts of fingers and object, mean over the final hold.
        efficiency: share of the fingers' moving bodies that touch the object, mean over the final hold.
        slip: share of the lift that the object did not follow, 0 to 1.
        creep_m_s: speed at which the object sinks in the final hold.
        mode: see `grasp_mode`.
        between_n: normal forces of fingers on fingers, mean over the final hold.
    """

    z_max_m: float
    z_end_m: float
    normal_n: float
    friction_n: float
    efficiency: float
    slip: float
    creep_m_s: float
    mode: Mode
    between_n: float = 0.0

    @property
    def friction_to_normal(self) -> float:
        """Return Σ|friction| / Σ normal; 0 without contact."""
        return self.friction_n / self.normal_n if self.normal_n > 0 else 0.0

    @property
    def mode_score(self) -> float:
        """The mode as a number: −1, 0.5, 1 or 2, as the published study counts it."""
        return SCORES[self.mode]


def trial_metrics(episode: GraspEpisode, scene: Scene, config: GraspConfig) -> TrialMetrics:
    """Evaluate one episode: rise, forces, slip, creep and mode."""
    rise = _rise_m(episode, scene)
    final = episode.during("final")
    grips = [Grip.from_contacts(episode.contacts[k], scene) for k in final]
    time = np.array([episode.states[k].time_s for k in final])
    creep = -float(np.polyfit(time, rise[final], 1)[0]) if len(final) > 1 else 0.0
    touched = any(Grip.from_contacts(contacts, scene).normal_n > 0 for contacts in episode.contacts)
    z_max, z_end = float(rise.max()), float(rise[-1])
    return TrialMetrics(
        z_max_m=z_max,
        z_end_m=z_end,
        normal_n=float(np.mean([grip.normal_n for grip in grips])),
        friction_n=float(np.mean([grip.friction_n for grip in grips])),
        between_n=float(np.mean([pressing_between_fingers_n(episode.contacts[k]) for k in final])),
        efficiency=float(np.mean([grip.touching_share for grip in grips])),
        slip=float(np.clip(1.0 - z_end / config.lift_height_m, 0.0, 1.0)),
        creep_m_s=creep,
        mode=grasp_mode(touched, z_max, z_end, creep, config.lift_height_m),
    )


def grasp_mode(touched: bool, z_max_m: float, z_end_m: float, creep_m_s: float, lift_m: float) -> Mode:
    """Return the mode of a grasp.

    miss: no finger ever pressed on the object. touch: the object never rose by 5 mm. stable: at the end it is up
    by at least half the lift and sinks by no more than 2 mm/s. slip: everything else.
    """
    if not touched:
        return "miss"
    if z_max_m < min(LIFTED_M, HELD_SHARE * lift_m):
        return "touch"
    if z_end_m >= HELD_SHARE * lift_m and creep_m_s <= SINKING_M_S:
        return "stable"
    return "slip"


def summary(trials: Sequence[TrialMetrics]) -> dict[str, Any]:
    """Return means over the trials, the most frequent mode (of equally frequent ones the worst), and `stable` share."""
    count = Counter(trial.mode for trial in trials)
    means = {name: float(np.mean(values)) for name, values in trial_lists(trials).items()}
    return {
        **means,
        "mode": max(MODES, key=lambda mode: (count[mode], -MODES.index(mode))),
        "success_share": count["stable"] / len(trials),
        "modes": {mode: count[mode] for mode in MODES},
    }


def trial_lists(trials: Sequence[TrialMetrics]) -> dict[str, list[float]]:
    """Return numbers of every trial by metric, unit in the name."""
    return {
        "z_max_m": [trial.z_max_m for trial in trials],
        "z_end_m": [trial.z_end_m for trial in trials],
        "normal_force_n": [trial.normal_n for trial in trials],
        "friction_force_n": [trial.friction_n for trial in trials],
        "friction_to_normal_ratio": [trial.friction_to_normal for trial in trials],
        "contact_efficiency_share": [trial.efficiency for trial in trials],
        "slip_ratio": [trial.slip for trial in trials],
        "creep_m_s": [trial.creep_m_s for trial in trials],
        "mode_score": [trial.mode_score for trial in trials],
        "finger_on_finger_force_n": [trial.between_n for trial in trials],
    }


def _rise_m(episode: GraspEpisode, scene: Scene) -> Array:
    """Return (frames,) height of the object's centre of mass over its place at the start."""
    com = scene.objects[0].mass.com_m
    height = np.array([(s.positions_m[0] + s.rotations[0] @ com)[2] for s in episode.states])
    return np.asarray(height - height[0])


RISE, FRICTION, CONTACT = 2.0, 0.5, 0.2
SLIP, PRESSURE, MODULE = 0.1, 0.5, 0.005  # costs
FULL_PRESSURE_PA = 15e3
PER_WEIGHT = 0.05


def reward(trial: TrialMetrics, scene: Scene, config: GraspConfig) -> float:
    """Return one number for a grasp, to be maximised: the one-step reward of the published co-design study.

        reward = w [mode + 2 h + 0.5 f − 0.1 s − 0.5 p / 15 kPa − 0.005 n + 0.2 c],    w = 1 + 0.05 · extra weights

    mode is −1 for a miss, 0.5 touch, 1 slip, 2 stable; h the largest rise per lift, held to 0 … 1; f friction over
    normal force; s the slip; p the pressure that was asked for; n the number of modules of all fingers; c the share of
    the moving bodies that touch the object, and one minus that for a cylinder, which few modules shall hold.
    Yao, Howard, Maiolino (2026), doi 10.1002/aisy.70406. It says that the reward grows mildly with the weight, and not
    how: w is ours.

    Tendon forces cost nothing in it: the study has pressures only.
    """
    rise = float(np.clip(trial.z_max_m / config.lift_height_m, 0.0, 1.0))
    few_touch = config.object.shape == "cylinder"
    contact = 1.0 - trial.efficiency if few_touch else trial.efficiency
    modules = sum(arm.chain.n_joints for arm in scene.arms)
    gained = trial.mode_score + RISE * rise + FRICTION * trial.friction_to_normal + CONTACT * contact
    spent = SLIP * trial.slip + PRESSURE * (config.pressure_pa or 0.0) / FULL_PRESSURE_PA + MODULE * modules
    return float((1.0 + PER_WEIGHT * config.extra_weights) * (gained - spent))
