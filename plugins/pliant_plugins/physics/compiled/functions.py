"""Plain scalar Python functions of plugins as compiled function pointers."""

from __future__ import annotations

import re
from types import FunctionType
from typing import Any

from numba import cfunc
from numba.extending import register_jitable

from pliant.errors import UserError


def compile_function(function: Any, signature: Any, what: str) -> Any:
    """A `numba.cfunc` of a scalar function and of the functions of its own file that it calls.

    It is kept on disk where the function stands at the top of a file.

    Raises:
        UserError: it cannot be compiled; `what` names it in the sentence ("law term").
    """
    try:
        for helper in _helpers(function):
            register_jitable(helper)
        return cfunc(signature, cache=_on_disk(function), error_model="numpy")(function)
    except Exception as error:  # numba lets Python's own errors through beside its own
        raise UserError(_why_not(function, error, what)) from error


def _helpers(function: FunctionType) -> list[FunctionType]:
    """Functions of its own file that a function calls, and those that they call."""
    found: list[FunctionType] = []
    queue: list[Any] = [function]
    while queue:
        caller = queue.pop()
        for name in caller.__code__.co_names:
            helper = caller.__globals__.get(name)
            ours = isinstance(helper, FunctionType) and helper.__module__ == function.__module__
            if ours and helper is not function and helper not in found:
                found.append(helper)
                queue.append(helper)
    return found


def _why_not(function: Any, error: Exception, what: str) -> str:
    """Where and why a function cannot be compiled."""
    code = getattr(function, "__code__", None)
    if code is None:
        return f"the {what} {function!r} is no plain function; write one with 'def' at the top of its file"
    text = [line.strip() for line in str(error).splitlines() if line.strip()]
    reason = next((line for line in text if not line.startswith("Failed in")), type(error).__name__)
    lines = re.findall(r'File "[^"]*", line (\d+)', str(error)) or [code.co_firstlineno]
    return (
        f"{code.co_filename}, line {lines[0]}: the {what} '{function.__name__}' cannot be compiled "
        f"({reason.rstrip('.:')}); it is scalar Python: arithmetic, 'if' and functions of math."
    )


def _on_disk(function: Any) -> bool:
    """Whether numba can cache it: functions made inside others have no stable name."""
    return "<" not in function.__qualname__ and not function.__code__.co_filename.startswith("<")
