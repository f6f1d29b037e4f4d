"""Requirements on every joint law, for the checks of surrogates, meta-models and effects that wrap laws."""

from __future__ import annotations

import io
import json
from typing import TypeVar

import numpy as np

from pliant.errors import ContractError
from pliant.mechanics.scalar_form import require_scalar_form
from pliant.records.design import Array
from pliant.records.law import JointLaw
from pliant.store.codec import decode, encode
from pliant.testing import Finding, agree, require

T = TypeVar("T")
EFFORTS = ("tau", "dtau_dp", "dtau_du")


def stored(value: T) -> T:
    """Return the value after a round trip through the store's formats, JSON and arrays; raise if impossible."""
    arrays: dict[str, np.ndarray] = {}
    text = json.dumps(encode(value, arrays), allow_nan=False)
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    file.seek(0)
    with np.load(file, allow_pickle=False) as read:
        again: T = decode(json.loads(text), dict(read))
    return again


def require_exact_slopes(law: JointLaw, p: Array, u: Array, rtol: float, whose: str = "") -> None:
    """Check ∂τ/∂p (n, a), or (n, a, m) for m pressures, and ∂τ/∂u (n, a, a) by central differences."""
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
    """Check τ = −∂Π/∂u by central differences of the law's potential."""
    tau = law.evaluate(p, u).tau
    for j, step in enumerate(1e-4 * np.eye(u.shape[1])):
        slope = -(law.potential(p, u + step) - law.potential(p, u - step)) / 2e-4
        agree(slope, tau[:, j], f"τ{whose} is not −∂Π/∂u: scale the potential too", rtol=rtol)


def require_joints_apart(law: JointLaw, p: Array, u: Array) -> None:
    """Check that joints evaluated together or one by one give the same."""
    together = law.evaluate(p, u)
    alone = [law.evaluate(p[i : i + 1], u[i : i + 1]) for i in range(len(p))]
    for name in EFFORTS:
        one_by_one = np.concatenate([getattr(effort, name) for effort in alone])
        finding = f"{name} depends on which other joints are evaluated"
        agree(getattr(together, name), one_by_one, finding, rtol=1e-9)


def require_same_compiled(law: JointLaw) -> None:
    """Check that the scalar form that engines compile, if there is one, equals the law in values and slopes."""
    try:
        require_scalar_form(law, again=True)
    except ContractError as error:
        raise Finding(str(error)) from None


def require_finite_outside(law: JointLaw) -> None:
    """Check that a law of one axis is finite outside its domain, and reports the excess."""
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
    """Check that a loaded law evaluates to the same bits and has the same joint, axes, input and domain."""
    one, two = law.evaluate(p, u), again.evaluate(p, u)
    for name in EFFORTS:
        same = np.array_equal(getattr(one, name), getattr(two, name))
        require(same, f"{name} of the loaded law differs: the record rounds a number or leaves one out")
    for name in ("joint", "axes", "actuation_name"):
        require(getattr(again, name) == getattr(law, name), f"{name} is lost in the record")
    for name in ("actuation", "deformation"):
        same = np.array_equal(getattr(again.domain, name), getattr(law.domain, name))
        require(same, f"the domain of the {name} is lost in the record")
