"""What any result is shown with: one document, made in one place, rendered as terminal text, HTML page and JSON.

A kind of result has one builder, `report/<kind>.py`, from its record to a `Document`. Columns of a table say once how a
number is called in JSON, on the page and on the terminal; sentences, captions and warnings stand in the builder alone.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from pliant import __version__

Row = TypeVar("Row")
Cells = Sequence[str]


@dataclass(frozen=True)
class Column(Generic[Row]):
    """One number or text of every row, declared once for all renderers.

    Attributes:
        value: the row's plain SI value, as JSON keeps it.
        key: its JSON key; "" where JSON does not have it.
        head: its heading on the page; "" where the page does not show it.
        brief: its heading on the terminal; "" where the terminal does not show it.
        text: the row's cell for people; by default the value itself as text.
        brief_text: the terminal's cell where it differs from the page's.
    """

    value: Callable[[Row], Any]
    key: str = ""
    head: str = ""
    brief: str = ""
    text: Callable[[Row], str] | None = None
    brief_text: Callable[[Row], str] | None = None

    def cell(self, row: Row, brief: bool = False) -> str:
        """The row's cell for people."""
        text = (self.brief_text or self.text) if brief else self.text
        return text(row) if text is not None else str(self.value(row))


def as_json(columns: Sequence[Column[Row]], row: Row) -> dict[str, Any]:
    """The row as a JSON object of the columns that have a key."""
    return {column.key: column.value(row) for column in columns if column.key}


@dataclass(frozen=True)
class Table:
    """A table of texts; columns from the index `numeric` on stand right-aligned."""

    title: str
    head: Cells
    rows: Sequence[Cells]
    note: str = ""
    numeric: int = 1


def page_table(
    title: str, columns: Sequence[Column[Row]], rows: Sequence[Row], note: str = "", numeric: int = 1
) -> Table:
    """The table of a page: the columns that have a `head`."""
    shown = [column for column in columns if column.head]
    return Table(
        title, [c.head for c in shown], [[c.cell(row) for c in shown] for row in rows], note, numeric
    )


def brief(table: Table) -> Table:
    """A page's table for the terminal, without title and note."""
    return replace(table, title="", note="")


def brief_table(columns: Sequence[Column[Row]], rows: Sequence[Row], note: str = "") -> Table:
    """The table of the terminal: the columns that have a `brief` heading."""
    shown = [column for column in columns if column.brief]
    return Table("", [c.brief for c in shown], [[c.cell(row, True) for c in shown] for row in rows], note)


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture of a page: its file's name, its caption, its PNG bytes (uint8)."""

    name: str
    caption: str
    png: NDArray[np.uint8]

    @property
    def data_url(self) -> str:
        """The picture as text that an <img> shows."""
        return "data:image/png;base64," + base64.b64encode(self.png.tobytes()).decode("ascii")


@dataclass(frozen=True, eq=False)
class Section:
    """A part of a page: paragraphs, pictures, tables, then a line of small print."""

    title: str
    pictures: tuple[Picture, ...] = ()
    tables: tuple[Table, ...] = ()
    note: str = ""
    text: tuple[str, ...] = ()


@dataclass(frozen=True)
class Warned:
    """A warning: one sentence and, where there are several cases, a list of them; `folded`: on the page alone."""

    sentence: str
    items: tuple[str, ...] = ()
    folded: bool = False


@dataclass(frozen=True, eq=False)
class Drawn:
    """What only a page has: its first picture and its sections; drawing them takes matplotlib."""

    hero: Picture | None
    sections: tuple[Section, ...]


def nothing_drawn() -> Drawn:
    """The pictures of a document that has no page of its own."""
    return Drawn(None, ())


@dataclass(frozen=True, eq=False)
class Document:
    """One result, ready for every renderer.

    Attributes:
        kind: the page's first line, e.g. "Pliant: model against measurement".
        title: the page's heading.
        sentence: the result as one sentence.
        data: the JSON object: plain SI values by the keys of docs/formats.md.
        brief: tables and lines that the terminal prints first.
        points: sentences beneath the result.
        warnings: what limits the result, the gravest first.
        closing: what the terminal prints last; the sentence where there is nothing else.
        draw: makes hero and sections; called where a page is written only.
        footer: the page's last line.
        page: the name of the page's file.
        version: of Pliant that made what the page shows.
    """

    kind: str
    title: str
    sentence: str
    data: Mapping[str, Any] = field(default_factory=dict)
    brief: tuple[Table | str, ...] = ()
    points: tuple[str, ...] = ()
    warnings: tuple[Warned, ...] = ()
    closing: tuple[str, ...] = ()
    draw: Callable[[], Drawn] = nothing_drawn
    footer: str = ""
    page: str = "report.html"
    version: str = __version__


@dataclass(frozen=True, eq=False)
class Page:
    """A rendered page, and its pictures as the bytes of PNG files (uint8) by name."""

    html: str
    pictures: Mapping[str, NDArray[np.uint8]]


def numbered(name: str, number: int) -> str:
    """A picture's name in a page of several designs."""
    return name if number == 0 else f"{name}_{number + 1}"


def capital(text: str) -> str:
    """The text with its first letter large, as a sentence begins."""
    return text[:1].upper() + text[1:]
