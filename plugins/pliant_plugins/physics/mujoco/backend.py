"""The MuJoCo engine: fast dynamics, and equilibria by relaxation.

A chain alone moves in real time, relaxes in pseudo-time, or follows histories; on an external arm both move.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import ClassVar

from pliant.interfaces.physics import (
    Capabilities,
    Case,
    PhysicsBackend,
    Run,
    Variation,
    roll_each,
    settle_each,
)
from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.records.mount import Mount
from pliant.records.rollout import Equilibrium, Rollout
from pliant.records.scene import Scene
from pliant.records.shape import Shape
from pliant_plugins.exporting.mjcf import write_mjcf
from pliant_plugins.exporting.mjcf_scene import write_scene
from pliant_plugins.physics.compiled import is_cached
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.mount import MountedArm
from pliant_plugins.physics.mujoco.mounted import MountedSimulation
from pliant_plugins.physics.mujoco.scene import MujocoScene
from pliant_plugins.physics.mujoco.simulation import MujocoSimulation
from pliant_plugins.physics.stepping import Paths, step_through


class Mujoco(PhysicsBackend):
    """MuJoCo with its `discrete` integrator, which takes the laws' slopes implicitly."""

    capabilities: ClassVar[Capabilities] = Capabilities(
        ("revolute", "spherical", "prismatic", "extensible"),
        dynamic=True,
        arms_touch=True,
        free_bases=True,
    )
    export_format: ClassVar[str] = "mjcf"
    config: MujocoConfig

    def build(self, chain: ChainModel) -> MujocoSimulation:
        if chain.mount is not None:
            return MountedSimulation(chain, self.config)
        return MujocoSimulation(chain, self.config)

    def check_mount(self, mount: Mount) -> None:
        MountedArm.from_mount(mount)

    def mount_shapes(self, mount: Mount) -> tuple[tuple[Shape, ...], ...]:
        return MountedArm.from_mount(mount).shapes()

    def follow(
        self, chain: ChainModel, histories: Sequence[History], towards: Sequence[Variation] = ()
    ) -> Paths:
        """Step with the chain's inertia; derivatives are finite differences of paths."""
        through = MujocoSimulation.through
        return step_through(self.build, chain, histories, towards, self.config.timestep_s, through)

    def build_scene(self, scene: Scene) -> MujocoScene:
        return MujocoScene(scene, self.config)

    def preparing(self, chain: ChainModel, histories: bool = True) -> str | None:
        if not histories or any(law.scalar() is None for law in chain.laws) or is_cached("motion", "move"):
            return None
        return "compiling the simulation, about ten seconds; this happens once after an installation."

    def settle_batch(self, cases: Sequence[Case]) -> tuple[Equilibrium, ...]:
        return settle_each(self, cases)

    def rollout_batch(self, runs: Sequence[Run]) -> tuple[Rollout, ...]:
        """Run histories; runs of one chain share its model, on all cores if laws are compiled."""
        cores = os.cpu_count() or 1
        of_chain: dict[int, list[int]] = {}
        for k, run in enumerate(runs):
            of_chain.setdefault(id(run.chain), []).append(k)
        parts = [numbers[k::cores] for numbers in of_chain.values() for k in range(min(cores, len(numbers)))]
        rollouts: dict[int, Rollout] = {}
        with ThreadPoolExecutor(cores) as pool:
            rolled = pool.map(lambda part: self._roll_all([runs[k] for k in part]), parts)
            for numbers, done in zip(parts, rolled, strict=True):
                rollouts.update(zip(numbers, done, strict=True))
        return tuple(rollouts[k] for k in range(len(runs)))

    def _roll_all(self, runs: Sequence[Run]) -> list[Rollout]:
        """Run histories of one chain, each from rest."""
        rollouts = []
        with closing(self.build(runs[0].chain)) as simulation:
            rest = simulation.snapshot()
            for run in runs:
                simulation.restore(rest)
                rollouts.append(simulation.roll(run.history) or roll_each(self, [run])[0])
        return rollouts

    def effort_tolerance(self) -> float:
        """Return the config's."""
        return self.config.tolerance

    def added_damping(self) -> str:
        """Return drag and joint damping, where they are not 0."""
        drag, damping = self.config.drag_1_s, self.config.joint_damping
        named = [f"drag_1 {drag:g} 1/s"] if drag else []
        return " and ".join([*named, *([f"joint_damping {damping:g} N·m·s/rad"] if damping else [])])

    def export(self, chain: ChainModel, path: Path, looks: ChainModel | None = None) -> tuple[Path, ...]:
        return write_mjcf(chain, path, looks, self.config.joint_damping)

    def export_scene(self, scene: Scene, path: Path) -> tuple[Path, ...]:
        return write_scene(scene, path, self.config)
