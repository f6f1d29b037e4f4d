"""A study's page: its own words stay, what stands between `<!-- study: NAME -->` and `<!-- end -->` is written anew."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from pliant.errors import UserError
from pliant.store.store import write_atomically

DOCS = Path(__file__).resolve().parents[2] / "docs" / "studies"
MARK = re.compile(r"(<!-- study: ([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)
Result = dict[str, Any]
Tables = Mapping[str, Callable[[Result], Iterable[str]]]
Pictures = Mapping[str, Callable[[Result], bytes | None]]


def rendered(text: str, tables: Tables, result: Result) -> str:
    """A page's text with its tables written anew.

    Raises:
        UserError: the page asks for a table that there is none of.
    """

    def table(match: re.Match[str]) -> str:
        if match[2] not in tables:
            raise UserError(f"the page asks for the table '{match[2]}'; there are {', '.join(tables)}.")
        lines = "\n".join(tables[match[2]](result))
        return f"{match[1]}{lines}\n{match[3]}" if lines else f"{match[1]}{match[3]}"

    return MARK.sub(table, text)


def require_main(result: Result, main: str) -> None:
    """Raise `UserError` where the search is missing whose result the file is."""
    if main not in result["runs"]:
        raise UserError(f"nothing is published without the search '{main}'; run it with --only {main}.")


def publish(name: str, tables: Tables, pictures: Pictures, result: Result, docs: Path = DOCS) -> list[Path]:
    """Write NAME.json, its pictures NAME_*.png and the tables of NAME.md; returns what was written."""
    page = docs / f"{name}.md"
    text = rendered(page.read_text(encoding="utf-8"), tables, result)
    written = [docs / f"{name}.json", page]
    write_atomically(written[0], json.dumps(result, indent=1, allow_nan=False) + "\n")
    for label, draw in pictures.items():
        path, png = docs / f"{name}_{label}.png", draw(result)
        if png is None:
            path.unlink(missing_ok=True)
        else:
            path.write_bytes(png)
            written.append(path)
    write_atomically(page, text)
    return written
