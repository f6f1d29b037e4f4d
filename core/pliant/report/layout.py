"""What every page is made of: pictures and tables in sections."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.report.facts import Table


@dataclass(frozen=True, eq=False)
class Page:
    """The report: a page, and its pictures as the bytes of PNG files (uint8) by name."""

    html: str
    pictures: Mapping[str, NDArray[np.uint8]]


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture of the page."""

    name: str
    caption: str
    png: NDArray[np.uint8]

    @property
    def data_url(self) -> str:
        """The picture as text that an <img> shows."""
        return "data:image/png;base64," + base64.b64encode(self.png.tobytes()).decode("ascii")


@dataclass(frozen=True, eq=False)
class Section:
    """A part of the page: paragraphs, pictures, tables, then a line of small print."""

    title: str
    pictures: tuple[Picture, ...] = ()
    tables: tuple[Table, ...] = ()
    note: str = ""
    text: tuple[str, ...] = ()
