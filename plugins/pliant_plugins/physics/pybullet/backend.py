"""The PyBullet engine: explicit dynamics, equilibria by relaxation, scenes with contact."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from pliant.errors import UserError
from pliant.interfaces.physics import Capabilities, PhysicsBackend, SceneSimulation
from pliant.mechanics.statics import ChainStatics
from pliant.records.chain import ChainModel
from pliant.records.scene import Scene
from pliant_plugins.exporting.urdf import write_urdf
from pliant_plugins.physics.dynamic import DynamicSimulation
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.pybullet.engine import BulletChain, PublishedChain


class Pybullet(PhysicsBackend):
    """PyBullet (Bullet's articulated bodies) with explicit torques of the laws."""

    capabilities: ClassVar[Capabilities] = Capabilities(
        ("revolute", "spherical", "prismatic"), dynamic=True, contacts=True, export="urdf"
    )
    config: PybulletConfig

    def build(self, chain: ChainModel) -> DynamicSimulation:
        statics = ChainStatics(chain)
        kind = PublishedChain if self.config.preset == "published" else BulletChain
        engine = kind(chain, statics, self.config)
        return DynamicSimulation(chain, statics, engine, self.config.tolerance, self.config.max_settle_steps)

    def build_scene(self, scene: Scene) -> SceneSimulation:
        if self.config.preset == "published":
            raise UserError(
                "physics.preset 'published' is a baseline for single chains: leave it out for tasks with contact"
            )
        # Law functions are compiled for scenes only: single chains do not wait for numba.
        from pliant_plugins.physics.pybullet.scene import BulletScene

        return BulletScene(scene, self.config)

    def preparing(self, chain: ChainModel, histories: bool = True) -> str | None:
        if self.config.preset == "published":
            return (
                "physics.preset 'published' steps through time as published, but equilibria, which this task asks "
                "for, are found as without it."
            )
        return None

    def export(self, chain: ChainModel, path: Path, looks: ChainModel | None = None) -> tuple[Path, ...]:
        return write_urdf(chain, path, looks)
