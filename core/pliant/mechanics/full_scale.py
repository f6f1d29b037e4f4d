"""Full scale of a chain's actuation: the limit of its laws' domains, or the actuation of a large deformation."""

from __future__ import annotations

import math

import numpy as np

from pliant.mechanics.kinematics import main_axis
from pliant.records.chain import ChainModel


def full_scale(chain: ChainModel) -> float:
    """Return the full-scale actuation, Pa or N: the largest in the domains of the chain's laws.

    For a law without a domain it is the actuation that would rotate a joint by one radian (stretch it by its length) at
    its stiffness at rest, and infinite if the law does not depend on its actuation.
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
