"""A study's page: marks as in `benchmarks.pages`, and numbers within the prose, from the study's JSON.

    <!-- study: NAME --> … <!-- end -->                    a table or picture of the page's module
    <!-- value: PATH FORM -->…<!-- end value -->           a number

A PATH leads through the JSON by `/`; one that begins with `noted/` leads into NAME.noted.json, which contains numbers
of runs whose files were not kept, each with its description and the commit.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from benchmarks.output import ROOT, Bar
from benchmarks.pages import Result, Tables, table

from benchmarks import pages
from pliant.errors import UserError
from pliant.formatting import quantity
from pliant.store.store import write_atomically

DOCS = ROOT / "docs" / "studies"
MARK = pages.marks("study")
VALUE = re.compile(r"(<!-- value: (\S+) (\S+) -->).*?(<!-- end value -->)", re.DOTALL)
Pictures = Mapping[str, Callable[[Result], bytes | None]]


def millimetres(value_m: float | None, digits: int = 2) -> str:
    """Format as 1.23 mm; a dash for None."""
    return "–" if value_m is None else f"{1e3 * value_m:.{digits}f} mm"


def percent(share: float | None, digits: int = 2) -> str:
    """Format as 1.2 %; a dash for None."""
    return "–" if share is None else f"{100 * share:.{digits}g} %"


def clock(wall_s: float | None) -> str:
    """Format a time in a suitable unit; a dash for None."""
    if wall_s is None:
        return "–"
    if wall_s < 120:
        return f"{wall_s:.1f} s"
    return f"{wall_s / 60:.1f} min" if wall_s < 7200 else f"{wall_s / 3600:.3g} h"


def number(value: float | None, digits: int = 3) -> str:
    """Format a plain number; a dash for None and for other values."""
    return "–" if value is None or math.isnan(value) else f"{value:.{digits}g}"


FORMS: Mapping[str, Callable[[Any], str]] = {
    "mm": millimetres,
    "mm1": lambda value: millimetres(value, 1),
    "time": clock,
    "percent": lambda value: percent(value, 1),
    "score": lambda value: f"{value:.3f}",
    "number": number,
    "text": str,
}


def state(result: Result) -> Iterator[str]:
    """Yield the machine, versions and changes of a study's run."""
    here, changes = result["machine"], ", ".join(f"`{override}`" for override in result["overrides"])
    load = "" if here["load"] is None else f", load {here['load']:.1f} at the start"
    yield (
        f"Run on {here['processor']}, {here['cores']} cores, Python {here['python']}{load}, "
        f"with Pliant {result['pliant']}. The reference kernel "
        f"({result['reference_kernel']}) took {1e3 * result['reference_kernel_s']:.0f} ms beside the first search."
        f"{f' Every study was changed: {changes}.' if changes else ''}"
    )


def reached(result: Result) -> Iterator[str]:
    """Return a table of the targets and whether they were met."""
    verdicts = {None: "", True: "met", False: "**missed**"}
    bars = [Bar.from_result(one) for one in result["bars"]]
    return table(
        "what | to reach | reached | | published",
        (
            (
                bar.what, f"{'≤' if bar.at_most else '≥'} {bar.shown(bar.bar)}", bar.shown(bar.reached),
                verdicts[bar.met], bar.published or "–",
            )
            for bar in bars
        ),
    )  # fmt: skip


def laws(result: Result, keys: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """Yield rows of the errors of the searches' laws against direct FEM of the winners, by these keys."""
    for name, run in result["runs"].items():
        for law in (run["verified"] or {}).get("laws", ()):
            shares = (percent(law.get(key)) for key in keys)
            yield (f"`{name}`", law["name"], str(law["n_states"]), *shares)


def values(columns: Mapping[str, Mapping[str, Any]], units: Mapping[str, str]) -> Iterator[str]:
    """Return a row per variable, a column per design; `units` are SI."""

    def shown(name: str, value: Any) -> str:
        unit = units.get(name, "")
        if value is None:
            return "–"
        return str(value) if isinstance(value, int) and not unit else quantity(value, unit, 4)

    names = dict.fromkeys(name for own in columns.values() for name in own)
    rows = ((name, *(shown(name, own.get(name)) for own in columns.values())) for name in names)
    return table(f"variable | {' | '.join(columns)}", rows)


def shown_pictures(study: str, pictures: Pictures, words: Mapping[str, str]) -> Tables:
    """Return marks that show the pictures of a study, if there are any."""

    def shows(label: str) -> Callable[[Result], Iterable[str]]:
        link = f"![{words[label]}]({study}_{label}.png)"
        return lambda result: [link] if pictures[label](result) is not None else []

    return {label: shows(label) for label in pictures}


def rendered(text: str, tables: Tables, result: Result) -> str:
    """Return a page's text with its tables and numbers updated. Raises `UserError` for an unknown name."""
    return VALUE.sub(
        lambda match: f"{match[1]}{_value(match[2], match[3], result)}{match[4]}",
        pages.rendered(text, MARK, tables, result),
    )


def with_noted(name: str, result: Result, docs: Path = DOCS) -> Result:
    """Return the result with the numbers of NAME.noted.json, if a page has one."""
    file = docs / f"{name}.noted.json"
    return {**result, "noted": json.loads(file.read_text(encoding="utf-8"))} if file.exists() else result


def _value(path: str, form: str, result: Result) -> str:
    """Format a number of the JSON; a dash if its part has not run."""
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
