"""The largest actuation of a chain: the end of its laws, or what would turn a joint far."""

from __future__ import annotations

import math

import numpy as np

from pliant.mechanics.kinematics import main_axis
from pliant.records.chain import ChainModel


def full_scale(chain: ChainModel) -> float:
    """Return the size of actuation at which forms are stated, Pa or N: the largest that the chain's laws know.

    A law without a domain knows of none; there it is what would turn a joint by one radian (stretch it by its length)
    if it were as stiff as at rest, and infinite where a law does not feel its actuation.
    """
    known = [float(np.max(np.abs(law.domain.actuation))) for law in chain.laws]
    if all(map(math.isfinite, known)):
        return max(known)
    reach = 1.0 if chain.laws[0].joint != "prismatic" else chain.length_m / chain.n_joints
    at, still = main_axis(chain.axes), np.zeros((1, len(chain.axes)))
    found = []
    for law in chain.laws:
        effort = law.evaluate(law.unactuated(1), still)
        pull = float(np.abs(effort.dtau_dp[0, at]).max())
        stiffness = abs(float(effort.dtau_du[0, at, at]))
        found.append(reach * stiffness / pull if pull > 0.0 else math.inf)
    return max(found)
