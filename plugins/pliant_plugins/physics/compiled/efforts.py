"""Compiled: efforts of all joints, τ(q) = Σ_k s_k · law(p_k, s_k q), or law(a, q); see `pliant.mechanics.efforts`."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from pliant_plugins.physics.compiled.laws import LAW_SIGNATURE, WIDE_SIGNATURE

# Gauss–Legendre on [0, 1] for the work of τ along the straight path from 0, as `JointLaw.potential` has it.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
NODES, WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS


def _caller(of: Any) -> Any:
    """Return an intrinsic that calls a function of a signature by its address, the first argument."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kinds = [context.get_value_type(kind) for kind in of.args]
        function = ir.FunctionType(context.get_value_type(types.void), kinds)
        pointer = builder.inttoptr(arguments[0], function.as_pointer())
        builder.call(pointer, arguments[1:])
        return context.get_dummy_value()

    return generate


@intrinsic
def call_law(typing_context, address, p, u, c, tau, dtau_dp, dtau_du):  # type: ignore[no-untyped-def]
    """Call the law function at an address, so that one compiled loop serves all laws, those of plugins included."""

    return types.void(types.int64, *LAW_SIGNATURE.args), _caller(LAW_SIGNATURE)


@intrinsic
def call_wide_law(typing_context, address, p, u, c, tau, dtau_dp, dtau_du):  # type: ignore[no-untyped-def]
    """Call a law of several actuations p (m,) as `call_law`; it fills dtau_dp (a·m,)."""
    return types.void(types.int64, *WIDE_SIGNATURE.args), _caller(WIDE_SIGNATURE)


@njit(cache=True, nogil=True)
def efforts(laws, q, p, tau, dtau_dp, dtau_du):  # type: ignore[no-untyped-def]
    """Fill tau (n, a), dtau_dp (k, n, a) by actuator and dtau_du (n, a, a).

    Args:
        laws: `CompiledLaws.arrays`.
        q: (n, a) joint coordinates.
        p: (k,) value of each actuator.
    """
    addresses, spans, parameters, signs, drives, less = laws
    n, a = q.shape
    u, value, in_p, in_u = np.empty(a), np.empty(a), np.empty(a * len(signs)), np.empty((a, a))
    for i in range(n):
        c = parameters[spans[i, 0] : spans[i, 1]]
        first, last, m = drives[i, 0], drives[i, 1], drives[i, 2]
        if last - first < len(signs):
            dtau_dp[:, i] = 0.0
        for b in range(a):
            tau[i, b] = 0.0
            for d in range(a):
                dtau_du[i, b, d] = 0.0
        if m > 1:
            for b in range(a):
                u[b] = q[i, b]
            call_wide_law(addresses[i], p[first:last], u, c, value, in_p, in_u)
            for b in range(a):
                tau[i, b] = value[b]
                for k in range(m):
                    dtau_dp[first + k, i, b] = in_p[b * m + k]
                for d in range(a):
                    dtau_du[i, b, d] = in_u[b, d]
            continue
        for k in range(first, last):
            s = signs[k]
            for b in range(a):
                u[b] = s * q[i, b]
            call_law(addresses[i], p[k], u, c, value, in_p, in_u)
            for b in range(a):
                tau[i, b] += s * value[b]
                dtau_dp[k, i, b] = s * in_p[b]
                for d in range(a):
                    dtau_du[i, b, d] += s * s * in_u[b, d]
            if less[i] != 0.0:
                call_law(addresses[i], 0.0, u, c, value, in_p, in_u)
                for b in range(a):
                    tau[i, b] -= less[i] * s * value[b]
                    for d in range(a):
                        dtau_du[i, b, d] -= less[i] * s * s * in_u[b, d]


@njit(cache=True, nogil=True)
def evaluate_law(address, parameters, p, u, tau, dtau_dp, dtau_du):  # type: ignore[no-untyped-def]
    """Fill tau (m, a), dtau_dp (m, a) and dtau_du (m, a, a) of one law in m states p (m,), u (m, a)."""
    for row in range(len(p)):
        call_law(address, p[row], u[row], parameters, tau[row], dtau_dp[row], dtau_du[row])


@njit(cache=True, nogil=True)
def evaluate_wide_law(address, parameters, p, u, tau, dtau_dp, dtau_du):  # type: ignore[no-untyped-def]
    """Evaluate a law of k actuations as `evaluate_law`: p (m, k), dtau_dp (m, a, k)."""
    m, a = u.shape
    row = np.empty(a * p.shape[1])
    for i in range(m):
        call_wide_law(address, p[i], u[i], parameters, tau[i], row, dtau_du[i])
        for b in range(a):
            for k in range(p.shape[1]):
                dtau_dp[i, b, k] = row[b * p.shape[1] + k]


@njit(cache=True, nogil=True)
def law_potential(laws, q, p):  # type: ignore[no-untyped-def]
    """Return Σ Π(p, s q) − Π(p, 0) over joints and actuators in J, by 12-point Gauss–Legendre."""
    addresses, spans, parameters, signs, drives, less = laws
    n, a = q.shape
    u, value, in_p, in_u = np.empty(a), np.empty(a), np.empty(a * len(signs)), np.empty((a, a))
    work = 0.0
    for i in range(n):
        c = parameters[spans[i, 0] : spans[i, 1]]
        first, last, m = drives[i, 0], drives[i, 1], drives[i, 2]
        if m > 1:
            for g in range(len(NODES)):
                for b in range(a):
                    u[b] = NODES[g] * q[i, b]
                call_wide_law(addresses[i], p[first:last], u, c, value, in_p, in_u)
                for b in range(a):
                    work += WEIGHTS[g] * value[b] * q[i, b]
            continue
        for k in range(first, last):
            s = signs[k]
            for g in range(len(NODES)):
                for b in range(a):
                    u[b] = NODES[g] * s * q[i, b]
                call_law(addresses[i], p[k], u, c, value, in_p, in_u)
                for b in range(a):
                    work += WEIGHTS[g] * value[b] * s * q[i, b]
                if less[i] != 0.0:
                    call_law(addresses[i], 0.0, u, c, value, in_p, in_u)
                    for b in range(a):
                        work -= less[i] * WEIGHTS[g] * value[b] * s * q[i, b]
    return -work
