"""The MuJoCo engine: fast dynamics, and equilibria by relaxation."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import ClassVar

from pliant.interfaces.physics import Capabilities, PhysicsBackend, Run, Variation
from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.records.rollout import Rollout
from pliant.records.scene import Scene
from pliant_plugins.exporting.mjcf import write_mjcf
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.scene import MujocoScene
from pliant_plugins.physics.mujoco.simulation import MujocoSimulation, through
from pliant_plugins.physics.stepping import Paths, step_through


class Mujoco(PhysicsBackend):
    """MuJoCo with its `discrete` integrator, which takes the laws' slopes implicitly."""

    capabilities: ClassVar[Capabilities] = Capabilities(
        ("revolute", "spherical", "prismatic"),
        dynamic=True,
        internal_states=True,
        batch=True,
        contacts=True,
        export="mjcf",
    )
    config: MujocoConfig

    def build(self, chain: ChainModel) -> MujocoSimulation:
        return MujocoSimulation(chain, self.config)

    def follow(
        self, chain: ChainModel, histories: Sequence[History], towards: Sequence[Variation] = ()
    ) -> Paths:
        """Steps with the chain's own inertia; derivatives are differences to the varied chain's own path."""
        return step_through(self.build, chain, histories, towards, self.config.timestep_s, through)

    def build_scene(self, scene: Scene) -> MujocoScene:
        return MujocoScene(scene, self.config)

    def preparing(self, chain: ChainModel, histories: bool = True) -> str | None:
        from pliant_plugins.physics.compiled.freshness import is_cached

        if not histories or any(law.scalar() is None for law in chain.laws) or is_cached("motion", "move"):
            return None
        return "compiling the simulation, about ten seconds; this happens once after an installation."

    def rollout_batch(self, runs: Sequence[Run]) -> tuple[Rollout, ...]:
        """Runs of one chain share its model; on all cores where laws are compiled, which hold no lock of Python."""
        cores = os.cpu_count() or 1
        of_chain: dict[int, list[int]] = {}
        for k, run in enumerate(runs):
            of_chain.setdefault(id(run.chain), []).append(k)
        parts = [numbers[k::cores] for numbers in of_chain.values() for k in range(min(cores, len(numbers)))]
        found: dict[int, Rollout] = {}
        with ThreadPoolExecutor(cores) as pool:
            rolled = pool.map(lambda part: self._roll_all([runs[k] for k in part]), parts)
            for numbers, rollouts in zip(parts, rolled, strict=True):
                found.update(zip(numbers, rollouts, strict=True))
        return tuple(found[k] for k in range(len(runs)))

    def _roll_all(self, runs: Sequence[Run]) -> list[Rollout]:
        """Runs of one chain, each from rest."""
        found = []
        with closing(self.build(runs[0].chain)) as simulation:
            rest = simulation.snapshot()
            for run in runs:
                simulation.restore(rest)
                found.append(simulation.roll(run.history) or self._roll(run))
        return found

    def export(self, chain: ChainModel, path: Path, looks: ChainModel | None = None) -> tuple[Path, ...]:
        return write_mjcf(chain, path, looks, self.config.joint_damping)
