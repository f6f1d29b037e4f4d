"""The PyBullet engine: explicit dynamics, and equilibria by relaxation."""

from __future__ import annotations

from typing import ClassVar

from pliant.interfaces.physics import Capabilities, PhysicsBackend
from pliant.mechanics.statics import ChainStatics
from pliant.records.chain import ChainModel
from pliant_plugins.physics.dynamic import DynamicSimulation
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.pybullet.engine import BulletChain


class Pybullet(PhysicsBackend):
    """PyBullet (Bullet's articulated bodies) with explicit torques of the laws."""

    capabilities: ClassVar[Capabilities] = Capabilities(("revolute", "spherical", "prismatic"), dynamic=True)
    config: PybulletConfig

    def build(self, chain: ChainModel) -> DynamicSimulation:
        statics = ChainStatics(chain)
        engine = BulletChain(chain, statics, self.config)
        return DynamicSimulation(chain, statics, engine, self.config.tolerance, self.config.max_settle_steps)
