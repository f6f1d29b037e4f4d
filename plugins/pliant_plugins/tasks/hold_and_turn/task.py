"""The task `hold_and_turn`: the grasp's scene, an episode of holding and turning, its metrics."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from pliant.interfaces.task import SceneEngine, SceneTask
from pliant.records.chain import ChainModel
from pliant.records.rollout import TaskResult
from pliant.records.scene import Scene
from pliant_plugins.tasks.grasp.metrics import contact_rows, sunk_in
from pliant_plugins.tasks.grasp.scene import Draw, GraspObject, grasp_object, grasp_scene
from pliant_plugins.tasks.hold_and_turn.config import HoldAndTurnConfig
from pliant_plugins.tasks.hold_and_turn.episode import Episode, play
from pliant_plugins.tasks.hold_and_turn.metrics import cycle_turns_rad, metrics, turns_rad, unit_axis
from pliant_plugins.tasks.obstacles import rounded

MEASURED = (
    "turn_rad",
    "drift_m",
    "largest_drift_m",
    "tilt_rad",
    "held",
    "held_share",
    "peak_force_n",
    "slip_m",
    "work_j",
    "repeatability_rad",
)


class HoldAndTurn(SceneTask):
    """Fingers around an object take hold of it and turn it in the hand, on a table or carried.

    Metrics: `turn_rad` about the axis since the turning began, at the end; `drift_m` of the object's centre of mass
    from the hand, at the end and at most; `tilt_rad` of the axis in the object; `held` 1 if at the end two fingers
    press on it (and it does not stand, if carried), and the share of the time in which they do; `peak_force_n` of a
    finger on it; `slip_m`, the path on which a finger slides over it; `work_j` of the actuation on the joints;
    `repeatability_rad`, the standard deviation of the cycles' turns.
    """

    config: HoldAndTurnConfig

    @cached_property
    def target(self) -> GraspObject:
        """Return the object where it stands at first."""
        return grasp_object(self.config)

    @property
    def arms_touch(self) -> bool:
        return self.config.finger_contact

    def measures(self) -> tuple[str, ...]:
        return MEASURED

    def scene(self, chain: ChainModel) -> Scene:
        config = self.config
        if config.radius_m is not None:
            chain = rounded(chain, config.radius_m, config.kind)
        scene = grasp_scene(chain, config, self.target, Draw.none())
        return replace(scene, floor_friction=config.table_friction)

    def run(self, chain: ChainModel, engine: SceneEngine) -> TaskResult:
        started = time.perf_counter()
        with engine(self.scene(chain)) as simulation:
            episode = play(simulation, self.config, self.config.actuation(chain))
        record = episode.record
        found: dict[str, Any] = {**metrics(episode, self.config), **self._details(episode)}
        marks = {"at rest": 0, "held": episode.ends[0], "first cycle": episode.ends[1], "turned": -1}
        if self.config.turn.cycles == 1:
            del marks["first cycle"]
        stills = tuple(record.still(frame, label) for label, frame in marks.items())
        final = record.equilibrium(time.perf_counter() - started)
        return TaskResult(final, found, None, record.frames, stills)

    def _details(self, episode: Episode) -> dict[str, Any]:
        """Return the turn of each cycle, the contacts at the end, and remarks."""
        record = episode.record
        rotations = np.array([state.rotations[0] for state in record.states[episode.ends[0] :]])
        turns = turns_rad(rotations, unit_axis(self.config))
        details: dict[str, Any] = {
            "cycle_turns_rad": cycle_turns_rad(episode, turns),
            "contacts": contact_rows(record.contacts[-1]),
        }
        touches = (c for contacts in record.contacts for c in contacts)
        depth_m = max(
            (c.depth_m for c in touches if {c.first.kind, c.second.kind} == {"arm", "object"}), default=0.0
        )
        if notes := " ".join(filter(None, (self.target.note, sunk_in(depth_m, self.target.radius_m)))):
            details["note"] = notes
        return details
