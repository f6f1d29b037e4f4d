"""The renderers of a `Document`: terminal lines and the self-contained HTML page. JSON is `document.data` itself."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from pliant.formatting import displayed_in, units_of_page
from pliant.report.document import Document, Drawn, Page, Picture, Table, Warned
from pliant.user_text import visible

if TYPE_CHECKING:
    from markupsafe import Markup
    from rich.table import Table as RichTable


MOST_NOTES = 5
SETTLE_FIRST = "Something in the file looks wrong (first note): settle that first, then believe the rest."


def terminal(document: Document, has_page: bool = False) -> Iterator[RichTable | str]:
    """Everything that a terminal prints, in its order: unit doubts, tables and lines, notes, the sentence.

    `has_page`: a page has all notes, so that the terminal shows the gravest ones and counts the rest.
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
    """A table of the terminal: the first column may be cut, the others stand right-aligned."""
    from rich.table import Table as RichTable  # a page needs none

    made = RichTable(box=None, pad_edge=False, header_style="bold")
    for number, head in enumerate(table.head):
        if number < table.numeric:
            made.add_column(head, no_wrap=True, overflow="ellipsis")
        else:
            made.add_column(head, justify="right", no_wrap=True, min_width=max(len(head), 6))
    for row in table.rows:
        made.add_row(*row)
    return made


def page(document: Document) -> Page:
    """The document as one self-contained HTML page: no network, pictures inside, readable without its scripts.

    The same document gives the same bytes. Every text is escaped.
    """
    with displayed_in(document.units):
        drawn = document.draw()
        footer = document.footer or units_of_page(lengths="m", pressures="Pa") + ", world frame with z up"
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
    return Page(visible(html), {picture.name: picture.png for picture in _pictures(drawn)})


def _pictures(drawn: Drawn) -> list[Picture]:
    pictures = [picture for section in drawn.sections for picture in section.pictures]
    return [drawn.hero, *pictures] if drawn.hero is not None else pictures


@dataclass(frozen=True)
class Moving:
    """Style and code of what a reader can move on a page: text of ours, never of a user's."""

    style: Markup
    code: tuple[Markup, ...]


@cache
def moving(charts: bool = True, scenes: bool = True) -> Moving:
    """For tables alone, or for `scenes` and `charts` too; axes of charts are uPlot's (MIT), the app's own copy."""
    from markupsafe import Markup  # jinja's own

    templates, vendor = files("pliant.report") / "templates", files("pliant.app") / "static" / "vendor"
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
    """Sources of a content security policy that allow the scripts of our pages and no other: ``'sha256-…'``."""
    digests = (hashlib.sha256(code.encode("utf-8")).digest() for code in moving().code)
    return tuple(f"'sha256-{base64.b64encode(digest).decode('ascii')}'" for digest in digests)


def fragment(document: Document) -> str:
    """The document as a short piece of HTML for a notebook's cell: sentence, first tables, what limits the result.

    Points and warnings are folded. Every text is escaped.
    """
    return visible(
        page_template("fragment.html.j2").render(
            document=document,
            tables=[block for block in document.brief if isinstance(block, Table)],
        )
    )


@cache
def page_template(name: str = "report.html.j2") -> Any:
    """A compiled template, a data file beside the code, which the code fingerprint of this room holds."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(str(files("pliant.report") / "templates")),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name)
