"""Compiled: law terms of effects at one joint coordinate, called by the addresses of their machine code."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

from pliant_plugins.physics.compiled.laws import TERM_SIGNATURE

_F, _A, _I = types.float64, types.float64[::1], types.int64


@intrinsic
def call_term(  # type: ignore[no-untyped-def]
    typing_context, address, u, rate, dt, net, t, old, old_at, new, new_at, states, c, c_at, numbers
):
    """Call the law term at an address with parts of three arrays as memory and parameters, not ref-counted."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        def part(array: Any, at: Any, count: Any) -> Any:
            whole, view = make_array(_A)(context, builder, array), make_array(_A)(context, builder)
            step = context.get_constant(types.intp, 8)
            start = builder.gep(whole.data, [at])
            populate_array(view, start, [count], [step], step, meminfo=None)
            return view._getvalue()

        address, u, rate, dt, net, t, old, old_at, new, new_at, states, c, c_at, numbers = arguments
        kinds = [context.get_value_type(kind) for kind in TERM_SIGNATURE.args]
        function = ir.FunctionType(context.get_value_type(_F), kinds)
        pointer = builder.inttoptr(address, function.as_pointer())
        parts = (part(old, old_at, states), part(new, new_at, states), part(c, c_at, numbers))
        return builder.call(pointer, [u, rate, dt, net, t, *parts])

    return _F(_I, _F, _F, _F, _F, _F, _A, _I, _A, _I, _I, _A, _I, _I), generate


@njit(cache=True, nogil=True, forceinline=True, error_model="numpy")
def combine(terms, joint, u, before, dt, net, t, old, old_at, new, new_at):  # type: ignore[no-untyped-def]
    """Return (Σ moment, Π elastic, Π actuation, Σ rest) of a joint's coordinate u; write its new memory.

    terms: addresses (m,), rows (m, 6) and parameters (n·P,) of `CompiledTerms`, and P.
    """
    addresses, rows, parameters, width = terms
    rate = (u - before) / dt if 0.0 < dt < np.inf else 0.0
    moment, elastic, actuation, rest = 0.0, 1.0, 1.0, 0.0
    for k in range(len(addresses)):
        o, w, states = old_at + rows[k, 3], new_at + rows[k, 3], rows[k, 4] - rows[k, 3]
        c = (parameters, width * joint + rows[k, 1], rows[k, 2] - rows[k, 1])
        value = call_term(addresses[k], u, rate, dt, net, t, old, o, new, w, states, *c)
        if rows[k, 0] == 0:
            moment += value
        elif rows[k, 0] == 1:
            elastic *= value
        elif rows[k, 0] == 2:
            actuation *= value
        else:
            rest += value
    return moment, elastic, actuation, rest


@njit(cache=True, nogil=True, forceinline=True, error_model="numpy")
def joint_net_input(signs, drives, i, p):  # type: ignore[no-untyped-def]
    """Return the sum of the signed inputs that act on joint i."""
    net = 0.0
    for k in range(drives[i, 0], drives[i, 1]):
        net += signs[k] * p[k]
    return net


@njit(cache=True, nogil=True, forceinline=True, error_model="numpy")
def has_past(terms):  # type: ignore[no-untyped-def]
    """Return whether any term depends on what was before the step."""
    count = 0
    for k in range(len(terms[0])):
        count += terms[1][k, 5]
    return count > 0
