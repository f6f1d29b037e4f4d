"""Compiled: arrays copied and lent, with little to compile.

Arrays are copied in loops: an assignment of slices makes numba compile its message about shapes that do not fit, and
again in every function that leads to it; that was two thirds of the time that the loops took to compile.
"""

from __future__ import annotations

from typing import Any

from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array


@njit(cache=True, forceinline=True, error_model="numpy")
def copy(source, target):  # type: ignore[no-untyped-def]
    """Fill target (n,)."""
    for i in range(len(source)):
        target[i] = source[i]


@njit(cache=True, forceinline=True, error_model="numpy")
def copy_rows(source, target):  # type: ignore[no-untyped-def]
    """Fill target (n, m)."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@intrinsic
def lent(typing_context, value):  # type: ignore[no-untyped-def]
    """Return the arrays, in a tuple of tuples, without reference counting; their owners must stay alive."""

    def lend(context: Any, builder: Any, kind: Any, whole: Any) -> Any:
        if isinstance(kind, types.BaseTuple):
            parts = zip(kind, cgutils.unpack_tuple(builder, whole, len(kind)), strict=True)
            return context.make_tuple(builder, kind, [lend(context, builder, *part) for part in parts])
        if not isinstance(kind, types.Array):
            return whole
        source, view = make_array(kind)(context, builder, whole), make_array(kind)(context, builder)
        shape = cgutils.unpack_tuple(builder, source.shape)
        strides = cgutils.unpack_tuple(builder, source.strides)
        populate_array(view, source.data, shape, strides, source.itemsize, meminfo=None)
        return view._getvalue()

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return lend(context, builder, signature.args[0], arguments[0])

    return value(value), generate
