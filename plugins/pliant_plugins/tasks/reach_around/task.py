"""The task `reach_around`: actuations by inverse statics among obstacles, a ramp to them in a scene, its metrics."""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import cached_property

import numpy as np

from pliant.errors import NotReachedError, UserError
from pliant.interfaces.simulation import Simulation
from pliant.interfaces.task import SceneEngine, SceneTask
from pliant.inverse.clearance import Clearance
from pliant.inverse.statics import InverseStatics
from pliant.inverse.target import Target
from pliant.pipeline.chain import base_rotation
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import TaskResult
from pliant.records.scene import Arm, Obstacle, Scene
from pliant_plugins.physics.quasistatic.among_obstacles import ChainAmongObstacles
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.tasks.obstacles import capsule_radius_m, rounded, solids
from pliant_plugins.tasks.reach_around.config import ReachAroundConfig, ReachingArmConfig
from pliant_plugins.tasks.scene_record import SceneRecord, pressing_n

KIND = "reach_around"
HOLD_FRAMES = 10
MEASURED = (
    "distance_m",
    "angle_rad",
    "clearance_m",
    "least_clearance_m",
    "press_n",
    "largest_press_n",
    "tip_speed_m_s",
)


class ReachAround(SceneTask):
    """Copies of the chain among fixed obstacles, each actuated until its tip is at its target.

    Metrics: `distance_m`, the largest of the tips from their targets; `angle_rad` from the directions; `clearance_m`
    of the chains' capsules from the obstacles at the end, and the least of the motion; `press_n` on the obstacles;
    `tip_speed_m_s`, small where the chain is at rest.
    """

    config: ReachAroundConfig

    @property
    def settles(self) -> bool:
        return True

    def measures(self) -> tuple[str, ...]:
        return MEASURED

    @cached_property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """Return the obstacles at their places; their coefficient is 1, so that a pair has the chain's."""
        return tuple(
            one.record(f"obstacle {number}", 1.0) for number, one in enumerate(self.config.obstacles, 1)
        )

    def scene(self, chain: ChainModel) -> Scene:
        chain = rounded(chain, self.config.radius_m, KIND)
        arms = tuple(Arm(_placed(chain, one), self.config.friction) for one in self.config.arms)
        return Scene(arms, obstacles=self.obstacles, gravity_m_s2=np.asarray(chain.gravity_m_s2, float))

    def check_reach(self, length_m: float) -> None:
        for one in self.config.arms:
            if one.base is None:
                continue
            away = float(np.linalg.norm(np.subtract(one.tip_m, one.base.position_m)))
            if away > length_m:
                raise UserError(
                    f"task.arms: a tip shall be {1e3 * away:.4g} mm from its base, and the longest chain is "
                    f"{1e3 * length_m:.4g} mm; use more modules or a nearer target."
                )

    def run(self, chain: ChainModel, engine: SceneEngine) -> TaskResult:
        started = time.perf_counter()
        scene, config = self.scene(chain), self.config
        inputs = [self.actuation(arm.chain, one) for arm, one in zip(scene.arms, config.arms, strict=True)]
        record = SceneRecord(scene)
        with engine(scene) as simulation:
            record.see(simulation)
            record.drive(simulation, inputs, None, config.ramp_time_s, config.frames)
            record.hold(simulation, config.hold_time_s, HOLD_FRAMES)
        metrics = {**self.metrics(record), "inputs": [dict(one) for one in inputs]}
        stills = (record.still(0, "at rest"), record.still(-1, "actuated"))
        final = record.equilibrium(time.perf_counter() - started)
        said = "" if record.settled else "The chain did not settle among the obstacles."
        return TaskResult(final, metrics, None, record.frames, stills, said)

    def actuation(self, chain: ChainModel, arm: ReachingArmConfig) -> Mapping[str, float]:
        """Return the full value of every input of an arm: the stated ones, else those of inverse statics.

        Raises:
            UserError: an input that the chain does not have, or one without bounds.
        """
        if arm.inputs:
            unknown = [name for name in arm.inputs if name not in chain.inputs]
            if unknown:
                raise UserError(
                    f"task.arms: 'inputs' names {', '.join(unknown)}, and the chain's inputs are "
                    f"{', '.join(chain.inputs)}: use these names."
                )
            return {**dict.fromkeys(chain.inputs, 0.0), **arm.inputs}
        config, engine = self.config, QuasistaticConfig()
        direction = None if arm.direction is None else np.array(arm.direction)
        keeps = self.clearance(chain) if config.contact == "avoid" else None
        target = Target(tip_m=np.array(arm.tip_m), direction=direction, clearance=keeps)
        simulation: Simulation = (
            ChainAmongObstacles(chain, solids(self.obstacles), engine)
            if keeps is None
            else Quasistatic(engine).build(chain)
        )
        inverse = InverseStatics(simulation, config.bounds, config.samples)
        try:
            return inverse.solve(target).actuation
        except NotReachedError:  # the motion is measured where the inputs are in the middle of their bounds
            return dict(zip(inverse.inputs, inverse.bounds.mean(axis=1).tolist(), strict=True))

    def metrics(self, record: SceneRecord) -> dict[str, float]:
        """Return the metrics of a recorded motion."""
        config = self.config
        ends = record.markers_m[-1]
        keeps = [self.clearance(arm.chain) for arm in record.scene.arms]
        clear = [min(k.smallest_m(m) for k, m in zip(keeps, seen, strict=True)) for seen in record.markers_m]
        tips = zip(ends, config.arms, strict=True)
        metrics = {"distance_m": max(float(np.linalg.norm(m[-1] - one.tip_m)) for m, one in tips)}
        angles = [
            _angle_rad(markers[-1] - markers[-2], np.array(one.direction))
            for markers, one in zip(ends, config.arms, strict=True)
            if one.direction is not None
        ]
        if angles:
            metrics["angle_rad"] = max(angles)
        presses = [pressing_n(contacts) for contacts in record.contacts]
        return {
            **metrics,
            "clearance_m": clear[-1],
            "least_clearance_m": min(clear),
            "press_n": presses[-1],
            "largest_press_n": max(presses),
            "tip_speed_m_s": record.tip_speed_m_s(),
        }

    def clearance(self, chain: ChainModel) -> Clearance:
        """Return the clearance of an arm from the obstacles."""
        radius = capsule_radius_m(chain, self.config.radius_m, KIND)
        return Clearance(solids(self.obstacles), radius, self.config.clearance_m)


def _placed(chain: ChainModel, arm: ReachingArmConfig) -> ChainModel:
    """Return the chain with an arm's own base."""
    if arm.base is None:
        return chain
    place = np.array(arm.base.position_m, float)
    return chain.with_(base_position_m=place, base_rotation=base_rotation(arm.base))


def _angle_rad(one: Array, other: Array) -> float:
    """Return the angle between two vectors; the arc tangent is exact for small ones."""
    return float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))
