"""What every joint law must hold: shared by the checks of surrogates, of meta-models and of effects that wrap laws."""

from __future__ import annotations

import io
import json
from typing import TypeVar

import numpy as np

from pliant.records.design import Array
from pliant.records.law import JointLaw
from pliant.store.codec import decode, encode
from pliant.testing import agree, require

T = TypeVar("T")
EFFORTS = ("tau", "dtau_dp", "dtau_du")


def stored(value: T) -> T:
    """The value as the store writes and reads it: JSON and arrays without pickle. Raises where it is no data."""
    arrays: dict[str, np.ndarray] = {}
    text = json.dumps(encode(value, arrays), allow_nan=False)
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    file.seek(0)
    with np.load(file, allow_pickle=False) as read:
        again: T = decode(json.loads(text), dict(read))
    return again


def require_exact_slopes(law: JointLaw, p: Array, u: Array, rtol: float, whose: str = "") -> None:
    """∂τ/∂p and ∂τ/∂u are those of central differences, with shapes (n, a) and (n, a, a); (n, a, m) of m pressures."""
    effort = law.evaluate(p, u)
    n, a = u.shape
    shapes = [getattr(effort, name).shape for name in EFFORTS]
    wanted = [(n, a), (n, a, *p.shape[1:]), (n, a, a)]
    require(shapes == wanted, f"tau, dtau_dp and dtau_du{whose} have shapes {shapes}")
    steps = np.eye(p.shape[1]) if p.ndim > 1 else np.ones(1)
    in_p = np.stack([(law.evaluate(p + d, u).tau - law.evaluate(p - d, u).tau) / 2 for d in steps], axis=-1)
    by_p = effort.dtau_dp.reshape(in_p.shape)
    agree(by_p, in_p, f"dtau_dp{whose} is not the slope of tau", rtol=rtol)
    for j, step in enumerate(1e-5 * np.eye(a)):
        in_u = (law.evaluate(p, u + step).tau - law.evaluate(p, u - step).tau) / 2e-5
        agree(effort.dtau_du[:, :, j], in_u, f"dtau_du{whose} is not the slope of tau", rtol=rtol)


def require_potential(law: JointLaw, p: Array, u: Array, rtol: float, whose: str = "") -> None:
    """τ = −∂Π/∂u by central differences of the law's potential."""
    tau = law.evaluate(p, u).tau
    for j, step in enumerate(1e-4 * np.eye(u.shape[1])):
        slope = -(law.potential(p, u + step) - law.potential(p, u - step)) / 2e-4
        agree(slope, tau[:, j], f"τ{whose} is not −∂Π/∂u: scale the potential too", rtol=rtol)


def require_joints_apart(law: JointLaw, p: Array, u: Array) -> None:
    """Joints evaluated together or one by one give the same."""
    together = law.evaluate(p, u)
    alone = [law.evaluate(p[i : i + 1], u[i : i + 1]) for i in range(len(p))]
    for name in EFFORTS:
        one_by_one = np.concatenate([getattr(effort, name) for effort in alone])
        finding = f"{name} depends on which other joints are evaluated"
        agree(getattr(together, name), one_by_one, finding, rtol=1e-9)


def require_finite_outside(law: JointLaw) -> None:
    """A law of one axis answers outside its domain with finite numbers, and flags the excess."""
    p, u = np.array([0.0, 3e4, -5e3, 3e4]), np.array([[1.5], [0.2], [-1.2], [1.5]])
    if (m := len(law.actuations)) > 1:
        p = np.column_stack([p, *[np.zeros(len(p))] * (m - 1)])
    effort = law.evaluate(p, u)
    finite = all(np.all(np.isfinite(getattr(effort, name))) for name in EFFORTS)
    require(
        finite, "τ or a slope is not finite outside the domain: engines pass through such points on their way"
    )
    require(np.all(np.any(law.domain.excess(p, u) != 0, axis=1)), "points outside the domain are not flagged")


def require_same_bits(law: JointLaw, again: JointLaw, p: Array, u: Array) -> None:
    """A law that was read back evaluates to the same bits and has the same joint, axes, input and domain."""
    one, two = law.evaluate(p, u), again.evaluate(p, u)
    for name in EFFORTS:
        same = np.array_equal(getattr(one, name), getattr(two, name))
        require(same, f"{name} of the loaded law differs: the record rounds a number or leaves one out")
    for name in ("joint", "axes", "actuation_name"):
        require(getattr(again, name) == getattr(law, name), f"{name} is lost in the record")
    for name in ("actuation", "deformation"):
        same = np.array_equal(getattr(again.domain, name), getattr(law.domain, name))
        require(same, f"the domain of the {name} is lost in the record")
