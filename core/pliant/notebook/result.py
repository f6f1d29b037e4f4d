"""A result at a prompt: one line as text, a short page in a notebook, a frame, a picture; its record's attributes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pliant.errors import MissingDependencyError
from pliant.pipeline.segments import DesignStages
from pliant.pipeline.study import StudyRun
from pliant.records.design import Array
from pliant.records.law import JointLaw
from pliant.report.document import Document, Table, brief
from pliant.report.moving_picture import MovingPicture
from pliant.report.render import fragment, page
from pliant.report.stage import write_page

if TYPE_CHECKING:
    import pandas

Record = TypeVar("Record")
LONGEST = 160  # characters of a result's one line


def frame_of(columns: Any, index: Any = None) -> pandas.DataFrame:
    """Columns as a pandas frame; raises `MissingDependencyError` where pandas is not installed."""
    try:
        import pandas
    except ImportError:
        raise MissingDependencyError("frames need pandas: pip install 'pliant[notebook]'.") from None
    return pandas.DataFrame(columns, index=index)


class Result(Generic[Record]):
    """What a step of a study gives.

    Attributes that it has not itself are those of its `record`, the frozen data behind it (SI, unit in the name).

    Attributes:
        record: the data.
        document: its sentences, tables and pictures: what the command line prints.
    """

    def __init__(
        self,
        record: Record,
        document: Document,
        plot: Callable[[Record, Any], Any] | None = None,
        frame: Callable[[Record], dict[str, Any]] | None = None,
    ) -> None:
        self.record, self.document = record, document
        self._plot, self._frame = plot, frame

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
        return fragment(self.document)

    @property
    def json(self) -> dict[str, Any]:
        """The JSON object of the command: plain SI values.

        >>> finger.simulate().json["converged"]
        True
        """
        return dict(self.document.data)

    def to_frame(self) -> pandas.DataFrame:
        """The numbers as a pandas frame, SI, with the unit in each column's name where the result has a table of its
        own; else its first table as it is printed. Raises `MissingDependencyError` without pandas.

        >>> joint.compare().to_frame().columns.tolist()
        ['run', 'time_s', 'output', 'measured', 'predicted', 'residual']
        """
        if self._frame is not None:
            return frame_of(self._frame(self.record))
        tables = [block for block in self.document.brief if isinstance(block, Table)]
        if not tables:
            tables = [brief(table) for part in self.document.draw().sections for table in part.tables]
        head = tables[0].head if tables else []
        return frame_of({name: [row[k] for row in tables[0].rows] for k, name in enumerate(head)})

    def plot(self, ax: Any = None, *, interactive: bool = False) -> Any:
        """The one picture that says most, on these matplotlib axes or on new ones; returns the axes.

        Args:
            ax: the axes; none for an interactive picture.
            interactive: instead the first picture of the page that moves (zoom, values under the pointer, runs switched
                on and off), which a notebook shows and `.save(file)` writes as one HTML file.

        Raises:
            ValueError: the result has no picture, or none that moves.

        >>> finger.simulate().plot().get_xlabel()
        'x (mm)'
        """
        if interactive:
            return self._moving()
        if self._plot is not None:
            return self._plot(self.record, ax)
        from pliant.report.plots import image

        hero = self.document.draw().hero
        if hero is None:
            raise ValueError("this result has no picture")
        return image(hero, ax)

    def _moving(self) -> MovingPicture:
        drawn = self.document.draw()
        pictures = [drawn.hero, *(picture for part in drawn.sections for picture in part.pictures)]
        for one in pictures:
            if one is not None and one.chart is not None:
                return MovingPicture(one)
        raise ValueError("this result has no picture that moves; plot() draws the still one.")

    def save(self, folder: str | Path) -> Path:
        """Write the whole page with its pictures into a folder; returns the page's path.

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
        """What the task measured, SI, unit in the name.

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
        """Whether the engine reached its own tolerance.

        >>> finger.simulate().converged
        True
        """
        return bool(self._final.final.converged)


class Fitted(Result[tuple[DesignStages, ...]]):
    """The laws of a study's distinct designs."""

    @property
    def law(self) -> JointLaw:
        """The law of the first design: `law.evaluate(actuation, deformation)` gives τ and its slopes.

        >>> pliant.open(examples / "data/bellow_bending.yaml", store=store).fit().law.axes
        ('y',)
        """
        return self.record[0].law.law
