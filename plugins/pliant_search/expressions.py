"""Parser and evaluation of a search's expressions: constraints, objectives and `until`.

    n1 + n2 <= 12
    family.average_radius - family.inner_radius >= family.module_length / 4
    rmse <= 5 mm and e_max <= 5 mm
    z_max - 0.01 * abs(task.pressure - 12 kPa) / 1 kPa

Operators are `+ - * / **`, parentheses, `< <= > >= ==`, `and`, and the functions min, max, abs, sqrt, sin, cos, log,
exp, sum. Names have dots, list items a number. Bare numbers are SI. A number followed by a unit is a quantity; the
unit is one word or words joined without spaces (`9.81 m/s^2`): `5 mm / x` divides by x, `5 mm/x` is an error.
Texts are quoted and allowed only as operands of `==`.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import reduce
from typing import Any, Literal, NamedTuple, NoReturn

import numpy as np

from pliant.errors import UserError, closest
from pliant.records.design import Array
from pliant.units import EXAMPLES, NAMES, UnitError, parse_quantity

LONGEST = 2000
SHOWN = 200  # characters of the expression that a message repeats
DEEPEST = 40
MOST = 100  # operators: evaluation is recursive
LEAST = 1e-12  # violation of `a < b` at a = b
COMPARISONS = ("<", "<=", ">", ">=", "==")
# Units, in addition to those of keys, that a quantity may have.
FURTHER_UNITS = ("m^2", "m^3", "1/s", "m/s", "W", "N/m", "Pa/s", "rad/s")
PURE = ("", "rad", "dimensionless")


@dataclass(frozen=True)
class Symbol:
    """A name in a formula.

    Attributes:
        name: the key of its value.
        role: variable, key of the study, or metric of the task.
        sort: of its values.
        exact: whether its values are discrete, so that `==` can be satisfied.
        unit: SI unit, "" for a pure number, None where it is not known.
    """

    name: str
    role: Literal["variable", "key", "metric"]
    sort: Literal["number", "text"] = "number"
    exact: bool = True
    unit: str | None = None


@dataclass(frozen=True)
class LiteralValue:
    """A number, SI, or a quoted text."""

    value: float | str
    unit: str | None = None


@dataclass(frozen=True)
class Call:
    """A function or operator of numbers, a comparison, or a conjunction of comparisons (`and`)."""

    function: str
    of: tuple[Node, ...]


Node = Symbol | LiteralValue | Call
Values = Mapping[str, Any]  # symbol's name → value or array, SI


def _finite(function: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a function so that results that are not finite become NaN."""

    def inner(*of: Any) -> Any:
        found = function(*of)
        return np.where(np.isfinite(found), found, np.nan)

    return inner


def _sum(*of: Any) -> Any:
    return reduce(operator.add, of)


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": _finite(np.divide),
    "**": _finite(np.float_power),
    "negative": np.negative,
    "min": lambda *of: reduce(np.minimum, of),
    "max": lambda *of: reduce(np.maximum, of),
    "abs": np.abs,
    "sqrt": np.sqrt,
    "sin": _finite(np.sin),
    "cos": _finite(np.cos),
    "log": _finite(np.log),
    "exp": _finite(np.exp),
    "sum": _sum,
}
NAMED = tuple(name for name in FUNCTIONS if name.isalpha() and name != "negative")


@dataclass(frozen=True)
class Expression:
    """A formula with its text.

    Attributes:
        text: as the study writes it.
        tree: what is computed.
        names: the symbols in it, each once.
    """

    text: str
    tree: Node
    names: tuple[Symbol, ...]

    def value(self, values: Values) -> Any:
        """Return the value, a number or an array; NaN where it is undefined."""
        return _value(self.tree, values)

    def amount(self, values: Values) -> Array:
        """Return the violation of a comparison: 0 where it is satisfied, at most 1 for one comparison.

        The violation of `a <= b` is (a − b) over the magnitude of the terms of both sides, so that violations of
        different inequalities can be added. The violation of NaN is 1.
        """
        return _amount(self.tree, values)

    def margins(self, values: Values) -> list[float]:
        """Return how far each comparison is from being violated, signed, over the same magnitude as `amount`.

        A comparison of texts gives 0 or −1; NaN gives −1.
        """
        return [float(one) for one in _margins(self.tree, values)]

    def uses(self, role: str) -> bool:
        """Return whether the expression contains a symbol of a role: variable, key or metric."""
        return any(symbol.role == role for symbol in self.names)

    @property
    def variables(self) -> frozenset[str]:
        """Return the names of the search's variables in the expression."""
        return frozenset(symbol.name for symbol in self.names if symbol.role == "variable")


