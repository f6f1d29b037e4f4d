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
from pliant.formatting import Unit, displayed, number
from pliant.records.remark import Rank
from pliant.report.chart import Chart, as_script_data
from pliant.report.scene import DrawnScene

Row = TypeVar("Row")
Cells = Sequence[str]


@dataclass(frozen=True)
class Column(Generic[Row]):
    """One number or text of every row, declared once for all renderers.

    ``Column("share_of_error", head="of the error", brief="error", show=whole_percent)`` stands in JSON under the name
    of the attribute, on the page and on the terminal.

    Attributes:
        value: the row's plain SI value, as JSON keeps it: a path of attributes, keys and indices from the row, such as
            "1.noise.within", or a function of the row.
        key: its JSON key; by default the last part of the path, none for a function; "" where JSON does not have it.
        head: its heading on the page; "" where the page does not show it.
        brief: its heading on the terminal; "" where the terminal does not show it.
        text: the row's cell for people, where it takes more of the row than the value.
        brief_text: the terminal's cell where it differs from the page's.
        show: the value's cell for people: significant digits of a number, a display unit, or a function of the value;
            by default the value itself as text.
        brief_show: the same for the terminal where it differs from the page's.
        unit: display unit of the row; `show` are then digits in this unit, which the terminal alone writes behind them.
        none: the cell of a value that is None; so is every value behind a part of the path that is None.
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

    def of(self, row: Row) -> Any:
        """The row's plain value."""
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
        """The row's cell for people."""
        if brief and self.brief_text is not None:
            return self.brief_text(row)
        show = self.brief_show if brief else None
        if show is None and self.text is not None:
            return self.text(row)
        show, value = self.show if show is None else show, self.of(row)
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
    """The row as a JSON object of the columns that have a key."""
    values = {column.json_key: column.of(row) for column in columns if column.json_key}
    return {key: list(value) if type(value) is tuple else value for key, value in values.items()}


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


def optional_table(
    title: str, head: Cells, rows: Sequence[Cells], note: str = "", numeric: int = 1
) -> Table | None:
    """The table; None without rows."""
    return Table(title, head, rows, note, numeric) if rows else None


def named_values(title: str, values: Mapping[str, str | None], note: str = "") -> Table:
    """A table of names and texts; what has no text is left out."""
    return Table(
        title, ["", "value"], [[name, text] for name, text in values.items() if text], note, numeric=9
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
    """A picture of a page: its file's name, its caption, its PNG bytes (uint8), and the data behind it.

    A page shows the `chart`, or the `scene` in space, in place of the PNG where its reader lets scripts run.
    """

    name: str
    caption: str
    png: NDArray[np.uint8]
    chart: Chart | None = None
    scene: DrawnScene | None = None

    @property
    def data_url(self) -> str:
        """The picture as text that an <img> shows."""
        return "data:image/png;base64," + base64.b64encode(self.png.tobytes()).decode("ascii")

    @property
    def script_data(self) -> str:
        """The scene or the chart as JSON for a script element; "" without any."""
        if self.scene is not None:
            return self.scene.script_data
        return "" if self.chart is None else as_script_data(self.chart)


@dataclass(frozen=True, eq=False)
class Section:
    """A part of a page: paragraphs, lines of a file as they stand, pictures, tables, then a line of small print.

    Folded on the page unless `open`.
    """

    title: str
    pictures: tuple[Picture, ...] = ()
    tables: tuple[Table, ...] = ()
    note: str = ""
    text: tuple[str, ...] = ()
    open: bool = False
    code: str = ""


def picture(
    name: str, caption: str, png: NDArray[np.uint8] | None, chart: Chart | None = None
) -> Picture | None:
    """The picture, or None where nothing could be drawn."""
    return None if png is None else Picture(name, caption, png, chart)


def section(
    title: str,
    *parts: Picture | Table | None,
    text: str | Sequence[str] = (),
    note: str = "",
    open: bool = False,
) -> Section | None:
    """A section of the pictures and tables that are there; None without any.

    Args:
        title: its heading, which stands where it is folded.
        parts: what it shows.
        text: one paragraph or several.
        note: small print.
        open: it is the main evidence, and is not folded.
    """
    pictures = tuple(part for part in parts if isinstance(part, Picture))
    tables = tuple(part for part in parts if isinstance(part, Table))
    paragraphs = tuple(filter(None, [text] if isinstance(text, str) else text))
    return Section(title, pictures, tables, note, paragraphs, open) if pictures or tables else None


@dataclass(frozen=True)
class Warned:
    """A warning: one sentence and, where there are several cases, a list of them; `folded`: on the page alone."""

    sentence: str
    items: tuple[str, ...] = ()
    folded: bool = False
    rank: Rank = Rank.DATA


@dataclass(frozen=True, eq=False)
class Drawn:
    """What only a page has: its first picture and its sections; drawing them takes matplotlib."""

    hero: Picture | None
    sections: tuple[Section, ...]


def drawn(hero: Picture | None = None, *sections: Section | None) -> Drawn:
    """A page of the sections that are there."""
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
        answers: label and text of up to four lines that stand before the first picture: how good, what is missing,
            how sure, what next.
        points: sentences beneath the result, folded on a page that has answers.
        warnings: what limits the result; renderers show them by rank.
        closing: what the terminal prints last; the sentence where there is nothing else.
        draw: makes hero and sections; called where a page is written only.
        footer: the page's last line.
        page: the name of the page's file.
        version: of Pliant that made what the page shows.
        units: those that stood before the usual ones when it was made (`pliant.formatting.displayed_in`), and stand
            so when it is drawn.
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
        """The warnings, the gravest first, those that are folded last."""
        return tuple(sorted(self.warnings, key=lambda warned: (warned.folded, warned.rank)))

    @property
    def unit_doubts(self) -> tuple[Warned, ...]:
        """Warnings to settle before anything else is believed."""
        return tuple(warned for warned in self.warnings if warned.rank == Rank.UNIT)


@dataclass(frozen=True, eq=False)
class Page:
    """A rendered page, and its pictures as the bytes of PNG files (uint8) by name."""

    html: str
    pictures: Mapping[str, NDArray[np.uint8]]


def answers(
    good: str = "", missing: str = "", sure: str = "", after: str = ""
) -> tuple[tuple[str, str], ...]:
    """The lines before a page's first picture that have a text: how good, what is missing, how sure, what next."""
    lines = (("How good", good), ("What is missing", missing), ("How sure", sure), ("What next", after))
    return tuple((label, capital(text)) for label, text in lines if text)


def numbered(name: str, number: int) -> str:
    """A picture's name in a page of several designs."""
    return name if number == 0 else f"{name}_{number + 1}"


def capital(text: str) -> str:
    """The text with its first letter large, as a sentence begins."""
    return text[:1].upper() + text[1:]
