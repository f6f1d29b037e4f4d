"""Check of an engine's tolerance against the stiffness of the joints.

An equilibrium within a tolerance t of effort is off by up to t / k in a joint of stiffness k: a joint of 1e-6 N·m/rad
by 1e-3 rad under the default tolerances, which are meant for joints of 1e-3 N·m/rad and stiffer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pliant.interfaces.physics import PhysicsBackend
from pliant.records.chain import ChainModel
from pliant.records.law import JointLaw

# From this error on, in rad or module lengths, a remark is made; the proposed tolerance leaves that much.
DOUBTFUL, WANTED = 1e-3, 1e-6


def tolerance_remarks(chain: ChainModel, engines: Sequence[PhysicsBackend]) -> tuple[str, ...]:
    """Return a sentence for each engine that calls states of a soft joint settled that are far from equilibrium."""
    softest = min((_softest(law, chain.length_m / chain.n_joints) for law in chain.laws), default=math.inf)
    remarks = []
    for engine in engines:
        tolerance = engine.effort_tolerance()
        if tolerance is None or tolerance <= DOUBTFUL * softest:
            continue
        proposed = 10.0 ** math.floor(math.log10(WANTED * softest))
        remarks.append(
            f"{engine.config.kind} settles within an effort of {tolerance:g} N·m, and the softest joint has "
            f"{softest:.2g} N·m/rad at rest: it may be off by {tolerance / softest:.2g} rad. Write 'tolerance: "
            f"{proposed:g}' into the engine's block."
        )
    return tuple(remarks)


def _softest(law: JointLaw, module_length_m: float) -> float:
    """Return the least positive stiffness at rest, N·m/rad, or N per module length; infinite without one."""
    states = np.zeros((1, len(law.axes)))
    count = len(law.actuations)
    effort = law.evaluate(np.zeros(1) if count == 1 else np.zeros((1, count)), states)
    stiffness = -np.diagonal(effort.dtau_du[0])
    if law.joint in ("prismatic", "extensible"):
        stiffness = stiffness.copy()
        stiffness[-1] *= module_length_m  # N/m → N per module length
    positive = stiffness[stiffness > 0.0]
    return float(positive.min()) if positive.size else math.inf
