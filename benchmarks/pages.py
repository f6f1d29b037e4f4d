"""Pages of docs whose tables come from results: the text between marks is regenerated, the rest is kept.

<!-- WORD: NAME --> … <!-- end -->    the table or picture NAME of the page's module
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from pliant.errors import UserError

Result = dict[str, Any]
Tables = Mapping[str, Callable[[Result], Iterable[str]]]


def marks(word: str) -> re.Pattern[str]:
    """Return a pattern that finds the marks of a page: its start, its name, its end."""
    return re.compile(rf"(<!-- {word}: ([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def rendered(text: str, mark: re.Pattern[str], tables: Tables, result: Result) -> str:
    """Return a page's text with its tables updated.

    Raises:
        UserError: the page asks for an unknown table.
    """

    def table(match: re.Match[str]) -> str:
        if match[2] not in tables:
            raise UserError(f"the page asks for the table '{match[2]}'; there are {', '.join(tables)}.")
        lines = "\n".join(tables[match[2]](result))
        return f"{match[1]}{lines}\n{match[3]}" if lines else f"{match[1]}{match[3]}"

    return mark.sub(table, text)


def table(columns: str, rows: Iterable[Iterable[Any]]) -> Iterator[str]:
    """Yield a table in Markdown; column heads are separated by bars, as in its first line."""
    yield f"| {columns} |"
    yield "|---" * (columns.count("|") + 1) + "|"
    for row in rows:
        yield "|" + "".join(f" {cell} |" if cell != "" else " |" for cell in row)
