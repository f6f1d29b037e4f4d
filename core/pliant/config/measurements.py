"""The `measurements` block of a study, and the YAML file that may accompany a measurement."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, PrivateAttr, StringConstraints, model_validator

from pliant.config.chain import Count
from pliant.config.places import Places
from pliant.interfaces.base import FrozenModel
from pliant.units import Angle, Area, Frequency, Length, Ratio, Time

Name = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]


class ConditionColumn(FrozenModel):
    """What a column of a counts file sets. ``weights: task.extra_weights`` is short for ``{key: …}``."""

    key: Name = Field(description="a key of the study's task, e.g. task.object or task.object.radius")
    values: dict[str, Any] = Field(
        default_factory=dict,
        description="text in the file: value of the key; as written where it is not listed here",
    )


Condition = Annotated[
    ConditionColumn, BeforeValidator(lambda value: {"key": value} if isinstance(value, str) else value)
]


class PlausibleRange(FrozenModel):
    """A number of the task that is not known well, for `pliant diagnose` on counts."""

    key: Name = Field(description="e.g. task.friction")
    low: Ratio | str = Field(description="with its unit; the range is the central 90 % of the prior")
    high: Ratio | str = Field(description="the other end")
    where: dict[str, Any] = Field(
        default_factory=dict,
        description="only where these conditions were set, e.g. {task.object: cylinder}; everywhere by default",
    )

    @model_validator(mode="after")
    def _both_ways(self) -> PlausibleRange:
        if isinstance(self.low, str) != isinstance(self.high, str):
            raise ValueError("'low' and 'high' need to be both with a unit, or both plain numbers")
        if not isinstance(self.low, str) and not isinstance(self.high, str) and self.low >= self.high:
            raise ValueError("'low' should be below 'high'")
        return self


MOST_SAMPLES = 200_000


class ExcludedSpan(FrozenModel):
    """A part of a run whose readings are not used, or a whole run where neither a span nor lines are given."""

    run: Name = Field(description="the run's name, as in the file")
    start_s: Time | None = Field(None, description="from this time_s on; from the first sample")
    end_s: Time | None = Field(None, description="up to this time_s; up to the last sample")
    lines: tuple[Count, Count] | None = Field(
        None, description="first and last line of the file, instead of times"
    )
    why: str = Field("", description="said again wherever the span is mentioned")

    @model_validator(mode="after")
    def _one_way(self) -> ExcludedSpan:
        timed = self.start_s is not None or self.end_s is not None
        if timed and self.lines is not None:
            raise ValueError("give either 'start' and 'end' or 'lines', not both")
        if self.start_s is not None and self.end_s is not None and self.end_s < self.start_s:
            raise ValueError("'end' is before 'start'")
        if self.lines is not None and self.lines[1] < self.lines[0]:
            raise ValueError("the last of 'lines' is before the first")
        return self

    @property
    def whole_run(self) -> bool:
        return self.start_s is None and self.end_s is None and self.lines is None


def _as_list(value: Any) -> Any:
    """Return a list; one text or number becomes a list of one."""
    return [value] if isinstance(value, str | int | float) else value


def _as_text(value: Any) -> Any:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return repr(value).removesuffix(".0") if number else value


CellText = Annotated[Name, BeforeValidator(_as_text)]


class JoinedFile(FrozenModel):
    """Another logger's file with inputs or conditions. ``join: pressure.csv`` is short for ``{file: …}``."""

    file: Name = Field(description="the other file, relative to this one")
    shift_s: Time = Field(
        0.0, description="added to the other file's clock, to make it this one's, e.g. -0.4 s"
    )
    hold: bool | None = Field(
        None,
        description="true: each value holds until the next row, and the last one to the end, as in a log of changes; "
        "false: straight lines, as by default",
    )


UNKNOWN = "unknown"
PER_RUN = "per run"


def _as_entries(value: Any) -> Any:
    """Return entries; a name, or a list of names, becomes entries without keys."""
    names = _as_list(value)
    return {name: {} for name in names} if isinstance(names, list | tuple) else value


class CycleLevelsConfig(FrozenModel):
    """A cycle of one input, each of which becomes a run: a rise above `high` after a return below `low`."""

    of: Name = Field(description="the input, by the file's name or Pliant's")
    low: float | str = Field(description="with its unit")
    high: float | str = Field(description="with its unit, above `low`")


class LetGoConfig(FrozenModel):
    """The start of a run in which the end is held away from rest and let go."""

    at_s: Time | None = Field(None, description="held up to this time_s; up to the first sample by default")
    bend_rad: Angle | None = Field(
        None, description="where it was held, about the main axis; as the first reading of a bend by default"
    )


Turn = Literal["unknown"] | tuple[Ratio, Ratio, Ratio, Ratio] | Angle


class SensorFrameConfig(FrozenModel):
    """The frame in which a camera or a pair of bend sensors reads, seen from the world or from the module."""

    turn: Turn | dict[Name, Turn] = Field(
        description="unknown: estimated from the readings; of positions a quaternion w, x, y, z that takes world "
        "vectors to the camera's; of pairs of bends or curvatures an angle about the chain axis, e.g. 30 deg; or one "
        "of these by pattern of the runs' names, where the camera was moved between sessions"
    )


