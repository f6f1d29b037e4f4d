"""A law's scalar function as a tape: the function's source is interpreted with symbols for its inputs.

Whatever depends on parameters alone (loops, lengths, sizes) is evaluated while tracing; choices that depend on
inputs become selections between both branches.
"""

from __future__ import annotations

import ast
import inspect
import math
import operator
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant_export.tape import ARITHMETIC, COMPARISONS, FUNCTIONS, SELECT, TAKE, Builder

OPERATORS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
COMPARED = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}
ONLY_KNOWN: dict[type, Callable[[Any, Any], Any]] = {ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod}
NOTHING = object()


@dataclass(frozen=True)
class TracedNumber:
    """A number that depends on inputs: a step of a tape."""

    step: int


class Cells:
    """An array that is filled: its cells are stored in the tracer, because both branches of a choice may fill it."""

    def __init__(self, name: str, shape: tuple[int, ...]) -> None:
        self.name, self.shape = name, shape


class CannotTraceError(Exception):
    """Error of a function that does something without a counterpart; the text says what and where."""


@cache
def _source(function: Callable[..., Any]) -> ast.FunctionDef:
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(tree, ast.FunctionDef)
    return tree


class Tracer:
    """A tracer of functions into one builder."""

    def __init__(self, build: Builder) -> None:
        self.build = build
        self.cells: dict[str, Array] = {}

    def fill(
        self, function: Callable[..., Any], actuation: Any, u: Sequence[TracedNumber], parameters: Array
    ) -> list[list[int]]:
        """Return the steps of τ (a), ∂τ/∂p (a or a·m) and ∂τ/∂u (a·a) of a law's scalar function.

        Args:
            function: see `ScalarLaw`.
            actuation: a symbol, a number, or a list of them for a law of several actuations.
            u: the deformation's symbols.
            parameters: (P,).

        Raises:
            UserError: the function cannot be written in other languages.
        """
        a = len(u)
        m = len(actuation) if isinstance(actuation, list) else 1
        shapes = {"tau": (a,), "dtau_dp": (a * m,), "dtau_du": (a, a)}
        for name, shape in shapes.items():
            self.cells[name] = np.zeros(shape, object)
        filled = [Cells(name, shape) for name, shape in shapes.items()]
        try:
            self.call(function, [actuation, list(u), np.asarray(parameters, float), *filled])
        except (CannotTraceError, OSError, TypeError) as error:
            raise UserError(
                f"a law's function cannot be written in other languages ({error}): export a study whose surrogate is "
                "polynomial, neural or table."
            ) from error
        return [[self.step(value) for value in self.cells[name].ravel()] for name in shapes]

    def work(self, size: int | tuple[int, ...]) -> Cells:
        """Return an empty work array of the function."""
        name, shape = f"work {len(self.cells)}", (size,) if isinstance(size, int) else size
        self.cells[name] = np.zeros(shape, object)
        return Cells(name, shape)

    def step(self, value: Any) -> int:
        """Return the step of a number or symbol."""
        return value.step if isinstance(value, TracedNumber) else self.build.number(float(value))

    def op(self, name: str, *values: Any) -> TracedNumber:
        """Return the symbol of an operation on numbers and symbols."""
        return TracedNumber(self.build.op(name, *(self.step(value) for value in values)))

    def call(self, function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
        """Trace a function of the law's file and return its result."""
        tree = _source(getattr(function, "py_func", function))
        names = [argument.arg for argument in tree.args.args]
        frame = _Frame(
            self, getattr(function, "py_func", function).__globals__, dict(zip(names, arguments, strict=True))
        )
        found = frame.block(tree.body)
        return None if found is NOTHING else found


class _Frame:
    """One call: its variables, and the statements that change them."""

    def __init__(self, tracer: Tracer, world: dict[str, Any], variables: dict[str, Any]) -> None:
        self.tracer, self.world, self.variables = tracer, world, variables

    def block(self, statements: Sequence[ast.stmt]) -> Any:
        """Trace statements and return their result; NOTHING if they do not return."""
        for number, statement in enumerate(statements):
            if isinstance(statement, ast.If):
                found = self._choose(statement, statements[number + 1 :])
                if found is not None:
                    return found[0]
                continue
            found = self._simple(statement)
            if found is not NOTHING:
                return found
        return NOTHING

    def _simple(self, node: ast.stmt) -> Any:
        match node:
            case ast.Return(value):
                return None if value is None else self.value(value)
            case ast.Assign(targets, value):
                found = self.value(value)
                for target in targets:
                    self._assign(target, found)
            case ast.AnnAssign(target, _, value) if value is not None:
                self._assign(target, self.value(value))
            case ast.AugAssign(target, op, value):
                self._assign(target, self._binary(op, self.value(target), self.value(value)))
            case ast.For(target, iterable, body):
                for item in self.value(iterable):
                    self._assign(target, item)
                    found = self.block(body)
                    if found is not NOTHING:
                        return found
            case ast.Expr(ast.Constant()) | ast.Pass():
                pass
            case ast.Expr(value):
                self.value(value)
            case _:
                raise _cannot(node)
        return NOTHING

    def _choose(self, node: ast.If, rest: Sequence[ast.stmt]) -> tuple[Any] | None:
        """Trace an `if`: (the returned value,), or None where the statements after it are still to be traced."""
        test = self.value(node.test)
        if not isinstance(test, TracedNumber):
            found = self.block(node.body if test else node.orelse)
            return None if found is NOTHING else (found,)
        returns = any(
            isinstance(inner, ast.Return)
            for way in (node.body, node.orelse)
            for s in way
            for inner in ast.walk(s)
        )
        ways = [[*way, *(rest if returns else ())] for way in (node.body, node.orelse)]
        variables, cells = self.variables, self.tracer.cells
        ends = []
        for way in ways:
            self.variables = dict(variables)
            self.tracer.cells = {name: values.copy() for name, values in cells.items()}
            ends.append((self.block(way), self.variables, self.tracer.cells))
        (one, yes, filled), (other, no, left) = ends
        self.variables = {name: self._either(test, yes[name], no[name]) for name in yes if name in no}
        self.tracer.cells = {
            name: np.vectorize(lambda a, b: self._either(test, a, b), otypes=[object])(
                filled[name], left[name]
            )
            for name in cells
        }
        if not returns:
            return None
        if (one is NOTHING) != (other is NOTHING):
            one, other = (None if found is NOTHING else found for found in (one, other))
        return (self._either(test, one, other),)

    def _either(self, test: TracedNumber, one: Any, other: Any) -> Any:
        if one is other or (isinstance(one, TracedNumber | int | float) and one == other):
            return one
        if isinstance(one, tuple) and isinstance(other, tuple) and len(one) == len(other):
            return tuple(self._either(test, a, b) for a, b in zip(one, other, strict=True))
        if isinstance(one, TracedNumber | int | float) and isinstance(other, TracedNumber | int | float):
            return self.tracer.op(SELECT, test, one, other)
        raise CannotTraceError("a choice between things that are no numbers")

    def _assign(self, target: ast.expr, value: Any) -> None:
        match target:
            case ast.Name(name):
                self.variables[name] = value
            case ast.Tuple(parts):
                for part, one in zip(parts, value, strict=True):
                    self._assign(part, one)
            case ast.Subscript(array, place):
                held = self.value(array)
                if not isinstance(held, Cells):
                    raise _cannot(target)
                self.tracer.cells[held.name][self.value(place)] = value
            case _:
                raise _cannot(target)

    def value(self, node: ast.expr) -> Any:
        """Return the value of an expression: a number, a symbol, or something that contains them."""
        match node:
            case ast.Constant(value):
                return value
            case ast.Name(name):
                return self.variables[name] if name in self.variables else self._global(name)
            case ast.Tuple(parts):
                return tuple(self.value(part) for part in parts)
            case ast.BinOp(left, op, right):
                return self._binary(op, self.value(left), self.value(right))
            case ast.UnaryOp(op, operand):
                return self._unary(op, self.value(operand), node)
            case ast.Compare(left, ops, others):
                return self._compare(self.value(left), ops, [self.value(other) for other in others])
            case ast.BoolOp(op, parts):
                return self._boolean(op, parts)
            case ast.IfExp(test, body, orelse):
                chosen = self.value(test)
                if isinstance(chosen, TracedNumber):
                    return self._either(chosen, self.value(body), self.value(orelse))
                return self.value(body if chosen else orelse)
            case ast.Subscript(array, place):
                return self._item(self.value(array), self.value(place))
            case ast.Call(function, arguments):
                return self._call(function, [self.value(argument) for argument in arguments])
        raise _cannot(node)

    def _global(self, name: str) -> Any:
        known = self.world.get(name, NOTHING)
        if known is NOTHING:
            known = {"range": range, "len": len, "int": int, "abs": abs, "min": min, "max": max}.get(
                name, NOTHING
            )
        if known is NOTHING:
            raise CannotTraceError(f"'{name}' is not known")
        return known

    def _binary(self, op: ast.operator, left: Any, right: Any) -> Any:
        if isinstance(left, TracedNumber) or isinstance(right, TracedNumber):
            if isinstance(op, ast.Pow) and right in (2, 3):
                square = self.tracer.op("*", left, left)
                return square if right == 2 else self.tracer.op("*", square, left)
            name = OPERATORS.get(type(op))
            if name is None:
                raise CannotTraceError(f"{type(op).__name__} of what depends on the input")
            return self.tracer.op(name, left, right)
        if type(op) in OPERATORS:
            return ARITHMETIC[OPERATORS[type(op)]](left, right)
        if isinstance(op, ast.Pow):
            return left**right
        if type(op) in ONLY_KNOWN:
            return ONLY_KNOWN[type(op)](left, right)
        raise CannotTraceError(type(op).__name__)

    def _unary(self, op: ast.unaryop, value: Any, node: ast.expr) -> Any:
        if isinstance(op, ast.USub):
            return self.tracer.op("-", 0.0, value) if isinstance(value, TracedNumber) else -value
        if isinstance(op, ast.Not):
            return self.tracer.op("not", value) if isinstance(value, TracedNumber) else not value
        raise _cannot(node)

    def _compare(self, left: Any, ops: Sequence[ast.cmpop], others: Sequence[Any]) -> Any:
        found: Any = True
        for op, right in zip(ops, others, strict=True):
            if type(op) not in COMPARED:
                raise CannotTraceError(type(op).__name__)
            name = COMPARED[type(op)]
            known = not (isinstance(left, TracedNumber) or isinstance(right, TracedNumber))
            one = COMPARISONS[name](left, right) if known else self.tracer.op(name, left, right)
            found = one if found is True else self._both("and", found, one)
            left = right
        return found

    def _boolean(self, op: ast.boolop, parts: Sequence[ast.expr]) -> Any:
        name = "and" if isinstance(op, ast.And) else "or"
        found: Any = name == "and"
        for part in parts:
            if not isinstance(found, TracedNumber) and bool(found) != (name == "and"):
                return found
            one = self.value(part)
            found = one if not isinstance(found, TracedNumber) else self._both(name, found, one)
        return found

    def _both(self, name: str, one: Any, other: Any) -> Any:
        if isinstance(one, TracedNumber) or isinstance(other, TracedNumber):
            return self.tracer.op(
                name, *(value if isinstance(value, TracedNumber) else float(value) for value in (one, other))
            )
        return (one and other) if name == "and" else (one or other)

    def _item(self, held: Any, place: Any) -> Any:
        if isinstance(held, Cells):
            return self.tracer.cells[held.name][place]
        if isinstance(place, TracedNumber):
            return self.tracer.op(TAKE, place)
        return float(held[place]) if isinstance(held, np.ndarray) else held[place]

    def _call(self, function: ast.expr, arguments: Sequence[Any]) -> Any:
        known: Any = self.value(function) if isinstance(function, ast.Name) else NOTHING
        match function:
            case ast.Attribute(ast.Name("math"), name):
                known = getattr(math, name)
            case ast.Attribute(ast.Name("np"), "empty") if isinstance(arguments[0], int | tuple):
                return self.tracer.work(arguments[0])
        if known is NOTHING:
            raise _cannot(function)
        if known is len and isinstance(arguments[0], Cells):
            return arguments[0].shape[0]
        if any(isinstance(argument, TracedNumber) for argument in arguments):
            name = "trunc" if known is int else known.__name__
            name = "abs" if name == "fabs" else name
            if known in (min, max):
                found = arguments[0]
                for other in arguments[1:]:
                    found = self.tracer.op(name, found, other)
                return found
            if name in FUNCTIONS and (known in (int, abs) or getattr(math, known.__name__, None) is known):
                return self.tracer.op(name, *arguments)
        if inspect.isfunction(getattr(known, "py_func", known)):
            return self.tracer.call(known, arguments)
        return known(*arguments)


def _cannot(node: ast.AST) -> CannotTraceError:
    return CannotTraceError(f"'{ast.unparse(node).splitlines()[0]}'")
