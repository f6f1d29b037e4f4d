"""Pages of docs whose tables come from results: a page's own words stay, what stands between marks is written anew.

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
    """Finds the marks of a page: its beginning, its name, its end."""
    return re.compile(rf"(<!-- {word}: ([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def rendered(text: str, mark: re.Pattern[str], tables: Tables, result: Result) -> str:
    """A page's text with its tables written anew.

    Raises:
        UserError: the page asks for a table that there is none of.
    """

    def table(match: re.Match[str]) -> str:
        if match[2] not in tables:
            raise UserError(f"the page asks for the table '{match[2]}'; there are {', '.join(tables)}.")
        lines = "\n".join(tables[match[2]](result))
        return f"{match[1]}{lines}\n{match[3]}" if lines else f"{match[1]}{match[3]}"

    return mark.sub(table, text)


def table(columns: str, rows: Iterable[Iterable[Any]]) -> Iterator[str]:
    """A table in Markdown; the heads of its columns stand between bars, as in the first line that it yields."""
    yield f"| {columns} |"
    yield "|---" * (columns.count("|") + 1) + "|"
    for row in rows:
        yield "|" + "".join(f" {cell} |" if cell != "" else " |" for cell in row)
