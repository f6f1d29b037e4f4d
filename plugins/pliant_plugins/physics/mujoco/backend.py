"""The MuJoCo engine: fast dynamics, and equilibria by relaxation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from pliant.interfaces.physics import Capabilities, PhysicsBackend, Variation
from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.records.scene import Scene
from pliant_plugins.exporting.mjcf import write_mjcf
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.scene import MujocoScene
from pliant_plugins.physics.mujoco.simulation import MujocoSimulation
from pliant_plugins.physics.stepping import Paths, step_through


class Mujoco(PhysicsBackend):
    """MuJoCo with its `discrete` integrator, which takes the laws' slopes implicitly."""

    capabilities: ClassVar[Capabilities] = Capabilities(
        ("revolute", "spherical", "prismatic"),
        dynamic=True,
        internal_states=True,
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
        return step_through(self.build, chain, histories, towards, self.config.timestep_s)

    def build_scene(self, scene: Scene) -> MujocoScene:
        return MujocoScene(scene, self.config)

    def export(self, chain: ChainModel, path: Path, looks: ChainModel | None = None) -> tuple[Path, ...]:
        return write_mjcf(chain, path, looks, self.config.joint_damping)
