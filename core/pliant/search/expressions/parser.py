"""Expressions of a search, read from text: constraints, objectives and `until`.

    n1 + n2 <= 12
    family.average_radius - family.inner_radius >= family.module_length / 4
    rmse <= 5 mm and e_max <= 5 mm
    z_max - 0.01 * abs(task.pressure - 12 kPa) / 1 kPa

Operators are `+ - * / **`, parentheses, `< <= > >= ==`, `and`, and the functions min, max, abs, sqrt, sin, cos, log,
exp, sum. Names have dots, list items a number. Bare numbers are SI; a number that a unit follows is a quantity, its
unit being one word or words joined without spaces (`9.81 m/s^2`): `5 mm / x` divides by x, `5 mm/x` is no unit.
Texts stand in quotes, beside `==`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from pliant.errors import UserError, closest
from pliant.records.design import Array
from pliant.search.expressions import formula
from pliant.search.expressions.formula import All, Call, Comparison, Node, Number, Symbol, Text
from pliant.units import EXAMPLES, NAMES, UnitError, parse_quantity

LONGEST = 2000
DEEPEST = 40
COMPARISONS = ("<", "<=", ">", ">=", "==")
# Units beside those of keys that a quantity may have.
FURTHER_UNITS = ("m^2", "m^3", "1/s", "m/s", "W", "N/m", "Pa/s", "rad/s")
PURE = ("", "rad", "dimensionless")


@dataclass(frozen=True)
class Expression:
    """A formula with its text.

    Attributes:
        text: as the study writes it.
        tree: what is computed.
        names: the symbols in it, each once.
        truth: whether it is an inequality (or several), not a number.
    """

    text: str
    tree: Node
    names: tuple[Symbol, ...]
    truth: bool

    def value(self, values: Mapping[str, Any]) -> Any:
        """The number, or an array of them; NaN where there is none. Values: symbol's name → value or array, SI."""
        return formula.value(self.tree, values)

    def amount(self, values: Mapping[str, Any]) -> Array:
        """By how much an inequality is missed, 0 where it holds; see `formula.amount`."""
        return formula.amount(self.tree, values)

    def uses(self, role: str) -> bool:
        """Whether a variable, key or metric is in it."""
        return any(symbol.role == role for symbol in self.names)


def parse(text: str, symbol: Callable[[str], Symbol], label: str, truth: bool | None = None) -> Expression:
    """Read an expression.

    Args:
        text: the expression.
        symbol: what a name means; raises `UserError` for one that means nothing.
        label: names the expression in messages (`search.constraints.0`).
        truth: True where an inequality is needed, False where a number is.

    Raises:
        UserError: with the expression and the position of the mistake.
    """
    reader = _Reader(text, symbol, label)
    tree = reader.everything()
    found = isinstance(tree, Comparison | All)
    if truth is True and not found:
        raise UserError(f"{label} '{text}' needs a comparison, such as 'n1 + n2 <= 12'.")
    if truth is False and (found or formula.is_text(tree)):
        raise UserError(f"{label} '{text}' needs a number, not a comparison or a text.")
    return Expression(text, tree, tuple(dict.fromkeys(formula.symbols(tree))), found)


