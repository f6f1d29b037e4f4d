"""Compiled: what keeps large loops quick to compile: many arrays behind one pointer, functions that stay functions.

A tuple of arrays is handed from function to function as ten numbers for each array, and the compiler copies functions
into all their callers, all of them where a caller has numba's `forceinline`, which what it calls inherits: a loop over
chains of any joints took minutes.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model


class HandleType(types.Type):
    """A pointer to a value of numba type `kind`."""

    def __init__(self, kind: types.Type) -> None:
        self.kind = kind
        super().__init__(name=f"Handle({kind})")


@register_model(HandleType)
class _HandleModel(models.PrimitiveModel):
    def __init__(self, manager: Any, handle: HandleType) -> None:
        super().__init__(manager, handle, cgutils.voidptr_t)


@intrinsic
def keep(typing_context, value):  # type: ignore[no-untyped-def]
    """Return a handle of a value, valid until the calling function returns or calls it here again.

    References are not counted: a tuple of arrays that are lent.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        (kind,) = signature.args
        place = cgutils.alloca_once(builder, context.get_data_type(kind))

        def store(kind: Any, whole: Any, at: Any) -> None:
            if isinstance(kind, types.BaseTuple):
                for k, one in enumerate(kind):
                    part = builder.extract_value(whole, k)
                    store(one, part, cgutils.gep_inbounds(builder, at, 0, k))
            else:
                builder.store(context.data_model_manager[kind].as_data(builder, whole), at)

        store(kind, arguments[0], place)
        return builder.bitcast(place, cgutils.voidptr_t)

    return HandleType(value)(value), generate


@intrinsic
def kept(typing_context, handle):  # type: ignore[no-untyped-def]
    """Return the value behind a handle."""
    if not isinstance(handle, HandleType):
        return None

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind = signature.return_type

        def load(kind: Any, at: Any) -> Any:
            if isinstance(kind, types.BaseTuple):
                parts = (load(one, cgutils.gep_inbounds(builder, at, 0, k)) for k, one in enumerate(kind))
                return context.make_tuple(builder, kind, list(parts))
            return context.data_model_manager[kind].from_data(builder, builder.load(at))

        return load(kind, builder.bitcast(arguments[0], context.get_data_type(kind).as_pointer()))

    return handle.kind(handle), generate


@intrinsic
def apart(typing_context):  # type: ignore[no-untyped-def]
    """Prevent the compiler from copying the calling function into its callers."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.function.attributes.add("noinline")
        return context.get_dummy_value()

    return types.void(), generate
