"""A picture of a page that moves by itself: in a notebook's cell, or as a file."""

from __future__ import annotations

import html
from dataclasses import dataclass
from pathlib import Path

from pliant.report.document import Picture
from pliant.report.render import moving, page_template
from pliant.store.store import write_atomically
from pliant.user_text import visible

HEIGHT_PX = 620


@dataclass(frozen=True, eq=False)
class MovingPicture:
    """A picture with its chart. A notebook shows it in a frame of its own, in which our scripts alone run."""

    picture: Picture

    @property
    def html(self) -> str:
        """One self-contained page of the picture; it needs no network, and shows the still one without scripts."""
        shown = page_template("picture.html.j2").render(picture=self.picture, moving=moving())
        return visible(shown)

    def _repr_html_(self) -> str:
        frame = f"width:100%;height:{HEIGHT_PX}px;border:0"
        return f'<iframe sandbox="allow-scripts" style="{frame}" srcdoc="{html.escape(self.html)}"></iframe>'

    def __repr__(self) -> str:
        return f"<moving picture {self.picture.name}: shown in a notebook, written by save(file)>"

    def save(self, file: str | Path) -> Path:
        """Write the page; returns its path."""
        path = Path(file)
        write_atomically(path, self.html)
        return path
