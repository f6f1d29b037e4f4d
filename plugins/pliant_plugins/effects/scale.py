"""The stiffness that makes law terms free of a joint's size."""

from __future__ import annotations

import numpy as np

from pliant.errors import UserError
from pliant.mechanics.kinematics import main_axis
from pliant.records.chain import ChainModel
from pliant.records.design import Array


def rest_stiffness(chain: ChainModel) -> float:
    """Return k₀, the mean of `joint_stiffnesses`: a term is one function for the whole chain.

    Effects state their moments as shares of k₀ or as the angle that k₀ makes of them, so that the same number means the
    same on a fingertip and on an arm.

    Raises:
        UserError: the law has no stiffness at rest.
    """
    return float(np.mean(joint_stiffnesses(chain)))


def joint_stiffnesses(chain: ChainModel) -> Array:
    """Return (n,) −∂τ/∂u at p = 0, u = 0 of each joint's law before any effect, in N·m/rad (N/m on slides).

    About the main axis, over all actuators of a joint.

    Raises:
        UserError: one of them is not positive.
    """
    at = main_axis(chain.axes)
    still = np.zeros((1, len(chain.axes)))
    slopes = [-float(law.evaluate(law.unactuated(1), still).dtau_du[0, at, at]) for law in chain.laws]
    stiffness = chain.parts * np.array([slopes[joint.law] for joint in chain.joints])
    if not stiffness.min() > 0:
        raise UserError(
            f"the joint law has the slope {-stiffness.min():.3g} N·m/rad at rest, and an effect that is stated as a "
            "share of the stiffness at rest needs a negative one; look at the law's fit, or at b_e of a stated law."
        )
    return stiffness
