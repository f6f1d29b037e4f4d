"""What a wrong frame of the torque does: efforts of the rotation vector applied as torques without the Jacobian.

The published formulation hands τ(u), component by component, to the engine as a torque. In joint coordinates
that is the effort Jᵀ τ with J the Jacobian of the rotation vector in the frame in which the torque acts, which
derives from no energy. As a law it runs in every engine through the engine's own, correct map.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from pliant.mechanics.rotations import left_jacobian, left_jacobian_transpose_slope
from pliant.records.design import Array
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord

Frame = Literal["child", "parent"]


@dataclass(frozen=True, eq=False)
class UnmappedLaw(JointLaw):
    """τ'(p, u) = J(u)ᵀ τ(p, u): the effort of `inner`, taken for a torque in the child's or parent's frame."""

    inner: JointLaw
    frame: Frame
    joint: JointKind = "spherical"
    axes: tuple[str, ...] = field(init=False)
    actuation_name: str = field(init=False)
    domain: Domain = field(init=False)

    def __post_init__(self) -> None:
        for name in ("axes", "actuation_name", "domain"):
            object.__setattr__(self, name, getattr(self.inner, name))

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Effort and exact slopes; ∂τ'/∂u is not symmetric."""
        effort = self.inner.evaluate(actuation, deformation)
        side = 1.0 if self.frame == "parent" else -1.0
        transposed = left_jacobian(side * np.asarray(deformation, float)).transpose(0, 2, 1)
        turning = side * left_jacobian_transpose_slope(side * deformation, effort.tau)
        return Effort(
            np.einsum("nij,nj->ni", transposed, effort.tau),
            np.einsum("nij,nj->ni", transposed, effort.dtau_dp),
            transposed @ effort.dtau_du + turning,
        )

    def record(self) -> LawRecord:
        inner = self.inner.record()
        return LawRecord("unmapped_benchmark", {"frame": self.frame, **inner.values}, inner.arrays)
