"""Hidden changes of a model's numbers, by other equations than the plugins'.

An equation changes a compiled model at one body (0 for the world) by its strength s, its numbers x and its shape; one
that changes with time returns the function that does.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from benchmarks.systems.shapes import TINY, Array, Numbers


def heavier(model: Any, body: int, s: float, x: Numbers, shape: Any) -> None:
    """Change the mass, with the inertia to a power, and take a share of it from the body before."""
    before = int(model.body_parentid[body])
    taken = x.get("taken", 0.0) * s * model.body_mass[body]
    if model.body_mass[before] > 2.0 * abs(taken):
        model.body_mass[before] -= taken
    model.body_mass[body] *= 1.0 + s
    model.body_inertia[body] *= (1.0 + s) ** x["p"]


def beside(model: Any, body: int, s: float, x: Numbers, shape: Any) -> None:
    """Move the centre of mass by a share of the body's size, and change the mass or the inertia a little."""
    way = np.array([x["x"], x["y"], x["z"]])
    model.body_ipos[body] += s * size_m(model, body) * way / np.linalg.norm(way)
    model.body_mass[body] *= 1.0 + x.get("mass", 0.0) * s
    model.body_inertia[body] *= 1.0 + x.get("inertia", 0.0) * s


def turning(model: Any, body: int, s: float, x: Numbers, shape: Any) -> None:
    """Change the three inertias unequally."""
    model.body_inertia[body] *= 1.0 + s * (1.0 + x["a"] * np.asarray(shape))
    model.body_mass[body] *= 1.0 + x.get("mass", 0.0) * s


def loaded(model: Any, body: int, s: float, x: Numbers, shape: Any) -> None:
    """Add a ball or a point beside the origin of the body's frame, by its parallel axes."""
    mass, more = float(model.body_mass[body]), s * float(model.body_mass[body])
    point = x["away"] * size_m(model, body) * np.array([x["x"], x["y"], x["z"]])
    centre = model.body_ipos[body].copy()
    new = (mass * centre + more * point) / (mass + more)
    model.body_inertia[body] += (
        mass * np.sum((centre - new) ** 2) + more * np.sum((point - new) ** 2) + 0.4 * more * x["ball"] ** 2
    )
    model.body_mass[body], model.body_ipos[body] = mass + more, new


def draining(model: Any, body: int, s: float, x: Numbers, shape: Any) -> Callable[[float], None]:
    """Return what changes a body's mass with time: it empties, or what it holds moves."""
    mass = float(model.body_mass[body])

    def change(time_s: float) -> None:
        swing = np.sin(2.0 * np.pi * x["hz"] * time_s) if "hz" in x else np.exp(-max(time_s, 0.0) / x["T"])
        model.body_mass[body] = mass * (1.0 + s * swing)

    return change


def size_m(model: Any, body: int) -> float:
    """Return the radius of gyration of a body."""
    return float(np.sqrt(0.5 * model.body_inertia[body].sum() / max(model.body_mass[body], TINY)))


def far(along: Array) -> Array:
    return along


def near(along: Array) -> Array:
    return 1.0 - along * along


def lighter(model: Any, body: int, s: float, x: Numbers, shape: Callable[[Array], Array]) -> None:
    """Scale the weights of bodies unequally: a larger gravity, and forces that carry a part of each."""
    factors = 1.0 + s * (1.0 + x["a"] * shape(np.linspace(0.0, 1.0, model.nbody - 1)))
    model.opt.gravity[:] *= factors.max()
    model.body_gravcomp[1:] = 1.0 - factors / factors.max()


def tilted(model: Any, body: int, s: float, x: Numbers, shape: Any) -> None:
    """Tilt gravity and change its size a little."""
    down = model.opt.gravity.copy()
    side = np.array([np.cos(x["way"]), np.sin(x["way"]), 0.0])
    model.opt.gravity[:] = down * (np.cos(s) + x["a"] * s) + np.linalg.norm(down) * np.sin(s) * side


def mounted(model: Any, body: int, s: float, x: Numbers, shape: Any) -> None:
    """Turn what hangs on the world about an axis near the horizontal, and shift it along the turn."""
    axis = np.array([np.cos(x["way"]), np.sin(x["way"]), x["third"]])
    turn, matrix, quat = np.empty(4), np.empty(9), np.empty(4)
    mujoco.mju_axisAngle2Quat(turn, axis / np.linalg.norm(axis), s)
    mujoco.mju_quat2Mat(matrix, turn)
    for k in np.flatnonzero(model.body_parentid[1:] == 0) + 1:
        lever = model.body_pos[k] + np.array([0.0, 0.0, x["lever_m"]])
        model.body_pos[k] = matrix.reshape(3, 3) @ lever - np.array([0.0, 0.0, x["lever_m"]])
        mujoco.mju_mulQuat(quat, turn, model.body_quat[k])
        model.body_quat[k] = quat
