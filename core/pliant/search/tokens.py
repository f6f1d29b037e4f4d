"""The words of an expression: numbers with their unit, names with dots, texts in quotes, operators."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

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
