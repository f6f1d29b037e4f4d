"""The grasp task: consecutive trials, each in a separate scene."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from pliant.interfaces.simulation import SceneSimulation
from pliant.interfaces.task import SceneEngine, SceneTask
from pliant.mechanics.stills import still
from pliant.records.chain import ChainModel
from pliant.records.rollout import Equilibrium, TaskResult
from pliant.records.scene import Scene, SceneFrames, SceneStill
from pliant_plugins.tasks.grasp.config import GraspConfig
from pliant_plugins.tasks.grasp.episode import GraspEpisode, play
from pliant_plugins.tasks.grasp.metrics import (
    TrialMetrics,
    contact_rows,
    deepest_m,
    reward,
    summary,
    sunk_in,
    trial_lists,
    trial_metrics,
)
from pliant_plugins.tasks.grasp.scene import Draw, GraspObject, grasp_object, grasp_scene

STILLS = {"lower": "lowered", "hold": "actuated", "final": "lifted"}


class Grasp(SceneTask):
    """Fingers around an object: lowered, actuated, lifted; `trials` times under the config's noise."""

    config: GraspConfig

    @cached_property
    def target(self) -> GraspObject:
        """Return the object on the floor."""
        return grasp_object(self.config)

    def scene(self, chain: ChainModel) -> Scene:
        return grasp_scene(chain, self.config, self.target, Draw.none())

    @property
    def arms_touch(self) -> bool:
        return self.config.finger_contact

    def measures(self) -> tuple[str, ...]:
        return (*trial_lists(()), "success_share", "reward", "object_mass_kg")

    def run(self, chain: ChainModel, engine: SceneEngine) -> TaskResult:
        started = time.perf_counter()
        trials: list[TrialMetrics] = []
        rewards: list[float] = []
        depth_m = 0.0
        draws = [Draw.from_config(self.config, k, self.target.radius_m) for k in range(self.config.trials)]
        for number, draw in enumerate(draws):
            scene = grasp_scene(chain, self.config, self.target, draw)
            with engine(scene) as simulation:
                episode = play(simulation, self.config, self.actuation(chain, draw))
                depth_m = max(depth_m, deepest_m(episode))
                trials.append(trial_metrics(episode, scene, self.config))
                rewards.append(reward(trials[-1], scene, self.config))
                if number == 0:
                    final = _final(simulation, episode)
                    frames = SceneFrames.from_states(episode.states)
                    stills = _stills(scene, episode)
                    touching = contact_rows(episode.contacts[-1])
        metrics: dict[str, Any] = {
            **summary(trials),
            "reward": float(np.mean(rewards)),
            "object_mass_kg": self.target.body.mass.mass_kg,
            "contacts": touching,
        }
        if notes := " ".join(filter(None, (self.target.note, sunk_in(depth_m, self.target.radius_m)))):
            metrics["note"] = notes
        if len(trials) > 1:
            metrics["trials"] = {
                "mode": [trial.mode for trial in trials],
                **trial_lists(trials),
                "reward": rewards,
                "friction_ratio": [draw.friction * self.config.friction for draw in draws],
                "actuation_offset_pa": [draw.pressure_pa for draw in draws],
                "placement_m": [float(np.linalg.norm(draw.offset_m)) for draw in draws],
            }
        final = replace(final, wall_s=time.perf_counter() - started)
        return TaskResult(final, metrics, None, frames, stills)

    def actuation(self, chain: ChainModel, draw: Draw) -> dict[str, float]:
        """Return full value of each input in a trial; the pressure's noise goes to the inputs that are driven."""
        full: Mapping[str, float] = self.config.actuation(chain)
        pressed = self.config.pressure_pa is not None
        return {name: max(v + draw.pressure_pa, 0.0) if pressed and v else v for name, v in full.items()}


def _final(simulation: SceneSimulation, episode: GraspEpisode) -> Equilibrium:
    """Return the first finger's final state; contact forces act on it, so that its own residual has no meaning."""
    return replace(
        simulation.pose(0),
        joint_angles=episode.states[-1].coordinates[0],
        iterations=len(episode.states) - 1,
        outside_domain=tuple(episode.outside[key] for key in sorted(episode.outside)),
    )


def _stills(scene: Scene, episode: GraspEpisode) -> tuple[SceneStill, ...]:
    return tuple(
        still(scene, episode.states[episode.last_frame(phase)], label)
        for phase, label in STILLS.items()
        if phase in episode.phase
    )
