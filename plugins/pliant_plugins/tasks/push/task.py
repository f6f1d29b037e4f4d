"""The task `push`: maps of the force on a wall, and of its stiffness, over the wall's place and the actuation."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from pliant.interfaces.task import SceneEngine, SceneTask
from pliant.mechanics.contact_statics import with_capsules
from pliant.mechanics.rotations import exp_map
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import TaskResult
from pliant.records.scene import Arm, Obstacle, Scene
from pliant.records.shape import Shape
from pliant_plugins.tasks.obstacles import capsule_radius_m
from pliant_plugins.tasks.push.config import PushConfig
from pliant_plugins.tasks.scene_record import SceneRecord, force_on_n

# Half the thickness of the wall.
HALF_THICKNESS_M = 0.005
RAMP_FRAMES, HOLD_FRAMES = 5, 6
MEASURED = ("holding_force_n", "largest_force_n", "tangential_n", "stiffness_n_per_m", "tip_speed_m_s")


class Push(SceneTask):
    """A chain that is actuated level by level against a wall, once for each place of the wall.

    Metrics: `holding_force_n` on the wall at full actuation and the first distance, along its normal; `tangential_n`
    beside it; the largest force of all; `stiffness_n_per_m`, the loss of holding force for each metre that the wall
    recedes; `tip_speed_m_s` at the end. `map` has force and stiffness at each distance (row) and level (column).
    """

    config: PushConfig

    @property
    def settles(self) -> bool:
        return True

    def measures(self) -> tuple[str, ...]:
        return MEASURED

    def scene(self, chain: ChainModel) -> Scene:
        return self._scene(chain, self.config.distances_m[0])

    def run(self, chain: ChainModel, engine: SceneEngine) -> TaskResult:
        started = time.perf_counter()
        full, rows, beside, records = self.config.actuation(chain), [], [], []
        for distance in self.config.distances_m:
            record, forces = self._pushed(self._scene(chain, distance), engine, full)
            records.append(record)
            normal, rest = self._split(forces)
            rows.append(normal)
            beside.append(rest)
        force, first = np.array(rows), records[0]
        metrics: dict[str, Any] = {
            "holding_force_n": float(force[0, -1]),
            "largest_force_n": float(force.max()),
            "tangential_n": float(beside[0][-1]),
            "tip_speed_m_s": max(record.tip_speed_m_s() for record in records),
        }
        shares = [(k + 1) / self.config.levels for k in range(self.config.levels)]
        table: dict[str, Any] = {
            "distance_m": list(self.config.distances_m),
            "level_ratio": shares,
            "force_n": force.tolist(),
        }
        if len(force) > 1:
            stiffness = -np.gradient(force, np.array(self.config.distances_m), axis=0)
            metrics["stiffness_n_per_m"] = float(stiffness[0, -1])
            table["stiffness_n_per_m"] = stiffness.tolist()
        stills = (first.still(0, "at rest"), first.still(-1, "pressing"))
        settled = all(record.settled for record in records)
        said = "" if settled else "The chain did not settle against the wall."
        final = first.equilibrium(time.perf_counter() - started)
        return TaskResult(final, {**metrics, "map": table}, None, first.frames, stills, said)

    def _scene(self, chain: ChainModel, distance_m: float) -> Scene:
        radius = capsule_radius_m(chain, self.config.radius_m, "push")
        arm = Arm(with_capsules(chain, radius), self.config.friction)
        wall = Obstacle("wall", (self._wall(chain, radius, distance_m),), 1.0)
        return Scene((arm,), obstacles=(wall,), gravity_m_s2=np.asarray(chain.gravity_m_s2, float))

    def _wall(self, chain: ChainModel, radius_m: float, distance_m: float) -> Shape:
        """Return a plate opposite the base that is as wide as the chain reaches."""
        normal, base, wide = self._normal, np.asarray(chain.base_position_m), chain.length_m + 2 * radius_m
        surface = base + (np.array(self.config.wall.position_m) - base) @ normal * normal
        centre = surface - (distance_m + HALF_THICKNESS_M) * normal
        return Shape("box", (wide, wide, HALF_THICKNESS_M), centre, _turn_to(normal))

    @property
    def _normal(self) -> Array:
        given = np.array(self.config.wall.normal, float)
        return np.asarray(given / np.linalg.norm(given))

    def _pushed(
        self, scene: Scene, engine: SceneEngine, full: dict[str, float]
    ) -> tuple[SceneRecord, list[Array]]:
        """Return the record of one place of the wall, and the force (3,) on the wall at each level."""
        config, record, forces = self.config, SceneRecord(scene), []
        before = dict.fromkeys(full, 0.0)
        with engine(scene) as simulation:
            record.see(simulation)
            for level in range(1, config.levels + 1):
                wanted = {name: value * level / config.levels for name, value in full.items()}
                record.drive(simulation, [wanted], [before], config.ramp_time_s, RAMP_FRAMES)
                record.hold(simulation, config.hold_time_s, HOLD_FRAMES)
                forces.append(force_on_n(record.contacts[-1]))
                before = wanted
        return record, forces

    def _split(self, forces: list[Array]) -> tuple[list[float], list[float]]:
        """Return the parts of the forces into the wall and along it."""
        into = [max(-float(force @ self._normal), 0.0) for force in forces]
        along = [float(np.linalg.norm(f - (f @ self._normal) * self._normal)) for f in forces]
        return into, along


def _turn_to(normal: Array) -> Array:
    """Return the smallest rotation (3, 3) that takes z to a unit vector."""
    axis = np.cross([0.0, 0.0, 1.0], normal)
    sine, cosine = float(np.linalg.norm(axis)), float(normal[2])
    if sine < 1e-12:
        return np.eye(3) if cosine > 0.0 else np.diag([1.0, -1.0, -1.0])
    return np.asarray(exp_map(axis / sine * np.arctan2(sine, cosine)))
