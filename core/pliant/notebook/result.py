"""A result at a prompt: one line as text, a short page in a notebook, a frame, a picture; its attributes."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pliant.errors import MissingDependencyError
from pliant.pipeline.study import StudyRun
from pliant.records.design import Array
from pliant.records.law import JointLaw
from pliant.report.document import Document, Picture, Table, brief
from pliant.report.moving_picture import MovingPicture
from pliant.report.render import fragment, page
from pliant.report.stage import write_page

if TYPE_CHECKING:
    import pandas

Record = TypeVar("Record")
LONGEST = 160  # characters of a result's one line


def data_frame(columns: Any, index: Any = None) -> pandas.DataFrame:
    """Return columns as a pandas frame; raises `MissingDependencyError` where pandas is not installed."""
    try:
        import pandas
    except ImportError:
        raise MissingDependencyError("frames need pandas: pip install 'pliant[notebook]'.") from None
    return pandas.DataFrame(columns, index=index)


class Result(Generic[Record]):
    """The result of one step of a study.

    Attributes that this class does not define are read from `record`, the frozen data behind it (SI, unit in the name).

    Attributes:
        record: the data.
        plot: name of the page's picture that `plot` draws, and number of its panel; by default the first picture.
        still: returns a picture of a user's own model as PNG bytes for notebooks; None without one.
    """

    def __init__(
        self,
        record: Record,
        document: Callable[[], Document],
        plot: tuple[str, int] = ("", 0),
        frame: Callable[[Record], dict[str, Any]] | None = None,
        still: Callable[[], bytes | None] | None = None,
    ) -> None:
        self.record = record
        self._write_document, self._plot, self._frame = document, plot, frame
        self._still = still

    @cached_property
    def document(self) -> Document:
        """Return the sentences, tables and pictures that the command line prints; they are written when first read."""
        return self._write_document()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self.record, name)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *(n for n in dir(self.record) if not n.startswith("_"))})

    def __repr__(self) -> str:
        text = " ".join(f"{self.document.title}: {self.document.sentence}".split())
        return f"<{text if len(text) <= LONGEST else text[: LONGEST - 1] + '…'}>"

    def __str__(self) -> str:
        return self.document.sentence

    def _repr_html_(self) -> str:
        seen = self._still() if self._still is not None else None
        if seen is None:
            return fragment(self.document)
        code = base64.b64encode(seen).decode("ascii")
        return f'{fragment(self.document)}<img alt="the model" src="data:image/png;base64,{code}">'

    @property
    def json(self) -> dict[str, Any]:
        """Return the JSON object of the command: plain SI values.

        >>> finger.simulate().json["converged"]
        True
        """
        return dict(self.document.data)

    def to_frame(self) -> pandas.DataFrame:
        """Return the numbers as a pandas frame, SI, with the unit in each column's name.

        A result without such numbers gives its first table as printed. Raises `MissingDependencyError` without pandas.

        >>> joint.compare().to_frame().columns.tolist()
        ['run', 'time_s', 'output', 'measured', 'predicted', 'residual']
        """
        if self._frame is not None:
            return data_frame(self._frame(self.record))
        tables = [block for block in self.document.brief if isinstance(block, Table)]
        if not tables:
            tables = [brief(table) for part in self.document.draw().sections for table in part.tables]
        head = tables[0].head if tables else []
        return data_frame({name: [row[k] for row in tables[0].rows] for k, name in enumerate(head)})

    def plot(self, ax: Any = None, *, interactive: bool = False) -> Any:
        """Draw the main picture on these matplotlib axes or on new ones; returns the axes.

        Args:
            ax: the axes; none for an interactive picture.
            interactive: return instead the page's first interactive picture (zoom, values under the pointer, runs
                switched on and off), which a notebook shows and `.save(file)` writes as one HTML file.

        Raises:
            ValueError: the result has no picture, or no interactive one.

        >>> finger.simulate().plot().get_xlabel()
        'x (mm)'
        """
        if interactive:
            return self._moving()
        from pliant.report.moving_picture import on_axes

        name, panel = self._plot
        pictures = self._pictures()
        shown = next((one for one in pictures if one.name == name), next(iter(pictures), None))
        if shown is None:
            raise ValueError("this result has no picture")
        return on_axes(shown, panel, ax)

    def _pictures(self) -> list[Picture]:
        drawn = self.document.draw()
        pictures = [drawn.hero, *(picture for part in drawn.sections for picture in part.pictures)]
        return [picture for picture in pictures if picture is not None]

    def _moving(self) -> MovingPicture:
        for one in self._pictures():
            if one.chart is not None:
                return MovingPicture(one)
        raise ValueError("this result has no picture that moves; plot() draws the still one.")

    def save(self, folder: str | Path) -> Path:
        """Write the whole page with its pictures into a folder and return the page's path.

        >>> finger.simulate().save(store / "page").name
        'report.html'
        """
        made = page(self.document)
        Path(folder).mkdir(parents=True, exist_ok=True)
        return write_page(Path(folder), made.html, made.pictures, self.document.page)


class Simulated(Result[StudyRun]):
    """A simulated study; `tip`, `markers`, `metrics` and `joint_angles` are those of its first engine."""

    @property
    def _final(self) -> Any:
        return self.record.engines[0].result

    @property
    def tip(self) -> Array:
        """(3,) settled position of the tip in the world, m.

        >>> finger.simulate().tip.round(3)
        array([ 0.059,  0.   , -0.008])
        """
        return self._final.final.tip_m

    @property
    def markers(self) -> Array:
        """(n + 2, 3) base, joints 1…n and tip in the world, m.

        >>> finger.simulate().markers.shape
        (10, 3)
        """
        return self._final.final.markers_m

    @property
    def joint_angles(self) -> Array:
        """(n, a) joint coordinates, rad (m where the joint slides).

        >>> float(finger.simulate().joint_angles[0, 0].round(4))
        0.3597
        """
        return self._final.final.joint_angles

    @property
    def metrics(self) -> Mapping[str, Any]:
        """Return the task's metrics, SI, unit in the name.

        >>> round(finger.simulate().metrics["bend_angle_rad"], 3)
        2.878
        """
        return self._final.metrics

    @property
    def law(self) -> JointLaw:
        """The law of the first design.

        >>> finger.simulate().law.actuation_name
        'pressure_pa'
        """
        return self.record.designs[0].law.law

    @property
    def converged(self) -> bool:
        """Return whether the engine reached its own tolerance.

        >>> finger.simulate().converged
        True
        """
        return bool(self._final.final.converged)
