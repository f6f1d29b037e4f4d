"""The renderers of a `Document`: terminal lines and the self-contained HTML page. JSON is `document.data` itself."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from pliant.formatting import displayed_in, units_footer
from pliant.report.document import Document, Drawn, Page, Picture, Table, Warned
from pliant.user_text import escape_controls

if TYPE_CHECKING:
    from markupsafe import Markup
    from rich.table import Table as RichTable


MOST_NOTES = 5
SETTLE_FIRST = (
    "A value in the file is probably wrong (first note): correct it before you use the other results."
)


def terminal(document: Document, has_page: bool = False) -> Iterator[RichTable | str]:
    """Yield everything that a terminal prints, in order: unit doubts, tables and lines, notes, the sentence.

    `has_page`: a page has all notes, so the terminal shows the gravest ones and counts the rest.
    """
    unfolded = [warned for warned in document.ranked if not warned.folded]
    shown = unfolded[:MOST_NOTES] if has_page else unfolded
    doubts = shown[: len(document.unit_doubts)]
    yield from (line for warned in doubts for line in _note(warned))
    for block in document.brief:
        if isinstance(block, str):
            yield block
        else:
            yield rich_table(block)
            if block.note:
                yield block.note
    for warned in shown[len(doubts) :]:
        yield from _note(warned)
    if more := len(unfolded) - len(shown):
        yield f"note: {more} more in the report."
    yield from (f"note: {warned.sentence}" for warned in document.ranked if warned.folded)
    yield from document.closing or filter(None, [document.sentence])
    if doubts:
        yield SETTLE_FIRST


def _note(warned: Warned) -> Iterator[str]:
    yield f"note: {warned.sentence}"
    yield from (f"  {item}" for item in warned.items)


def rich_table(table: Table) -> RichTable:
    """Return a table of the terminal: words wrap where space is short, numbers are not wrapped and right-aligned."""
    from rich.table import Table as RichTable  # needed only on a terminal

    made = RichTable(box=None, pad_edge=False, header_style="bold")
    for number, head in enumerate(table.head):
        if number < table.numeric:
            made.add_column(head, overflow="fold")
        else:
            widest = max((len(row[number]) for row in table.rows), default=0)
            made.add_column(head, justify="right", no_wrap=True, min_width=max(len(head), widest, 6))
    for row in table.rows:
        made.add_row(*row)
    return made


def page(document: Document) -> Page:
    """Return the document as one self-contained HTML page: no network, pictures inside, readable without its scripts.

    The same document gives the same bytes. Every text is escaped.
    """
    with displayed_in(document.units):
        drawn = document.draw()
        stills = {picture.name: picture.png for picture in _pictures(drawn)}
        footer = document.footer or units_footer(lengths="m", pressures="Pa") + ", world frame with z up"
    html = page_template().render(
        kind=document.kind,
        title=document.title,
        sentence=document.sentence,
        answers=document.answers,
        settle_first=SETTLE_FIRST if document.unit_doubts else "",
        points=document.points,
        hero=drawn.hero,
        warnings=document.ranked,
        shown=MOST_NOTES,
        sections=drawn.sections,
        version=document.version,
        footer=footer,
        moving=moving(
            any(picture.chart is not None for picture in _pictures(drawn)),
            any(picture.scene is not None for picture in _pictures(drawn)),
        ),
    )
    return Page(escape_controls(html), stills)


def _pictures(drawn: Drawn) -> list[Picture]:
    pictures = [picture for section in drawn.sections for picture in section.pictures]
    return [drawn.hero, *pictures] if drawn.hero is not None else pictures


@dataclass(frozen=True)
class Moving:
    """Style and code of the interactive parts of a page: our text, never a user's."""

    style: Markup
    code: tuple[Markup, ...]


@cache
def moving(charts: bool = True, scenes: bool = True) -> Moving:
    """Return the code for tables, `scenes` and `charts`; axes of charts are uPlot's (MIT)."""
    from markupsafe import Markup  # jinja's own type

    templates = files("pliant.report") / "templates"
    vendor = templates / "vendor"
    code, style = [templates / "tables.js"], [templates / "moving.css"]
    if scenes:
        code = [templates / "scene.js", *code]
    if charts:
        code, style = [vendor / "uPlot.js", templates / "chart.js", *code], [vendor / "uPlot.css", *style]
    if scenes or charts:
        code = [templates / "parts.js", *code]
    sheets = "\n".join(sheet.read_text("utf-8") for sheet in style)
    return Moving(Markup(sheets), tuple(Markup(script.read_text("utf-8")) for script in code))


def script_hashes() -> tuple[str, ...]:
    """Return the content security policy sources that allow only the scripts of our pages: ``'sha256-…'``."""
    digests = (hashlib.sha256(code.encode("utf-8")).digest() for code in moving().code)
    return tuple(f"'sha256-{base64.b64encode(digest).decode('ascii')}'" for digest in digests)


def fragment(document: Document) -> str:
    """Return the document as a short piece of HTML for a notebook's cell: sentence, first tables, limits of the result.

    Points and warnings are folded. Every text is escaped.
    """
    return escape_controls(
        page_template("fragment.html.j2").render(
            document=document,
            tables=[block for block in document.brief if isinstance(block, Table)],
        )
    )


@cache
def page_template(name: str = "report.html.j2") -> Any:
    """Return a compiled template, a data file in this package and so part of its code fingerprint."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(str(files("pliant.report") / "templates")),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name)
