"""Compiled: the effort of one joint, its tabulated law with the law terms of effects, and its slope.

Terms are machine code at addresses: one compiled loop serves all effects, those of plugins included.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

from pliant.mechanics.terms import STEP as SLOPE_STEP
from pliant_plugins.physics.compiled.functions import TERM_SIGNATURE

_F, _A, _I = types.float64, types.float64[::1], types.int64


@intrinsic
def call_term(  # type: ignore[no-untyped-def]
    typing_context, address, u, rate, dt, net, t, old, old_at, new, new_at, states, c, c_at, numbers
):
    """The law term at an address, given parts of three arrays as its memory and parameters.

    One compiled loop serves all terms, those of plugins included; the parts are built without counting references.
    """

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


@njit(cache=True, forceinline=True, error_model="numpy")
def law_at(cells, grid, size, law, p, u):  # type: ignore[no-untyped-def]
    """τ and ∂τ/∂u of a tabulated law: bicubic inside the table, straight on outside."""
    rows, columns = size[0], size[1]
    s, r = (p - grid[law, 0]) / grid[law, 1], (u - grid[law, 2]) / grid[law, 3]
    i = min(max(int(np.floor(s)), 0), rows - 1)
    j = min(max(int(np.floor(r)), 0), columns - 1)
    x, y = min(max(s - i, 0.0), 1.0), min(max(r - j, 0.0), 1.0)
    first = 16 * ((law * rows + i) * columns + j)
    value = in_p = in_u = 0.0
    for a in range(3, -1, -1):
        row = 0.0
        slope = 0.0
        for b in range(3, -1, -1):
            slope = slope * y + row
            row = row * y + cells[np.uintp(first + 4 * a + b)]
        in_p = in_p * x + value
        value = value * x + row
        in_u = in_u * x + slope
    value += in_p * (s - i - x) + in_u * (r - j - y)
    return value, in_u / grid[law, 3]


@njit(cache=True, forceinline=True, error_model="numpy")
def combine(model, joint, u, before, dt, net, t, old, old_at, new, new_at):  # type: ignore[no-untyped-def]
    """(Σ moment, Π elastic, Π actuation, Σ rest) of one joint at angle u; writes its new memory."""
    addresses, terms, numbers = model[0], model[1], model[2]
    rate = (u - before) / dt if 0.0 < dt < np.inf else 0.0
    moment, elastic, actuation, rest = 0.0, 1.0, 1.0, 0.0
    for k in range(len(addresses)):
        number, o, w = model[5][2] * joint + terms[k, 1], old_at + terms[k, 3], new_at + terms[k, 3]
        c = (numbers, number, terms[k, 2] - terms[k, 1])
        states = terms[k, 4] - terms[k, 3]
        value = call_term(addresses[k], u, rate, dt, net, t, old, o, new, w, states, *c)
        if terms[k, 0] == 0:
            moment += value
        elif terms[k, 0] == 1:
            elastic *= value
        elif terms[k, 0] == 2:
            actuation *= value
        else:
            rest += value
    return moment, elastic, actuation, rest


@njit(cache=True, forceinline=True, error_model="numpy")
def net_input(model, p):  # type: ignore[no-untyped-def]
    """The sum of signed inputs."""
    signs = model[6]
    net = 0.0
    for k in range(len(signs)):
        net += signs[k] * p[k]
    return net


@njit(cache=True, forceinline=True, error_model="numpy")
def effort(model, joint, law, u, before, dt, p, t, old, old_at, new, new_at):  # type: ignore[no-untyped-def]
    """τ' of one joint at angle u, and what `slope` needs of it; writes its new memory.

    Where all terms are moments the law is not split into its elastic and its actuation part.
    """
    cells, grid, size, signs, split = model[3], model[4], model[5], model[6], model[7]
    moment, elastic, actuation, rest = combine(
        model, joint, u, before, dt, net_input(model, p), t, old, old_at, new, new_at
    )
    spring = driven = spring_u = driven_u = 0.0
    for k in range(len(signs)):
        s = signs[k]
        own, own_u = law_at(cells, grid, size, law, p[k], s * u)
        if split:
            straight, straight_u = law_at(cells, grid, size, law, 0.0, s * u)
            driven += s * (own - straight)
            driven_u += s * s * (own_u - straight_u)
            own, own_u = straight, straight_u
            if rest != 0.0:
                own, own_u = law_at(cells, grid, size, law, 0.0, s * (u - rest))
        spring += s * own
        spring_u += s * s * own_u
    return moment + actuation * driven + elastic * spring, (
        spring,
        driven,
        elastic * spring_u,
        actuation * driven_u,
    )


@njit(cache=True, forceinline=True, error_model="numpy")
def slope(model, joint, u, before, dt, p, t, old, old_at, scratch, parts):  # type: ignore[no-untyped-def]
    """∂τ'/∂u of one joint: laws by the slopes of their tables, terms by central differences."""
    spring, driven, spring_u, driven_u = parts
    if not len(model[0]):
        return spring_u
    net, h = net_input(model, p), SLOPE_STEP
    m1, e1, a1, r1 = combine(model, joint, u + h, before, dt, net, t, old, old_at, scratch, 0)
    m0, e0, a0, r0 = combine(model, joint, u - h, before, dt, net, t, old, old_at, scratch, 0)
    of_terms = (m1 - m0) + (e1 - e0) * spring + (a1 - a0) * driven - spring_u * (r1 - r0)
    return of_terms / (2.0 * h) + spring_u + driven_u
