"""What a file can say of a law: its stiffness at rest."""

from __future__ import annotations

import numpy as np

from pliant.records.chain import ChainModel
from pliant.records.design import Array

THE_LAW = (
    " Written by Pliant. The joint law is not in this file: stiffness is that of the law at rest without actuation, "
    "and nothing actuates the chain. SI units. "
)


def stiffness_at_rest(chain: ChainModel) -> Array:
    """(n, a, a) −∂τ/∂u of every joint without actuation and deformation, all actuators together."""
    a = len(chain.axes)
    of_law = [law.evaluate(np.zeros(1), np.zeros((1, a))).dtau_du[0] for law in chain.laws]
    squares = sum(actuator.sign**2 for actuator in chain.actuators)
    return np.array([-squares * of_law[joint.law] for joint in chain.joints])