class ColumnNotes(FrozenModel):
    """What any table may leave unsaid of its columns, in a YAML file of the same stem in the same folder."""

    _places: Places = PrivateAttr(default_factory=Places)

    rename: dict[Name, Name] = Field(
        default_factory=dict, description="the file's column: Pliant's name, e.g. {bend: angle_rad}"
    )
    units: dict[Name, Name] = Field(
        default_factory=dict, description="unit that a column is written in, e.g. {pressure_pa: kPa}"
    )
    missing: Annotated[tuple[CellText, ...], BeforeValidator(_as_list)] = Field(
        (), description="marks of missing values, e.g. [OVERLOAD, -999]"
    )
    decimal: Literal[",", "."] | None = Field(
        None, description="the decimal mark; the other one then separates thousands"
    )
    header: Count | None = Field(
        None,
        ge=1,
        description="line of the header, where another one is taken for it; those above it are not read",
    )
    table: Name | None = Field(
        None, description="which sheet of a spreadsheet or variable of a .mat, where several"
    )

    @property
    def places(self) -> Places:
        """Return where each key was written; empty for notes of Python."""
        return self._places

    def stand_at(self, places: Places) -> None:
        """Keep the places where the keys were written, for messages."""
        self._places = places

    def at(self, otherwise: object, *path: Any) -> str:
        """Return where a key was written ("first.yaml, line 5"), the nearest above it, or `otherwise`."""
        known = self._places.of_keys
        return next(
            (known[path[:end]] for end in range(len(path), 0, -1) if path[:end] in known), str(otherwise)
        )


class TensileNotes(ColumnNotes):
    """Data that a tester does not export: the strip's sizes, to convert loads and extensions to stress and stretch."""

    gauge_length_m: Length | None = Field(
        None, gt=0, description="length at rest that the extension is of, e.g. 25 mm"
    )
    section_m2: Area | None = Field(
        None, gt=0, description="area of the section at rest: width times thickness, e.g. 12 mm^2"
    )


class MeasurementNotes(ColumnNotes):
    """What a measurement CSV does not state. The file `finger.yaml` next to `finger.csv` contains these keys."""

    sigma: dict[Name, float | str] = Field(
        default_factory=dict, description="standard deviation of a sensor, e.g. {angle_rad: 0.5 deg}"
    )
    markers_m: tuple[Length, ...] = Field(
        (), description="positions of marker 1, 2, … along the chain at rest, from the base"
    )
    marker_offsets_m: tuple[tuple[Length, Length, Length], ...] = Field(
        (),
        description="of each of `markers`, beside the centre line: [x along the chain, y, z] of the piece that has it",
    )
    exclude: tuple[ExcludedSpan, ...] = Field((), description="spans or runs that are not used")
    conditions: dict[Name, Condition] = Field(
        default_factory=dict,
        description="of a file of counts: column: key of the task, e.g. {weights: task.extra_weights}",
    )
    rate: Frequency | None = Field(
        None, gt=0, description="pictures or samples a second, of a column 'frame' or of all rows, e.g. 25 Hz"
    )
    restarts: Literal["new run"] | None = Field(
        None, description="new run: a clock that begins again begins a run"
    )
    name_pattern: Name | None = Field(
        None,
        description="what the file's name says, e.g. finger_{specimen}_{payload_g}g_{run}; * stands for anything",
    )
    join: Annotated[
        JoinedFile | None, BeforeValidator(lambda value: {"file": value} if isinstance(value, str) else value)
    ] = Field(
        None,
        description="another logger's inputs or conditions, taken as straight lines at this file's times",
    )
    hold: dict[Name, bool] = Field(
        default_factory=dict,
        description="of an input in rows of its own, true: each value holds until the next one; false: straight "
        "lines, as by default, e.g. {pressure_kpa: true}",
    )
    zero: dict[Name, float | str] = Field(
        default_factory=dict,
        description="what a column reads at zero, subtracted, e.g. {angle_deg: 12.5 deg}; of readings also 'unknown', "
        "'per run': the offset of all runs, or of each, that fits best",
    )
    wrap: dict[Name, float | str] = Field(
        default_factory=dict,
        description="span after which a column begins again, e.g. {angle_deg: 360 deg, time_us: 4294967296 us}; an "
        "hour for a clock that was set back",
    )
    frame: SensorFrameConfig | None = Field(
        None, description="the frame of a camera or of a pair of bend sensors, where it is turned"
    )
    runs: dict[Name, dict[Name, float | str]] = Field(
        default_factory=dict,
        description="what a file does not say of its runs, by run: inputs, loads, conditions and specimen, e.g. "
        "{tracking_4: {payload: 200 g}}; the file's own columns come first",
    )
    cycles: Literal["new run"] | CycleLevelsConfig | None = Field(
        None,
        description="new run: each cycle of the actuation becomes a run, so that steps with repeats are repeats; or "
        "the levels between which an input steps, {of: pressure_1_psi, low: 6 psi, high: 9 psi}",
    )
    let_go: Annotated[dict[Name, LetGoConfig], BeforeValidator(_as_entries)] = Field(
        default_factory=dict,
        description="runs that begin held away from rest and are let go: free swings, e.g. {swing: {at: 0.4 s, bend: 0 "
        "deg}}; a name or a list of names where the first reading of a bend says from where",
    )


class MeasurementsConfig(MeasurementNotes):
    """The `measurements` block: the file, and what it does not state (before the YAML in its folder)."""

    file: Annotated[Name | tuple[Name, ...], Field(min_length=1)] = Field(
        description="the file, relative to the study; several, or a pattern such as runs/*.csv, are runs in their order"
    )
    outputs: tuple[Name, ...] = Field((), description="outputs to use; all by default")
    max_samples: Count = Field(
        MOST_SAMPLES, ge=1000, description="samples kept of a longer file, thinned evenly per run"
    )
    trials: Count = Field(
        10, ge=1, le=10_000, description="trials to simulate for each condition of a file of counts"
    )
    plausible: tuple[PlausibleRange, ...] = Field(
        (), description="numbers of the task that may explain counts, for `pliant diagnose`"
    )
