"""A study's page: its own words stay, what stands between marks is written anew.

    <!-- study: NAME --> … <!-- end -->                    a table or picture of the page's module
    <!-- value: PATH FORM -->…<!-- end value -->           a number within the prose, from the study's JSON

A PATH leads through the JSON by `/`; one that begins with `noted/` leads into NAME.noted.json, which holds numbers of
runs whose files were not kept, each with what it is of and the commit.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from benchmarks.studies.spoken import clock, millimetres, number, percent

from pliant.errors import UserError
from pliant.store.store import write_atomically

DOCS = Path(__file__).resolve().parents[2] / "docs" / "studies"
MARK = re.compile(r"(<!-- study: ([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)
VALUE = re.compile(r"(<!-- value: (\S+) (\S+) -->).*?(<!-- end value -->)", re.DOTALL)
FORMS: Mapping[str, Callable[[Any], str]] = {
    "mm": millimetres,
    "mm1": lambda value: millimetres(value, 1),
    "time": clock,
    "percent": lambda value: percent(value, 1),
    "score": lambda value: f"{value:.3f}",
    "number": number,
    "text": str,
}
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

    return VALUE.sub(
        lambda match: f"{match[1]}{_value(match[2], match[3], result)}{match[4]}", MARK.sub(table, text)
    )


def with_noted(name: str, result: Result, docs: Path = DOCS) -> Result:
    """The result with the numbers of NAME.noted.json, where a page has such."""
    file = docs / f"{name}.noted.json"
    return {**result, "noted": json.loads(file.read_text(encoding="utf-8"))} if file.exists() else result


def _value(path: str, form: str, result: Result) -> str:
    """A number of the JSON in words; a dash where a part has not run."""
    found: Any = result
    for key in path.split("/"):
        found = found.get(key) if isinstance(found, Mapping) else None
    if form not in FORMS:
        raise UserError(f"the page asks for the form '{form}' of {path}; there are {', '.join(FORMS)}.")
    return "–" if found is None else FORMS[form](found)


def require_main(result: Result, main: str) -> None:
    """Raise `UserError` where the search is missing whose result the file is."""
    if main not in result["runs"]:
        raise UserError(f"nothing is published without the search '{main}'; run it with --only {main}.")


def publish(name: str, tables: Tables, pictures: Pictures, result: Result, docs: Path = DOCS) -> list[Path]:
    """Write NAME.json, its pictures NAME_*.png and the tables of NAME.md; returns what was written."""
    page = docs / f"{name}.md"
    text = rendered(page.read_text(encoding="utf-8"), tables, with_noted(name, result, docs))
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
