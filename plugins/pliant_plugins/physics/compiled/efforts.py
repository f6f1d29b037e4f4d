"""Compiled: efforts of all joints, τ(q) = Σ_k s_k · law(p_k, s_k q); see `pliant.mechanics.efforts`."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from pliant_plugins.physics.compiled.laws import LAW_SIGNATURE

# Gauss–Legendre on [0, 1] for the work of τ along the straight path from 0, as `JointLaw.potential` has it.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
NODES, WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS


@intrinsic
def call_law(typing_context, address, p, u, c, tau, dtau_dp, dtau_du):  # type: ignore[no-untyped-def]
    """Calls the law function at an address: so one compiled loop serves all laws, those of plugins included."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kinds = [context.get_value_type(kind) for kind in LAW_SIGNATURE.args]
        function = ir.FunctionType(context.get_value_type(types.void), kinds)
        pointer = builder.inttoptr(arguments[0], function.as_pointer())
        builder.call(pointer, arguments[1:])
        return context.get_dummy_value()

    return types.void(types.int64, *LAW_SIGNATURE.args), generate


@njit(cache=True, nogil=True)
def efforts(laws, q, p, tau, dtau_dp, dtau_du):  # type: ignore[no-untyped-def]
    """Fills tau (n, a), dtau_dp (k, n, a) by actuator and dtau_du (n, a, a).

    Args:
        laws: `CompiledLaws.arrays`.
        q: (n, a) joint coordinates.
        p: (k,) value of each actuator.
    """
    addresses, spans, parameters, signs = laws
    n, a = q.shape
    u, value, in_p, in_u = np.empty(a), np.empty(a), np.empty(a), np.empty((a, a))
    for i in range(n):
        c = parameters[spans[i, 0] : spans[i, 1]]
        for b in range(a):
            tau[i, b] = 0.0
            for d in range(a):
                dtau_du[i, b, d] = 0.0
        for k in range(len(signs)):
            s = signs[k]
            for b in range(a):
                u[b] = s * q[i, b]
            call_law(addresses[i], p[k], u, c, value, in_p, in_u)
            for b in range(a):
                tau[i, b] += s * value[b]
                dtau_dp[k, i, b] = s * in_p[b]
                for d in range(a):
                    dtau_du[i, b, d] += s * s * in_u[b, d]


@njit(cache=True, nogil=True)
def evaluate_law(address, parameters, p, u, tau, dtau_dp, dtau_du):  # type: ignore[no-untyped-def]
    """Fills tau (m, a), dtau_dp (m, a) and dtau_du (m, a, a) of one law in m states p (m,), u (m, a)."""
    for row in range(len(p)):
        call_law(address, p[row], u[row], parameters, tau[row], dtau_dp[row], dtau_du[row])


@njit(cache=True, nogil=True)
def law_potential(laws, q, p):  # type: ignore[no-untyped-def]
    """Σ Π(p, s q) − Π(p, 0) over joints and actuators in J, by 12-point Gauss–Legendre."""
    addresses, spans, parameters, signs = laws
    n, a = q.shape
    u, value, in_p, in_u = np.empty(a), np.empty(a), np.empty(a), np.empty((a, a))
    work = 0.0
    for i in range(n):
        c = parameters[spans[i, 0] : spans[i, 1]]
        for k in range(len(signs)):
            s = signs[k]
            for g in range(len(NODES)):
                for b in range(a):
                    u[b] = NODES[g] * s * q[i, b]
                call_law(addresses[i], p[k], u, c, value, in_p, in_u)
                for b in range(a):
                    work += WEIGHTS[g] * value[b] * s * q[i, b]
    return -work
