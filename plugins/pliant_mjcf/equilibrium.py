"""The nearest stable equilibrium of a model without contacts and dry friction, by Newton's method."""

from __future__ import annotations

from typing import Any, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array

MOST_ITERATIONS, MOST_HALVINGS = 40, 8
PROBE = 1e-6  # displacement for the stiffness, rad or m
LONGEST_STEP = 0.3  # of any coordinate, rad or m
FREE = 1e-7  # change of a force over a radian or metre, as a share of it, below which nothing balances it
LIMITS = (int(mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT), int(mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON))

Outcome = Literal["rest", "no rest", "unknown"]


def settle(model: Any, data: Any, tolerance: float) -> Outcome:
    """Move data at rest to an equilibrium; "no rest" if an unlimited coordinate has a force that nothing balances.

    Every iterate must have a positive definite stiffness, so that the equilibrium is stable and in the basin of the
    beginning. The position is undefined after "unknown": contacts or dry friction act, or the method fails.

    Args:
        model: the compiled model.
        data: its state without velocity, with inputs and activations that are held.
        tolerance: largest acceleration at rest, relative to the largest at the beginning and at least to 1.
    """
    if model.dof_frictionloss.any() or model.tendon_frictionloss.any():
        return "unknown"
    force = _force(model, data)
    limit = tolerance * max(float(np.abs(data.qacc).max()), 1.0)
    for _ in range(MOST_ITERATIONS):
        if force is None:
            return "unknown"
        if float(np.abs(data.qacc).max()) < limit:
            held = not len(data.act_dot) or bool(np.abs(data.act_dot).max() < 1e-6)
            return "rest" if held else "unknown"
        stiffness = _stiffness(model, data, force)
        if stiffness is None:
            return "unknown"
        unbalanced = (np.abs(stiffness).max(axis=1) < FREE * np.abs(force)) & (np.abs(data.qacc) > limit)
        if np.any(unbalanced & ~_limited(model)):
            return "no rest"
        if np.linalg.eigvalsh(0.5 * (stiffness + stiffness.T))[0] <= 0.0:
            return "unknown"
        step = np.asarray(np.linalg.solve(stiffness, force), float)
        force = _advanced(model, data, force, step)
    return "unknown"


def _advanced(model: Any, data: Any, force: Array, step: Array) -> Array | None:
    """Move data along the step as far as the force decreases, and return the force there; None where it does not."""
    here, part = data.qpos.copy(), LONGEST_STEP / max(float(np.abs(step).max()), LONGEST_STEP)
    for _ in range(MOST_HALVINGS):
        mujoco.mj_integratePos(model, data.qpos, part * step, 1.0)
        there = _force(model, data)
        if there is not None and np.linalg.norm(there) < np.linalg.norm(force):
            return there
        data.qpos[:] = here
        part *= 0.5
    return None


def _stiffness(model: Any, data: Any, force: Array) -> Array | None:
    """Return (nv, nv) the decrease of the force per displacement; None where a contact or a warning comes up."""
    here, stiffness, step = data.qpos.copy(), np.empty((model.nv, model.nv)), np.zeros(model.nv)
    for k in range(model.nv):
        step[:] = 0.0
        step[k] = PROBE
        mujoco.mj_integratePos(model, data.qpos, step, 1.0)
        moved = _force(model, data)
        data.qpos[:] = here
        if moved is None:
            return None
        stiffness[:, k] = (force - moved) / PROBE
    _force(model, data)
    return stiffness


def _force(model: Any, data: Any) -> Array | None:
    """Return the generalised force (nv,), of limits too; None where other constraints act or MuJoCo warns."""
    mujoco.mj_forward(model, data)
    if data.warning.number.any() or not np.isin(data.efc_type, LIMITS).all():
        return None
    total: Array = data.qfrc_smooth + data.qfrc_constraint
    return total


def _limited(model: Any) -> NDArray[np.bool_]:
    """Return (nv,) whether the joint of a coordinate has a range."""
    limited: NDArray[np.bool_] = np.asarray(model.jnt_limited, bool)[model.dof_jntid]
    return limited
