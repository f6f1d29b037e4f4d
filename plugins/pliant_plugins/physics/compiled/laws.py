"""The laws of a chain as arrays that compiled loops read."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numba import types

from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.law import ScalarFunction
from pliant_plugins.physics.compiled.functions import compile_function

_F, _A, _M = types.float64, types.float64[::1], types.float64[:, ::1]
LAW_SIGNATURE = types.void(_F, _A, _A, _A, _A, _M)


@dataclass(frozen=True, eq=False)
class CompiledLaws:
    """Laws of n joints with a axes under k actuators.

    Attributes:
        addresses: (n,) int64, the compiled law function of each joint; they live as long as the process.
        spans: (n, 2) int64, first and last (exclusive) of each joint's parameters.
        parameters: (P,) of all laws, one after another; joints with the same law share them.
        signs: (k,) of the actuators: τ = Σ_k s_k law(p_k, s_k q).
        boxes: (n, 1 + a, 2) the domain of each joint's law: actuation, then deformations, low and high.
    """

    addresses: Any
    spans: Any
    parameters: Array
    signs: Array
    boxes: Array

    @staticmethod
    def of(chain: ChainModel) -> CompiledLaws | None:
        """The laws of a chain; None where one of them has no scalar form.

        Raises:
            UserError: a scalar form that cannot be compiled.
        """
        scalars = [law.scalar() for law in chain.laws]
        known = [scalar for scalar in scalars if scalar is not None]
        if len(known) < len(scalars):
            return None
        ends = np.cumsum([0, *(len(scalar.parameters) for scalar in known)])
        spans = np.stack([ends[:-1], ends[1:]], axis=1).astype(np.int64)
        addresses = np.array([law_address(scalar.function) for scalar in known], np.int64)
        boxes = [np.vstack([law.domain.actuation, law.domain.deformation]) for law in chain.laws]
        of_joint = np.array([joint.law for joint in chain.joints])
        return CompiledLaws(
            np.ascontiguousarray(addresses[of_joint]),
            np.ascontiguousarray(spans[of_joint]),
            np.concatenate([np.asarray(scalar.parameters, float) for scalar in known]),
            np.array([actuator.sign for actuator in chain.actuators], float),
            np.ascontiguousarray(np.array(boxes, float)[of_joint]),
        )

    @property
    def arrays(self) -> tuple[Any, Any, Array, Array]:
        """What `efforts` takes: addresses, spans, parameters, signs."""
        return self.addresses, self.spans, self.parameters, self.signs


@cache
def _compiled(function: ScalarFunction) -> Any:
    return compile_function(function, LAW_SIGNATURE, "law")


def law_address(function: ScalarFunction) -> int:
    """Address of the compiled form of a law's scalar function, compiled once in a process and kept on disk.

    Raises:
        UserError: it cannot be compiled.
    """
    return int(_compiled(function).address)
