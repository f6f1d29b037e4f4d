"""The elements of a MuJoCo model at which effects act, by name: joints, tendons, bodies, the world.

An element without a name is called by its number: ``joint_3``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.records.design import Array

WORLD = "world"


def elements(model: Any, place: str) -> dict[str, int]:
    """Return the number of each element of a compiled model at which effects of this place act, by name.

    Joints are hinges and slides, bodies those that can move.
    """
    import mujoco

    if place == WORLD:
        return {WORLD: 0}
    kinds = {"joint": mujoco.mjtObj.mjOBJ_JOINT, "tendon": mujoco.mjtObj.mjOBJ_TENDON}
    kind = kinds.get(place, mujoco.mjtObj.mjOBJ_BODY)
    if place == "joint":
        single = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
        numbers = [k for k in range(model.njnt) if model.jnt_type[k] in single]
    elif place == "tendon":
        numbers = list(range(model.ntendon))
    else:
        numbers = [k for k in range(model.nbody) if model.body_weldid[k]]
    return {mujoco.mj_id2name(model, kind, k) or f"{place}_{k}": k for k in numbers}


@dataclass(frozen=True, eq=False)
class Joints:
    """Joints of one degree of freedom of a compiled model.

    Attributes:
        qpos, dofs: (n,) addresses of their positions and velocities.
        inertia: (n,) 1 / (n (M⁻¹)_ii) with the mass matrix M at the reference position, SI: forces c_i v_i with
            c_i ≤ inertia_i / Δt at all of them together are stable over a step Δt, for the largest eigenvalue of
            M⁻¹ scaled to ones on its diagonal is at most n.
        damping: (n,) damping of the model, SI.
        in_order: whether they are all coordinates of the model, in their order.
    """

    qpos: Array
    dofs: Array
    inertia: Array
    damping: Array
    in_order: bool

    @classmethod
    def of(cls, model: Any, numbers: list[int]) -> Joints:
        """Return the joints of these numbers."""
        dofs = model.jnt_dofadr[numbers]
        light = np.maximum(model.dof_invweight0[dofs], 1e-12)
        return cls(
            model.jnt_qposadr[numbers],
            dofs,
            1.0 / (light * len(numbers)),
            model.dof_damping[dofs].copy(),
            bool(np.array_equal(dofs, np.arange(model.nv))),
        )


def with_id(listed: Any, number: int) -> Any:
    """Return the element of a compiled specification that has this number in the model."""
    return next(one for one in listed if one.id == number)


def set_linear(element: Any, name: str, value: float) -> None:
    """Set an attribute of a specification's element: the linear one of a polynomial's coefficients, or the only one."""
    now = getattr(element, name)
    if np.ndim(now):
        now = np.array(now, float)
        now[0] = value
        setattr(element, name, now)
    else:
        setattr(element, name, float(value))


def added(now: float, more: float) -> float:
    """Return the sum, not below zero, nor below a number that was negative before."""
    return float(max(now + more, min(now, 0.0)))
