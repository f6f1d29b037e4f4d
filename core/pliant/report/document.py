"""The document of a result: built in one place, rendered as terminal text, HTML page and JSON.

A kind of result has one builder, `report/<kind>.py`, from its record to a `Document`. Columns of a table define once
the name of a number in JSON, on the page and on the terminal; sentences, captions and warnings are only in the builder.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from pliant import __version__
from pliant.formatting import Unit, displayed, number
from pliant.records.remark import Rank
from pliant.report.chart import Chart
from pliant.report.chart_json import as_script_data
from pliant.report.scene import DrawnScene

Row = TypeVar("Row")
Cells = Sequence[str]


@dataclass(frozen=True)
class Column(Generic[Row]):
    """One number or text of every row, declared once for all renderers.

    ``Column("share_of_error", head="of the error", brief="error", show=whole_percent)`` appears in JSON under the name
    of the attribute, on the page and on the terminal.

    Attributes:
        value: the row's plain SI value, as in JSON: a path of attributes, keys and indices from the row, such as
            "1.noise.within", or a function of the row.
        key: its JSON key; by default the last part of the path, without a key for a function; "" omits it in JSON.
        head: its heading on the page; "" omits it on the page.
        brief: its heading on the terminal; "" omits it on the terminal.
        text: the row's displayed cell, where it depends on more than the value.
        brief_text: the terminal's cell where it differs from the page's.
        show: the value's displayed cell: significant digits of a number, a display unit, or a function of the value;
            by default the value itself as text.
        brief_show: the same for the terminal where it differs from the page's.
        unit: display unit of the row; `show` are then digits in this unit, which only the terminal writes after them.
        none: the cell of an absent value (None), also if a part of the path is absent.
    """

    value: str | Callable[[Row], Any]
    key: str | None = None
    head: str = ""
    brief: str = ""
    text: Callable[[Row], str] | None = None
    brief_text: Callable[[Row], str] | None = None
    show: int | Unit | Callable[[Any], str] = str
    brief_show: int | Unit | Callable[[Any], str] | None = None
    unit: Callable[[Row], Unit] | None = None
    none: str = "–"

    @property
    def json_key(self) -> str:
        """The key; "" where JSON does not have the column."""
        return (
            self.key
            if self.key is not None
            else ""
            if callable(self.value)
            else self.value.rpartition(".")[2]
        )

    def plain_value(self, row: Row) -> Any:
        """Return the row's plain value."""
        if callable(self.value):
            return self.value(row)
        value: Any = row
        for part in self.value.split("."):
            if value is None:
                return None
            if isinstance(value, Mapping):
                value = value[part]
            else:
                value = value[int(part)] if part.isdigit() else getattr(value, part)
        return value

    def cell(self, row: Row, brief: bool = False) -> str:
        """Return the row's cell for people."""
        if brief and self.brief_text is not None:
            return self.brief_text(row)
        show = self.brief_show if brief else None
        if show is None and self.text is not None:
            return self.text(row)
        show, value = self.show if show is None else show, self.plain_value(row)
        if value is None:
            return self.none
        if callable(show):
            return show(value)
        if isinstance(show, Unit):
            return show.text(value)
        if self.unit is None:
            return number(value, show)
        unit = self.unit(row)
        return unit.text(value, show) if brief else number(value * unit.factor, show)


def as_json(columns: Sequence[Column[Row]], row: Row) -> dict[str, Any]:
    """Return the row as a JSON object of the columns that have a key."""
    values = {column.json_key: column.plain_value(row) for column in columns if column.json_key}
    return {key: list(value) if type(value) is tuple else value for key, value in values.items()}


@dataclass(frozen=True)
class Table:
    """A table of texts; columns from the index `numeric` on are right-aligned."""

    title: str
    head: Cells
    rows: Sequence[Cells]
    note: str = ""
    numeric: int = 1


def page_table(
    title: str, columns: Sequence[Column[Row]], rows: Sequence[Row], note: str = "", numeric: int = 1
) -> Table:
    """Return the table of a page: the columns that have a `head`."""
    shown = [column for column in columns if column.head]
    return Table(
        title, [c.head for c in shown], [[c.cell(row) for c in shown] for row in rows], note, numeric
    )


def optional_table(
    title: str, head: Cells, rows: Sequence[Cells], note: str = "", numeric: int = 1
) -> Table | None:
    """Return the table; None without rows."""
    return Table(title, head, rows, note, numeric) if rows else None


def named_values(title: str, values: Mapping[str, str | None], note: str = "") -> Table:
    """Return a table of names and texts; names without a text are left out."""
    return Table(
        title, ["", "value"], [[name, text] for name, text in values.items() if text], note, numeric=9
    )


def brief(table: Table) -> Table:
    """Return a page's table for the terminal, without title and note."""
    return replace(table, title="", note="")


