"""The free branch of a law, τ(p, u) = 0, against the free states of a design."""

from __future__ import annotations

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import TRUSTED, ModuleData
from pliant.records.law import JointLaw

STEPS = 12  # of the pressure between two free states
NEWTON = 30
# Of the law's own size, where Newton is done; and the longest step, in the same unit as u (rad, or shares of the box).
TOLERANCE = 1e-10
LONGEST = 0.25


def free_misses(law: JointLaw, data: ModuleData) -> tuple[Array, Array]:
    """Main deformation on the law's free branch minus that of the free trusted states with p > 0, and the latter.

    NaN where the law has no equilibrium on the branch that starts at rest.
    """
    main = data.axes.index(data.main_axis)
    rows = (data.branch == "free") & (data.actuation > 0) & np.isin(data.status, TRUSTED)
    rows &= data.explored == data.main_axis
    order = np.argsort(data.actuation[rows], kind="stable")
    p, u = data.actuation[rows][order], data.deformation[rows][order]
    return free_branch(law, p)[:, main] - u[:, main], u[:, main]


def free_branch(law: JointLaw, actuation: Array) -> Array:
    """(n, a) equilibria without load at ascending actuations (n,), followed from rest; NaN from where there is none."""
    found = np.full((len(actuation), len(law.axes)), np.nan)
    u, before = np.zeros(len(law.axes)), 0.0
    reach = LONGEST * np.ptp(law.domain.deformation, axis=1)
    for index, target in enumerate(np.asarray(actuation, float)):
        for p in np.linspace(before, target, STEPS + 1)[1:]:
            reached = _newton(law, float(p), u, reach)
            if reached is None:
                return found
            u = reached
        found[index], before = u, float(target)
    return found


def _newton(law: JointLaw, p: float, start: Array, reach: Array) -> Array | None:
    """The stable equilibrium near `start`, or None."""
    u, at = start.copy(), np.array([p])
    for _ in range(NEWTON):
        effort = law.evaluate(at, u[None])
        slope = effort.dtau_du[0]
        try:
            step = np.linalg.solve(slope, effort.tau[0])
        except np.linalg.LinAlgError:
            return None
        if not np.all(np.isfinite(step)):
            return None
        u = u - step / max(1.0, float(np.max(np.abs(step) / reach)))
        if np.all(np.abs(step) <= TOLERANCE * reach):
            stable = np.linalg.eigvalsh(-(slope + slope.T) / 2)[0] > 0
            return u if stable else None
    return None
