"""The `measurements` block of a study, and the YAML file that may lie beside a measurement CSV."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, StringConstraints, model_validator

from pliant.config.chain import Count
from pliant.interfaces.base import FrozenModel
from pliant.units import Length, Ratio, Time

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
    low: Ratio | str = Field(description="with its unit; the range holds 90 % of what would surprise nobody")
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


class ColumnNotes(FrozenModel):
    """What any table may leave unsaid of its columns, in a YAML file of the same stem beside it."""

    rename: dict[Name, Name] = Field(
        default_factory=dict, description="the file's column: Pliant's name, e.g. {bend: angle_rad}"
    )
    units: dict[Name, Name] = Field(
        default_factory=dict, description="unit that a column is written in, e.g. {pressure_pa: kPa}"
    )


class MeasurementNotes(ColumnNotes):
    """What a measurement CSV does not say of itself. The file `finger.yaml` beside `finger.csv` holds these keys."""

    sigma: dict[Name, float | str] = Field(
        default_factory=dict, description="standard deviation of a sensor, e.g. {angle_rad: 0.5 deg}"
    )
    markers_m: tuple[Length, ...] = Field(
        (), description="positions of marker 1, 2, … along the chain at rest, from the base"
    )
    exclude: tuple[ExcludedSpan, ...] = Field((), description="spans or runs that are not used")
    conditions: dict[Name, Condition] = Field(
        default_factory=dict,
        description="of a file of counts: column: key of the task, e.g. {weights: task.extra_weights}",
    )


class MeasurementsConfig(MeasurementNotes):
    """The `measurements` block: the CSV, and what it does not say of itself (before the YAML beside it)."""

    file: Name = Field(description="the CSV, relative to the study")
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
