"""One number for a grasp, to be maximised: the one-step reward of the published co-design study.

    reward = w [mode + 2 h + 0.5 f − 0.1 s − 0.5 p / 15 kPa − 0.005 n + 0.2 c],    w = 1 + 0.05 · extra weights

mode is −1 for a miss, 0.5 touch, 1 slip, 2 stable; h the largest rise per lift, held to 0 … 1; f friction over normal
force; s the slip; p the pressure that was asked for; n the number of modules of all fingers; c the share of the moving
bodies that touch the object, and one minus that for a cylinder, which few modules shall hold.
Yao, Howard, Maiolino (2026), doi 10.1002/aisy.70406. It says that the reward grows mildly with the weight, and not how:
w is ours.
"""

from __future__ import annotations

import numpy as np

from pliant.records.scene import Scene
from pliant_plugins.tasks.grasp.config import GraspConfig
from pliant_plugins.tasks.grasp.metrics import TrialMetrics

RISE, FRICTION, CONTACT = 2.0, 0.5, 0.2
SLIP, PRESSURE, MODULE = 0.1, 0.5, 0.005  # costs
FULL_PRESSURE_PA = 15e3
PER_WEIGHT = 0.05


def reward(trial: TrialMetrics, scene: Scene, config: GraspConfig) -> float:
    """The reward of one trial in its scene. Tendon forces cost nothing in it: the study has pressures only."""
    rise = float(np.clip(trial.z_max_m / config.lift_height_m, 0.0, 1.0))
    few_touch = config.object.shape == "cylinder"
    contact = 1.0 - trial.efficiency if few_touch else trial.efficiency
    modules = sum(arm.chain.n_joints for arm in scene.arms)
    gained = trial.mode_score + RISE * rise + FRICTION * trial.friction_to_normal + CONTACT * contact
    spent = SLIP * trial.slip + PRESSURE * (config.pressure_pa or 0.0) / FULL_PRESSURE_PA + MODULE * modules
    return float((1.0 + PER_WEIGHT * config.extra_weights) * (gained - spent))
