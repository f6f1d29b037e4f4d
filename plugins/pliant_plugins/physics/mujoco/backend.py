"""The MuJoCo engine: fast dynamics, and equilibria by relaxation."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from pliant.interfaces.physics import Capabilities, PhysicsBackend
from pliant.mechanics.statics import ChainStatics
from pliant.records.chain import ChainModel
from pliant.records.scene import Scene
from pliant_plugins.exporting.mjcf import write_mjcf
from pliant_plugins.physics.dynamic import DynamicSimulation
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.engine import MujocoChain
from pliant_plugins.physics.mujoco.scene import MujocoScene


class Mujoco(PhysicsBackend):
    """MuJoCo with its `discrete` integrator, which takes the laws' slopes implicitly."""

    capabilities: ClassVar[Capabilities] = Capabilities(
        ("revolute", "spherical", "prismatic"), dynamic=True, contacts=True, export="mjcf"
    )
    config: MujocoConfig

    def build(self, chain: ChainModel) -> DynamicSimulation:
        statics = ChainStatics(chain)
        engine = MujocoChain(chain, statics, self.config)
        return DynamicSimulation(chain, statics, engine, self.config.tolerance, self.config.max_settle_steps)

    def build_scene(self, scene: Scene) -> MujocoScene:
        return MujocoScene(scene, self.config)

    def export(self, chain: ChainModel, path: Path, looks: ChainModel | None = None) -> tuple[Path, ...]:
        return write_mjcf(chain, path, looks, self.config.joint_damping)
