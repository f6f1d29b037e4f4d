"""A world scaled in length: Bullet's contact margins and thresholds are made for bodies of a metre.

With lengths × s, densities and times unchanged: masses × s³, forces × s⁴, torques and inertias × s⁵, and
accelerations, gravity among them, × s. Angles and their rates stay.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pliant.records.chain import ChainModel
from pliant.records.design import MassProperties
from pliant.records.shape import Shape, TriangleMesh


@dataclass(frozen=True)
class WorldScale:
    """`length`: how many times longer everything is inside the engine."""

    length: float = 1.0

    @property
    def mass(self) -> float:
        return self.length**3

    @property
    def force(self) -> float:
        return self.length**4

    @property
    def torque(self) -> float:
        return self.length**5

    def chain(self, chain: ChainModel) -> ChainModel:
        """The chain as the engine sees it; its laws are not scaled, because efforts are evaluated outside."""
        return chain.with_(
            joints=tuple(replace(j, offset_m=self.length * np.asarray(j.offset_m)) for j in chain.joints),
            bodies=tuple(self.piece(body) for body in chain.bodies),
            tip_offset_m=self.length * np.asarray(chain.tip_offset_m),
            base_position_m=self.length * np.asarray(chain.base_position_m),
            gravity_m_s2=self.length * np.asarray(chain.gravity_m_s2),
            payload_kg=self.mass * chain.payload_kg,
            shapes=tuple(tuple(self.shape(shape) for shape in shapes) for shapes in chain.shapes),
        )

    def piece(self, piece: MassProperties) -> MassProperties:
        """A rigid piece as the engine sees it."""
        return MassProperties(
            self.mass * piece.mass_kg,
            self.length * np.asarray(piece.com_m),
            self.torque * np.asarray(piece.inertia_kg_m2),
        )

    def shape(self, shape: Shape) -> Shape:
        """A collision shape as the engine sees it."""
        mesh = shape.mesh
        return replace(
            shape,
            size_m=tuple(self.length * size for size in shape.size_m),
            position_m=self.length * np.asarray(shape.position_m),
            mesh=TriangleMesh(self.length * mesh.vertices_m, mesh.faces) if mesh is not None else None,
        )
