"""A single picture of a page: interactive in a notebook's cell or as a file, or on matplotlib axes."""

from __future__ import annotations

import html
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pliant.report.document import Picture
from pliant.report.render import moving, page_template
from pliant.store.store import write_atomically
from pliant.user_text import escape_controls

HEIGHT_PX = 620


@dataclass(frozen=True, eq=False)
class MovingPicture:
    """A picture with its chart. A notebook shows it in a separate frame, in which only our scripts run."""

    picture: Picture

    @property
    def html(self) -> str:
        """Return one self-contained page of the picture; it needs no network, and is static without scripts."""
        shown = page_template("picture.html.j2").render(picture=self.picture, moving=moving())
        return escape_controls(shown)

    def _repr_html_(self) -> str:
        frame = f"width:100%;height:{HEIGHT_PX}px;border:0"
        return f'<iframe sandbox="allow-scripts" style="{frame}" srcdoc="{html.escape(self.html)}"></iframe>'

    def __repr__(self) -> str:
        return f"<moving picture {self.picture.name}: shown in a notebook, written by save(file)>"

    def save(self, file: str | Path) -> Path:
        """Write the page and return its path."""
        path = Path(file)
        write_atomically(path, self.html)
        return path


def on_axes(picture: Picture, panel: int = 0, axes: Any = None) -> Any:
    """Draw a panel of the picture's chart, or the whole of another picture, on matplotlib axes; None: new ones."""
    from matplotlib import pyplot  # takes a second to import

    from pliant.report.still import draw_panel

    if axes is None:
        axes = pyplot.subplots(layout="constrained")[1]
    if picture.chart is not None:
        draw_panel(axes, picture.chart.panels[min(panel, len(picture.chart.panels) - 1)], legend=True)
        return axes
    from PIL import Image

    axes.imshow(Image.open(io.BytesIO(picture.png.tobytes())))
    axes.set_axis_off()
    return axes