def _value(node: Node, values: Values) -> Any:
    if isinstance(node, Symbol):
        found = values[node.name]
        return found if node.sort == "text" else np.asarray(found, dtype=float)
    if isinstance(node, LiteralValue):
        return node.value
    with np.errstate(all="ignore"):
        return FUNCTIONS[node.function](*(_value(inner, values) for inner in node.of))


def _size(node: Node, values: Values) -> Any:
    """Return the magnitude of a tree's terms regardless of sign, the scale of an inequality's violation."""
    if isinstance(node, Call) and node.function in ("+", "-", "negative", "sum"):
        return _sum(*(_size(inner, values) for inner in node.of))
    if isinstance(node, Call) and node.function == "*":
        return _size(node.of[0], values) * _size(node.of[1], values)
    return 1.0 if _is_text(node) else np.abs(_value(node, values))


def _amount(node: Node, values: Values) -> Array:
    assert isinstance(node, Call)
    if node.function == "and":
        return np.asarray(_sum(*(_amount(inner, values) for inner in node.of)))
    share = _miss(node, values)
    missed = share >= 0 if node.function in ("<", ">") else share > 0
    return np.where(missed, np.clip(share, LEAST, 1.0), 0.0)


def _margins(node: Node, values: Values) -> Iterator[Array]:
    assert isinstance(node, Call)
    if node.function == "and":
        for inner in node.of:
            yield from _margins(inner, values)
    else:
        yield -_miss(node, values)


def _miss(node: Call, values: Values) -> Array:
    """Return by how much a comparison is missed over the magnitude of its terms, negative where it holds."""
    left, right = (_value(side, values) for side in node.of)
    if _is_text(node.of[0]):
        return np.asarray(np.asarray(left, dtype=object) != np.asarray(right, dtype=object), dtype=float)
    with np.errstate(all="ignore"):
        scale = _size(node.of[0], values) + _size(node.of[1], values)
        miss = np.asarray(left - right if node.function in ("<", "<=") else right - left, dtype=float)
        miss = np.abs(miss) if node.function == "==" else miss
        share = miss / np.where(scale > 0, scale, 1.0)
    return np.where(np.isnan(share), 1.0, share)


def _symbols(node: Node) -> Iterator[Symbol]:
    if isinstance(node, Symbol):
        yield node
    for inner in node.of if isinstance(node, Call) else ():
        yield from _symbols(inner)


def _is_text(node: Node) -> bool:
    if isinstance(node, Symbol):
        return node.sort == "text"
    return isinstance(node, LiteralValue) and isinstance(node.value, str)


def _expression_unit(node: Node) -> str | None:
    """Return the SI unit of a tree, or None if it is not known."""
    if not isinstance(node, Call):
        return node.unit
    units = {_expression_unit(inner) for inner in node.of}
    certain = node.function in ("+", "-", "negative", "min", "max", "abs", "sum") and len(units) == 1
    return units.pop() if certain else None


def parse(text: str, symbol: Callable[[str], Symbol], label: str, truth: bool | None = None) -> Expression:
    """Read an expression.

    Args:
        text: the expression.
        symbol: returns the symbol of a name; raises `UserError` for an unknown name.
        label: names the expression in messages (`search.constraints.0`).
        truth: True where an inequality is needed, False where a number is.

    Raises:
        UserError: with the expression and the position of the mistake.
    """
    tree = _Reader(text, symbol, label).everything()
    compares = isinstance(tree, Call) and tree.function in (*COMPARISONS, "and")
    if truth is True and not compares:
        raise UserError(f"{label} '{text}' needs a comparison, such as 'n1 + n2 <= 12'.")
    if truth is False and (compares or _is_text(tree)):
        raise UserError(f"{label} '{text}' needs a number, not a comparison or a text.")
    return Expression(text, tree, tuple(dict.fromkeys(_symbols(tree))))