class _Reader:
    """Reads tokens from left to right; one method per level of precedence, as Python has them."""

    def __init__(self, text: str, symbol: Callable[[str], Symbol], label: str) -> None:
        self.text, self.symbol, self.label = text, symbol, label
        if len(text) > LONGEST:
            raise UserError(f"{label} has {len(text)} characters; an expression has at most {LONGEST}.")
        self.tokens = tokens(text, self.mistake)
        self.next, self.depth = 0, 0

    def fail(self, what: str, at: int) -> NoReturn:
        """Raise `mistake`."""
        raise self.mistake(what, at)

    def mistake(self, what: str, at: int) -> UserError:
        """An error with the expression and the place."""
        return UserError(f"{self.label} '{self.text}': {what} (at character {at + 1}).")

    @property
    def token(self) -> Token:
        return self.tokens[self.next]

    def take(self, *texts: str) -> Token | None:
        """The next token where it is one of these."""
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
        if len(parts) > 1 and any(not isinstance(part, Comparison) for part in parts):
            self.fail("'and' joins comparisons", 0)
        return parts[0] if len(parts) == 1 else All(tuple(parts))

    def unexpected(self) -> NoReturn:
        token = self.token
        if token.text in ("or", "not", "if", "in", "is", "lambda"):
            self.fail(
                f"'{token.text}' is not among the operators, which are + - * / ** < <= > >= == and", token.at
            )
        self.fail(f"'{token.text}' is not expected here" if token.text else "it ends too early", token.at)

    def comparisons(self) -> list[Node]:
        at = self.token.at
        left = self.sums()
        found: list[Node] = []
        while operator := self.take(*COMPARISONS):
            right = self.sums()
            self.comparable(operator, left, right)
            found.append(Comparison(operator.text, left, right))
            left = right
        if not found and formula.is_text(left):
            self.fail("a text stands beside '==' only", at)
        return found or [left]

    def comparable(self, operator: Token, left: Node, right: Node) -> None:
        texts = [formula.is_text(side) for side in (left, right)]
        if any(texts) and (operator.text != "==" or not all(texts)):
            self.fail("a text is compared with a text, by '=='", operator.at)
        if operator.text == "==":
            for symbol in (*formula.symbols(left), *formula.symbols(right)):
                if not symbol.exact:
                    self.fail(
                        f"'{symbol.name}' is a real number, which hardly equals another; write "
                        "'abs(a - b) <= tolerance'",
                        operator.at,
                    )
        self.same_unit(left, right, operator)

    def same_unit(self, left: Node, right: Node, operator: Token) -> None:
        units = [unit_of(side) for side in (left, right)]
        if None in units or units[0] == units[1] or all(unit in PURE for unit in units):
            return
        named = [NAMES.get(unit or "dimensionless", unit) for unit in units]
        self.fail(f"'{operator.text}' stands between {named[0]} and {named[1]}", operator.at)

    def sums(self) -> Node:
        left = self.products()
        while operator := self.take("+", "-"):
            right = self.products()
            self.numbers(operator, left, right)
            self.same_unit(left, right, operator)
            left = Call(operator.text, (left, right))
        return left

    def products(self) -> Node:
        left = self.signed()
        while operator := self.take("*", "/"):
            right = self.signed()
            self.numbers(operator, left, right)
            left = Call(operator.text, (left, right))
        return left

    def signed(self) -> Node:
        self.depth += 1
        if self.depth > DEEPEST:
            self.fail("it is nested too deeply", self.token.at)
        sign = self.take("-", "+")
        found: Node
        if sign is None:
            found = self.powers()
        else:
            inner = self.signed()
            self.numbers(sign, inner)
            found = Call("negative", (inner,)) if sign.text == "-" else inner
        self.depth -= 1
        return found

    def powers(self) -> Node:
        base = self.atom()
        operator = self.take("**")
        if operator is None:
            return base
        exponent = self.signed()  # binds to the right, and takes a sign
        self.numbers(operator, base, exponent)
        return Call("**", (base, exponent))

    def numbers(self, operator: Token, *sides: Node) -> None:
        for side in sides:
            if formula.is_text(side):
                self.fail(f"'{operator.text}' needs numbers, not texts", operator.at)

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
            return Text(token.text[1:-1])
        if self.take("("):
            return self.call(token)
        try:
            return self.symbol(token.text)
        except UserError as error:
            raise UserError(f"{self.label} '{self.text}' (at character {token.at + 1}): {error}") from None

    def close(self) -> None:
        if self.take(")") is None:
            self.unexpected() if self.token.kind != "end" else self.fail("a ')' is missing", self.token.at)

    def call(self, name: Token) -> Node:
        if name.text not in formula.NAMED:
            known = ", ".join(formula.NAMED)
            hint = closest(name.text, formula.NAMED)
            self.fail(f"there is no function '{name.text}'{hint} There are {known}", name.at)
        of = [self.sums()]
        while self.take(","):
            of.append(self.sums())
        self.close()
        self.numbers(name, *of)
        if len(of) > 1 and name.text not in ("min", "max", "sum"):
            self.fail(f"'{name.text}' takes one number, not {len(of)}", name.at)
        return Call(name.text, tuple(of))

    def quantity(self, token: Token) -> Number:
        number = float(token.text)
        if not np.isfinite(number):
            self.fail(f"'{token.text}' is too large", token.at)
        if not token.unit:
            return Number(number)
        for unit in (*EXAMPLES, *FURTHER_UNITS):
            with suppress(UnitError):
                return Number(parse_quantity(f"{token.text} {token.unit}", unit), unit)
        what = f"'{token.unit}' is no unit"
        raise self.mistake(
            f"{what}; put spaces around operators, and one between a number and a name", token.at
        )


def unit_of(node: Node) -> str | None:
    """The SI unit of a tree where it is certain."""
    if isinstance(node, Symbol | Number):
        return node.unit
    if isinstance(node, Call) and node.function in ("+", "-", "negative", "min", "max", "abs", "sum"):
        units = {unit_of(inner) for inner in node.of}
        return next(iter(units)) if len(units) == 1 else None
    return None


TOKENS = re.compile(
    r"""(?P<space>\s+)
    |(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)
     (?:[ ]*(?P<unit>(?!(?:and|or|not|if|is)\b)(?:%|[^\W\d_]+(?:\^-?\d+)?(?:[*/][^\W\d_]+(?:\^-?\d+)?)*)(?![\w.(])))?
    |(?P<name>[^\W\d]\w*(?:\.\w+)*)
    |(?P<text>'[^']*'|"[^"]*")
    |(?P<operator>\*\*|<=|>=|==|[-+*/()<>,])""",
    re.VERBOSE,
)


@dataclass(frozen=True)
class Token:
    """A word: its kind (`number`, `name`, `text`, `operator`, `end`), where it begins, and the unit of a number."""

    kind: str
    text: str
    at: int
    unit: str = ""


def tokens(text: str, mistake: Callable[[str, int], Exception]) -> list[Token]:
    """All words, and the end.

    Args:
        text: the expression.
        mistake: makes the error that is raised for a character that belongs to no word.
    """
    found, at = [], 0
    while at < len(text):
        match = TOKENS.match(text, at)
        if match is None:
            raise mistake(f"'{text[at]}' is not understood", at)
        kind = "number" if match["number"] is not None else str(match.lastgroup)
        if kind != "space":
            found.append(Token(kind, match["number"] or match.group(), at, match["unit"] or ""))
        at = match.end()
    return [*found, Token("end", "", len(text))]
