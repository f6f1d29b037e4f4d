"""Formulas of a search as trees: their value, and by how much an inequality is missed; numbers or arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pliant.records.design import Array

Sort = Literal["number", "text"]
LEAST = 1e-12  # by how much `a < b` is missed where a = b


@dataclass(frozen=True)
class Symbol:
    """A name in a formula.

    Attributes:
        name: under which its value is found.
        role: variable, key of the study, or metric of the task.
        sort: of its values.
        exact: whether it takes single values, so that `==` can hold.
        unit: SI unit, "" for a pure number, None where it is not known.
    """

    name: str
    role: Literal["variable", "key", "metric"]
    sort: Sort = "number"
    exact: bool = True
    unit: str | None = None


@dataclass(frozen=True)
class Number:
    """A literal, SI."""

    value: float
    unit: str | None = None


@dataclass(frozen=True)
class Text:
    """A quoted text."""

    value: str


@dataclass(frozen=True)
class Call:
    """A function or operator of numbers."""

    function: str
    of: tuple[Node, ...]


@dataclass(frozen=True)
class Comparison:
    """`left operator right`."""

    operator: str
    left: Node
    right: Node


@dataclass(frozen=True)
class All:
    """Comparisons that hold together."""

    of: tuple[Node, ...]


Node = Symbol | Number | Text | Call | Comparison | All
Values = Mapping[str, Any]


def _finite(function: Callable[..., Any]) -> Callable[..., Any]:
    """What has no finite value is NaN."""

    def inner(*of: Any) -> Any:
        found = function(*of)
        return np.where(np.isfinite(found), found, np.nan)

    return inner


def _sum(*of: Any) -> Any:
    return sum(of[1:], of[0])


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": _finite(np.divide),
    "**": _finite(np.float_power),
    "negative": np.negative,
    "min": lambda *of: _reduced(np.minimum, of),
    "max": lambda *of: _reduced(np.maximum, of),
    "abs": np.abs,
    "sqrt": np.sqrt,
    "sin": _finite(np.sin),
    "cos": _finite(np.cos),
    "log": _finite(np.log),
    "exp": _finite(np.exp),
    "sum": _sum,
}
NAMED = tuple(name for name in FUNCTIONS if name.isalpha() and name != "negative")


def _reduced(function: Callable[..., Any], of: tuple[Any, ...]) -> Any:
    found = of[0]
    for other in of[1:]:
        found = function(found, other)
    return found


def value(node: Node, values: Values) -> Any:
    """The value of a number's or a text's tree; NaN where it has none."""
    if isinstance(node, Symbol):
        found = values[node.name]
        return found if node.sort == "text" else np.asarray(found, dtype=float)
    if isinstance(node, Number | Text):
        return node.value
    if isinstance(node, Call):
        with np.errstate(all="ignore"):
            return FUNCTIONS[node.function](*(value(inner, values) for inner in node.of))
    raise TypeError(f"{type(node).__name__} has no value")


def size(node: Node, values: Values) -> Any:
    """The magnitude of a tree's terms, signs aside: what an inequality's miss is measured by."""
    if isinstance(node, Call) and node.function in ("+", "-", "negative", "sum"):
        return _sum(*(size(inner, values) for inner in node.of))
    if isinstance(node, Call) and node.function == "*":
        return size(node.of[0], values) * size(node.of[1], values)
    if isinstance(node, Text) or (isinstance(node, Symbol) and node.sort == "text"):
        return 1.0
    return np.abs(value(node, values))


def amount(node: Node, values: Values) -> Array:
    """By how much a tree of comparisons is missed: 0 where it holds; of one comparison at most 1.

    `a <= b` is missed by (a − b) over the magnitude of the terms of both sides, so that amounts of different
    inequalities can be added. What is not a number is missed by 1.
    """
    if isinstance(node, All):
        found: Array = _sum(*(amount(inner, values) for inner in node.of))
        return found
    if not isinstance(node, Comparison):
        raise TypeError(f"{type(node).__name__} cannot be missed")
    left, right = value(node.left, values), value(node.right, values)
    if node.operator == "==" and is_text(node.left):
        return np.asarray(np.asarray(left, dtype=object) != np.asarray(right, dtype=object), dtype=float)
    with np.errstate(all="ignore"):
        scale = size(node.left, values) + size(node.right, values)
        miss = np.asarray(left - right if node.operator in ("<", "<=") else right - left, dtype=float)
        miss = np.abs(miss) if node.operator == "==" else miss
        share = np.clip(miss / np.where(scale > 0, scale, 1.0), 0.0, 1.0)
    missed = miss >= 0 if node.operator in ("<", ">") else miss > 0
    share = np.where(missed, np.maximum(share, LEAST), 0.0)
    return np.where(np.isnan(miss), 1.0, share)


def symbols(node: Node) -> Iterator[Symbol]:
    """All names of a tree."""
    if isinstance(node, Symbol):
        yield node
    inner: tuple[Node, ...] = ()
    if isinstance(node, Call | All):
        inner = node.of
    elif isinstance(node, Comparison):
        inner = (node.left, node.right)
    for below in inner:
        yield from symbols(below)


def is_text(node: Node) -> bool:
    return isinstance(node, Text) or (isinstance(node, Symbol) and node.sort == "text")