class _Token(NamedTuple):
    """A token: its kind (`number`, `name`, `text`, `operator`, `end`), position, and the unit of a number."""

    kind: str
    text: str
    at: int
    unit: str = ""


TOKENS = re.compile(
    r"""(?P<space>\s+)
    |(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)
     (?:[ ]*(?P<unit>(?!(?:and|or|not|if|is)\b)(?:%|[^\W\d_]+(?:\^-?\d+)?(?:[*/][^\W\d_]+(?:\^-?\d+)?)*)(?![\w.(])))?
    |(?P<name>[^\W\d]\w*(?:\.\w+)*)
    |(?P<text>'[^']*'|"[^"]*")
    |(?P<operator>\*\*|<=|>=|==|[-+*/()<>,])""",
    re.VERBOSE,
)


class _Reader:
    """Recursive-descent parser with one method per level of precedence, in Python's order."""

    def __init__(self, text: str, symbol: Callable[[str], Symbol], label: str) -> None:
        self.text, self.symbol, self.label = text, symbol, label
        self.tokens: list[_Token] = []
        self.next, self.depth = 0, 0
        if len(text) > LONGEST:
            raise UserError(f"{label} has {len(text)} characters; an expression has at most {LONGEST}.")
        at = 0
        while at < len(text):
            match = TOKENS.match(text, at)
            if match is None:
                raise self.mistake(f"'{text[at]}' is not understood", at)
            kind = "number" if match["number"] is not None else str(match.lastgroup)
            if kind != "space":
                self.tokens.append(_Token(kind, match["number"] or match.group(), at, match["unit"] or ""))
            at = match.end()
        self.tokens.append(_Token("end", "", len(text)))
        count = sum(token.kind == "operator" and token.text not in "(,)" for token in self.tokens)
        if count > MOST:
            raise self.mistake(f"it has {count} operators, and {MOST} are the most; write 'sum(a, b, c)'", 0)

    def mistake(self, what: str, at: int) -> UserError:
        text = self.text if len(self.text) <= SHOWN else f"{self.text[:SHOWN]}…"
        return UserError(f"{self.label} '{text}': {what} (at character {at + 1}).")

    @property
    def token(self) -> _Token:
        return self.tokens[self.next]

    def take(self, *texts: str) -> _Token | None:
        """Consume and return the next token if it is one of these, else return None."""
        if self.token.kind in ("operator", "name") and self.token.text in texts:
            self.next += 1
            return self.tokens[self.next - 1]
        return None

    def everything(self) -> Node:
        parts = self.comparisons()
        while self.take("and"):
            parts += self.comparisons()
        if self.token.kind != "end":
            self.unexpected()
        compares = [isinstance(part, Call) and part.function in COMPARISONS for part in parts]
        if len(parts) > 1 and not all(compares):
            raise self.mistake("'and' joins comparisons", 0)
        return parts[0] if len(parts) == 1 else Call("and", tuple(parts))

    def unexpected(self) -> NoReturn:
        token = self.token
        if token.text in ("or", "not", "if", "in", "is", "lambda"):
            raise self.mistake(
                f"'{token.text}' is not among the operators, which are + - * / ** < <= > >= == and", token.at
            )
        raise self.mistake(
            f"'{token.text}' is not expected here" if token.text else "it ends too early", token.at
        )

    def comparisons(self) -> list[Node]:
        at, left = self.token.at, self.sums()
        found: list[Node] = []
        while sign := self.take(*COMPARISONS):
            right = self.sums()
            texts = [_is_text(side) for side in (left, right)]
            if any(texts) and (sign.text != "==" or not all(texts)):
                raise self.mistake("a text is compared with a text, by '=='", sign.at)
            for symbol in (*_symbols(left), *_symbols(right)) if sign.text == "==" else ():
                if not symbol.exact:
                    raise self.mistake(
                        f"'{symbol.name}' is a real number, which hardly equals another; write "
                        "'abs(a - b) <= tolerance'",
                        sign.at,
                    )
            self.same_unit(left, right, sign)
            found.append(Call(sign.text, (left, right)))
            left = right
        if not found and _is_text(left):
            raise self.mistake("a text stands beside '==' only", at)
        return found or [left]

    def same_unit(self, left: Node, right: Node, sign: _Token) -> None:
        units = [_expression_unit(side) for side in (left, right)]
        if None in units or units[0] == units[1] or all(unit in PURE for unit in units):
            return
        named = [NAMES.get(unit or "dimensionless", unit) for unit in units]
        raise self.mistake(f"'{sign.text}' stands between {named[0]} and {named[1]}", sign.at)

    def sums(self) -> Node:
        return self.joined(("+", "-"), lambda: self.joined(("*", "/"), self.signed))

    def joined(self, signs: tuple[str, str], inner: Callable[[], Node]) -> Node:
        left = inner()
        while sign := self.take(*signs):
            right = inner()
            self.numbers(sign, left, right)
            if sign.text in ("+", "-"):
                self.same_unit(left, right, sign)
            left = Call(sign.text, (left, right))
        return left

    def signed(self) -> Node:
        self.depth += 1
        if self.depth > DEEPEST:
            raise self.mistake("it is nested too deeply", self.token.at)
        if sign := self.take("-", "+"):
            found = self.signed()
            self.numbers(sign, found)
            found = Call("negative", (found,)) if sign.text == "-" else found
        else:
            found = self.atom()
            if power := self.take("**"):
                exponent = self.signed()  # right-associative, and allows a sign
                self.numbers(power, found, exponent)
                found = Call("**", (found, exponent))
        self.depth -= 1
        return found

    def numbers(self, sign: _Token, *sides: Node) -> None:
        if any(_is_text(side) for side in sides):
            raise self.mistake(f"'{sign.text}' needs numbers, not texts", sign.at)

    def atom(self) -> Node:
        token = self.token
        if self.take("("):
            inner = self.sums()
            self.close()
            return inner
        if token.kind not in ("number", "text", "name") or token.text in ("and", "or", "not"):
            self.unexpected()
        self.next += 1
        if token.kind == "number":
            return self.quantity(token)
        if token.kind == "text":
            return LiteralValue(token.text[1:-1])
        if self.take("("):
            return self.call(token)
        try:
            return self.symbol(token.text)
        except UserError as error:
            raise UserError(f"{self.label} '{self.text}' (at character {token.at + 1}): {error}") from None

    def close(self) -> None:
        if self.take(")") is None:
            if self.token.kind == "end":
                raise self.mistake("a ')' is missing", self.token.at)
            self.unexpected()

    def call(self, name: _Token) -> Node:
        if name.text not in NAMED:
            hint = closest(name.text, NAMED)
            raise self.mistake(
                f"there is no function '{name.text}'{hint} There are {', '.join(NAMED)}", name.at
            )
        of = [self.sums()]
        while self.take(","):
            of.append(self.sums())
        self.close()
        self.numbers(name, *of)
        if len(of) > 1 and name.text not in ("min", "max", "sum"):
            raise self.mistake(f"'{name.text}' takes one number, not {len(of)}", name.at)
        return Call(name.text, tuple(of))

    def quantity(self, token: _Token) -> LiteralValue:
        number = float(token.text)
        if not np.isfinite(number):
            raise self.mistake(f"'{token.text}' is too large", token.at)
        if not token.unit:
            return LiteralValue(number)
        for unit in (*EXAMPLES, *FURTHER_UNITS):
            with suppress(UnitError):
                return LiteralValue(parse_quantity(f"{token.text} {token.unit}", unit), unit)
        hint = "put spaces around operators, and one between a number and a name"
        raise self.mistake(f"'{token.unit}' is no unit; {hint}", token.at)