def brief_table(columns: Sequence[Column[Row]], rows: Sequence[Row], note: str = "") -> Table:
    """Return the table of the terminal: the columns that have a `brief` heading."""
    shown = [column for column in columns if column.brief]
    return Table("", [c.brief for c in shown], [[c.cell(row, True) for c in shown] for row in rows], note)


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture of a page: its file's name, its caption, and the chart, or the PNG bytes (uint8) of another picture.

    A page shows the chart, or the 3D `scene`, in place of the still where scripts are allowed.
    """

    name: str
    caption: str
    source: Chart | NDArray[np.uint8]
    scene: DrawnScene | None = None

    @property
    def chart(self) -> Chart | None:
        """The chart; None for another picture."""
        return self.source if isinstance(self.source, Chart) else None

    @cached_property
    def png(self) -> NDArray[np.uint8]:
        """The still as PNG bytes."""
        if not isinstance(self.source, Chart):
            return self.source
        from pliant.report.still import still  # matplotlib takes a second to import

        return still(self.source)

    @property
    def data_url(self) -> str:
        """Return the picture as text that an <img> shows."""
        return "data:image/png;base64," + base64.b64encode(self.png.tobytes()).decode("ascii")

    @property
    def script_data(self) -> str:
        """Return the scene or the chart as JSON for a script element; "" without either."""
        if self.scene is not None:
            return self.scene.script_data
        return "" if self.chart is None else as_script_data(self.chart)


@dataclass(frozen=True, eq=False)
class Section:
    """A part of a page: paragraphs, verbatim lines of a file, pictures, tables, then a line of small print.

    Folded on the page unless `open`.
    """

    title: str
    pictures: tuple[Picture, ...] = ()
    tables: tuple[Table, ...] = ()
    note: str = ""
    text: tuple[str, ...] = ()
    open: bool = False
    code: str = ""


def picture(name: str, caption: str, source: Chart | NDArray[np.uint8] | None) -> Picture | None:
    """Return the picture, or None where there is nothing to show."""
    return None if source is None else Picture(name, caption, source)


def section(
    title: str,
    *parts: Picture | Table | None,
    text: str | Sequence[str] = (),
    note: str = "",
    open: bool = False,
) -> Section | None:
    """Return a section of the given pictures and tables; None without any.

    Args:
        title: its heading, shown also when folded.
        parts: its pictures and tables.
        text: one paragraph or several.
        note: small print.
        open: whether it is the main evidence, which is not folded.
    """
    pictures = tuple(part for part in parts if isinstance(part, Picture))
    tables = tuple(part for part in parts if isinstance(part, Table))
    paragraphs = tuple(filter(None, [text] if isinstance(text, str) else text))
    return Section(title, pictures, tables, note, paragraphs, open) if pictures or tables else None


@dataclass(frozen=True)
class Warned:
    """A warning: one sentence and, for several cases, a list of them; `folded`: folded on the page."""

    sentence: str
    items: tuple[str, ...] = ()
    folded: bool = False
    rank: Rank = Rank.DATA


@dataclass(frozen=True, eq=False)
class Drawn:
    """The parts that only a page has: its first picture and its sections; drawing them needs matplotlib."""

    hero: Picture | None
    sections: tuple[Section, ...]


def drawn(hero: Picture | None = None, *sections: Section | None) -> Drawn:
    """Return a page of the given sections."""
    return Drawn(hero, tuple(section for section in sections if section is not None))


@dataclass(frozen=True, eq=False)
class Document:
    """One result, ready for every renderer.

    Attributes:
        kind: the page's first line, e.g. "Pliant: model against measurement".
        title: the page's heading.
        sentence: the result as one sentence.
        data: the JSON object: plain SI values by the keys of docs/formats.md.
        brief: tables and lines that the terminal prints first.
        answers: label and text of up to four lines before the first picture: quality, missing effect, certainty,
            next step.
        points: sentences beneath the result, folded on a page that has answers.
        warnings: limits of the result; renderers show them by rank.
        closing: last text of the terminal; by default the sentence.
        draw: makes hero and sections; called only when a page is written.
        footer: the page's last line.
        page: the name of the page's file.
        version: of Pliant that computed the result.
        units: those that preceded the usual ones when it was made (`pliant.formatting.displayed_in`); used again
            for drawing.
    """

    kind: str
    title: str
    sentence: str
    data: Mapping[str, Any] = field(default_factory=dict)
    brief: tuple[Table | str, ...] = ()
    answers: tuple[tuple[str, str], ...] = ()
    points: tuple[str, ...] = ()
    warnings: tuple[Warned, ...] = ()
    closing: tuple[str, ...] = ()
    draw: Callable[[], Drawn] = drawn
    footer: str = ""
    page: str = "report.html"
    version: str = __version__
    units: Mapping[str, Unit] = field(default_factory=displayed)

    @property
    def ranked(self) -> tuple[Warned, ...]:
        """Return the warnings, the gravest first, folded ones last."""
        return tuple(sorted(self.warnings, key=lambda warned: (warned.folded, warned.rank)))

    @property
    def unit_doubts(self) -> tuple[Warned, ...]:
        """Return warnings that must be settled before other results are used."""
        return tuple(warned for warned in self.warnings if warned.rank == Rank.UNIT)


@dataclass(frozen=True, eq=False)
class Page:
    """A rendered page, and its pictures as the bytes of PNG files (uint8) by name."""

    html: str
    pictures: Mapping[str, NDArray[np.uint8]]


def answers(
    good: str = "", missing: str = "", sure: str = "", after: str = ""
) -> tuple[tuple[str, str], ...]:
    """Return the non-empty lines before a page's first picture: quality, missing effect, certainty, next step."""
    lines = (("How good", good), ("What is missing", missing), ("How sure", sure), ("What next", after))
    return tuple((label, capital(text)) for label, text in lines if text)


def numbered(name: str, number: int) -> str:
    """Return a picture's name in a page of several designs."""
    return name if number == 0 else f"{name}_{number + 1}"


def capital(text: str) -> str:
    """Return the text with its first letter capitalised."""
    return text[:1].upper() + text[1:]
