"""Comparison of a law's scalar form with the law, before the first use by an engine or in a check."""

from __future__ import annotations

import numpy as np

from pliant.errors import ContractError
from pliant.records.design import Array
from pliant.records.law import Effort, JointLaw, ScalarLaw, travels

STATES, SEED = 12, 5
OUTSIDE = 0.1  # share of the domain's width by which states may be outside, as engines visit them
# Limits for a domain without limits: Pa or N, rad, m.
FREE_ACTUATION, FREE_ANGLE, FREE_TRAVEL = 1e4, 0.3, 1e-3
ALLOWED = 1e-6  # of the largest value: rounding by a different order of operations
_checked: set[tuple[type, object]] = set()


def require_scalar_form(law: JointLaw, again: bool = False) -> None:
    """Raise `ContractError` if `law.scalar()` differs from `law.evaluate` at random states of the law's domain.

    Laws of one class and function are compared once per process, unless `again`. A law without a scalar form passes.
    """
    scalar = law.scalar()
    key = type(law), scalar.function if scalar is not None else None
    if scalar is None or (key in _checked and not again):
        return
    p, u = _states(law)
    exact, got = law.evaluate(p, u), evaluate_scalar(scalar, p, u)
    for name in ("tau", "dtau_dp", "dtau_du"):
        a, b = getattr(got, name), np.asarray(getattr(exact, name), float)
        b = b.reshape(a.shape)
        apart = np.abs(a - b)
        if not np.all(apart <= ALLOWED * max(float(np.abs(b).max()), 1e-300)):
            raise ContractError(_sentence(law, name, a, b, p, u))
    _checked.add(key)


def evaluate_scalar(scalar: ScalarLaw, p: Array, u: Array) -> Effort:
    """Evaluate a scalar form in plain Python at p (n,) or (n, m) and u (n, a); shapes as in `JointLaw.evaluate`."""
    effort = _filled(scalar, p, u)
    if not scalar.less_rest:
        return effort
    rest = _filled(scalar, np.zeros_like(p), u)
    r = scalar.less_rest
    return Effort(effort.tau - r * rest.tau, effort.dtau_dp, effort.dtau_du - r * rest.dtau_du)


def _filled(scalar: ScalarLaw, p: Array, u: Array) -> Effort:
    n, a = u.shape
    m = 1 if p.ndim == 1 else p.shape[1]
    tau, by_p, by_u = np.zeros((n, a)), np.zeros((n, a * m)), np.zeros((n, a, a))
    parameters = np.asarray(scalar.parameters, float)
    for k in range(n):
        actuation = float(p[k]) if p.ndim == 1 else p[k].copy()
        scalar.function(actuation, u[k].copy(), parameters, tau[k], by_p[k], by_u[k])
    return Effort(tau, by_p if p.ndim == 1 else by_p.reshape(n, a, m), by_u)


def _states(law: JointLaw) -> tuple[Array, Array]:
    """Return random states of the domain and slightly outside it."""
    m, a = len(law.actuations), len(law.axes)
    reach = np.full(a, FREE_ANGLE)
    reach[list(travels(law.joint, law.axes))] = FREE_TRAVEL
    free = np.vstack([[[0.0, FREE_ACTUATION]] * m, np.column_stack([-reach, reach])])
    box = np.where(np.isfinite(law.domain.box), law.domain.box, free)
    middle, half = box.mean(axis=1), (0.5 + OUTSIDE) * np.ptp(box, axis=1)
    values = middle + half * np.random.default_rng(SEED).uniform(-1.0, 1.0, (STATES, m + a))
    p = values[:, 0] if m == 1 else values[:, :m]
    return np.ascontiguousarray(p), np.ascontiguousarray(values[:, m:])


def _sentence(law: JointLaw, name: str, got: Array, exact: Array, p: Array, u: Array) -> str:
    """Return the message on the state at which the forms differ most."""
    apart = np.nan_to_num(np.abs(got - exact), nan=np.inf)
    at = np.unravel_index(int(apart.argmax()), apart.shape)
    k = at[0]
    scale = float(np.abs(exact).max())
    share = f", {100 * apart[at] / scale:.2g} % of the largest" if scale else ""
    state = f"{law.actuation_name} = {_text(p[k])}, u = {_text(u[k])}"
    return (
        f"the scalar form of law {type(law).__module__}.{type(law).__name__} is not the law: {name} is {got[at]:.6g} "
        f"by 'scalar' and {exact[at]:.6g} by 'evaluate'{share}, at {state}. Engines would simulate another law; mend "
        "'scalar', or return None there."
    )


def _text(values: Array) -> str:
    return ", ".join(f"{value:.4g}" for value in np.atleast_1d(values))
