"""Covariates: the circumstances of each sample that a model's error may depend on."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pliant.formatting import NamedUnit, named_unit, unit_of
from pliant.records.design import Array
from pliant.records.measurement import MeasuredRun, Measurement

STILL = 0.05  # of the run's range per duration: slower changes are a hold
NOISE_WIDTHS = 4.5  # slopes below so many standard deviations of the reading's noise are a hold
LONGEST_WINDOW = 32  # samples over which a noisy reading is differenced


@dataclass(frozen=True, eq=False)
class Phases:
    """(t,) each: `direction` −1, 0, 1; `rate` per second, NaN in holds; `hold_s` since the change, NaN in motion."""

    direction: Array
    rate: Array
    hold_s: Array


def phases(level: Array, time_s: Array | None) -> Phases:
    """Phases of one run from its actuation, which may be a noisy reading.

    Slopes are backward differences, so that a step belongs to the sample that it leads to. The window grows
    until a typical slope stands clear of the reading's noise, which second differences tell (Var = 6 σ²).
    Without time, samples count as seconds.
    """
    n = len(level)
    clock = np.arange(n, dtype=float) if time_s is None else np.asarray(time_s, float)
    if n < 2 or np.ptp(level) == 0:
        return Phases(np.zeros(n), np.full(n, np.nan), clock - clock[:1])
    sigma = _reading_noise(level)
    window = 1
    while True:
        slope, span = _backward_slope(level, clock, window)
        noise = NOISE_WIDTHS * np.sqrt(2) * sigma / span
        moving = np.abs(slope) > np.maximum(noise, STILL * np.ptp(level) / max(np.ptp(clock), 1e-12))
        clear = not sigma or np.percentile(np.abs(slope), 90) > 3 * np.median(noise)
        if clear or 2 * window > min(LONGEST_WINDOW, n // 4):
            break
        window *= 2
    direction = np.where(moving, np.sign(slope), 0.0)
    last_motion = np.maximum.accumulate(np.where(moving, np.arange(n), -1))
    since = clock - clock[np.maximum(last_motion, 0)]
    return Phases(
        direction, np.where(moving, np.abs(slope), np.nan), np.where(moving, np.nan, np.maximum(since, 0.0))
    )


def _backward_slope(level: Array, clock: Array, window: int) -> tuple[Array, Array]:
    now = np.arange(len(level))
    before = np.maximum(now - window, 0)
    now = np.maximum(now, min(window, len(level) - 1))  # the first samples look ahead
    span = np.maximum(clock[now] - clock[before], 1e-12)
    return (level[now] - level[before]) / span, span


def _reading_noise(level: Array) -> float:
    """Standard deviation of a reading's white noise, untouched by ramps, corners and holds."""
    if len(level) < 8:
        return 0.0
    return float(1.4826 * np.median(np.abs(np.diff(level, 2))) / np.sqrt(6))


VARIES = 1e-6  # relative: smaller spreads are rounding
ALONG_CHAIN = re.compile(r"(joint|marker)_(\d+)_(.+)")


@dataclass(frozen=True, eq=False)
class Covariate:
    """One circumstance, sample by sample.

    Attributes:
        name: for programs, SI unit at its end.
        shown: for people.
        values: per run (t,): numbers in SI, or indices into `categories`; NaN where it has no value.
        categories: in words, for a covariate without an order; empty for a numeric one.
        rest: what a sample is called that has no value, such as "holding" for a rate.
    """

    name: str
    shown: NamedUnit
    values: tuple[Array, ...]
    categories: tuple[str, ...] = ()
    rest: str = "not given"

    @property
    def numeric(self) -> bool:
        return not self.categories


@dataclass(frozen=True, eq=False)
class Covariates:
    """The covariates of a measurement that vary, and each output's number along the chain where it has one."""

    items: tuple[Covariate, ...]
    position: Mapping[str, int]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(item.name for item in self.items)

    def __getitem__(self, name: str) -> Covariate:
        return next(item for item in self.items if item.name == name)


def covariates(
    measurement: Measurement, predicted: Sequence[Mapping[str, Array]] | None = None
) -> Covariates:
    """Every circumstance of the measurement that varies.

    Args:
        measurement: runs in the order in which they were done.
        predicted: per run the model's outputs; adds the bend that the model expects.

    Returns:
        pressure (or tension) of each input, direction of its change, rate, time in hold, cycle, largest past
        level of the specimen, moment, tip force, payload, temperature, orientation, specimen, time in the run,
        run number, predicted bend; those that are the same everywhere are left out.
    """
    made = (
        *_actuation(measurement),
        *_loads(measurement),
        *_conditions(measurement),
        *_bend(measurement, predicted),
    )
    return Covariates(tuple(item for item in made if _varies(item)), positions(measurement.outputs))


def positions(outputs: Sequence[str]) -> dict[str, int]:
    """Number along the chain of outputs such as ``joint_3_angle_rad`` or ``marker_2_x_m``."""
    found = ((name, ALONG_CHAIN.fullmatch(name)) for name in outputs)
    return {name: int(match[2]) for name, match in found if match}


def _actuation(measurement: Measurement) -> Iterator[Covariate]:
    runs = measurement.runs
    names = list(dict.fromkeys(name for run in runs for name in run.history.actuation))
    levels = {name: [_actuation_of(run, name) for run in runs] for name in names}
    for name in names:
        yield Covariate(name, _input_words(name, len(names)), tuple(levels[name]))
    if not names:
        return
    moving = [name for name in names if any(np.ptp(v) > 0 for v in levels[name] if len(v))]
    lead = (moving or names)[0]
    label, unit = unit_of(lead).label, lead.rsplit("_", 1)[-1]
    found = [phases(v, run.history.time_s) for v, run in zip(levels[lead], runs, strict=True)]
    yield Covariate(
        "direction", named_unit(f"direction of {label} change"), tuple(1 - f.direction for f in found),
        (f"rising {label}", f"held {label}", f"falling {label}"),
    )  # fmt: skip
    if all(run.history.time_s is not None for run in runs):
        yield from _rates(found, lead, label, unit)
    yield Covariate(
        f"past_{lead}", replace(unit_of(lead), label=f"largest {label} so far"),
        tuple(_largest_so_far(runs, levels[lead])),
    )  # fmt: skip


def _rates(found: Sequence[Phases], lead: str, label: str, unit: str) -> Iterator[Covariate]:
    words = unit_of(f"{lead}_s")
    yield Covariate(
        f"rate_{unit}_s", replace(words, label=f"{label} rate"),
        tuple(f.rate for f in found), rest=f"held {label}",
    )  # fmt: skip
    yield Covariate(
        "hold_s", named_unit("time in hold", "s"), tuple(f.hold_s for f in found), rest=f"{label} in motion"
    )


def _loads(measurement: Measurement) -> Iterator[Covariate]:
    runs = measurement.runs
    moment = [run.history.moment_n_m for run in runs]
    yield Covariate("moment_n_m", named_unit("moment", "N*m"), tuple(moment))
    if any((m < 0).any() for m in moment):
        yield Covariate(
            "moment_direction", named_unit("direction of the moment"), tuple(np.sign(m) + 1 for m in moment),
            ("moment that helps", "no moment", "moment that opposes"),
        )  # fmt: skip
    force = [run.history.tip_force_n for run in runs]
    yield Covariate(
        "tip_force_n", named_unit("tip force", "N"), tuple(np.linalg.norm(f, axis=1) for f in force)
    )
    words = tuple(f"tip force toward {sign}{axis}" for axis in "xyz" for sign in "−+")
    toward = tuple(_main_axis(f) for f in force)
    if len(np.unique(np.concatenate(toward))) > 2:
        yield Covariate(
            "tip_force_direction", named_unit("direction of the tip force"), toward, (*words, "no tip force")
        )
    payload = [run.history.payload_kg for run in runs]
    yield Covariate(
        "payload_kg", named_unit("payload", "kg"),
        tuple(np.full(len(run), np.nan) if p is None else p for p, run in zip(payload, runs, strict=True)),
        rest="no payload stated",
    )  # fmt: skip


def _conditions(measurement: Measurement) -> Iterator[Covariate]:
    runs = measurement.runs
    yield Covariate(
        "temperature_c", named_unit("temperature", "degC"), tuple(r.history.temperature_c for r in runs)
    )
    for column, name in enumerate(("roll", "pitch", "yaw")):
        angles = tuple(r.history.base_angles_rad[:, column] for r in runs)
        yield Covariate(f"base_{name}_rad", named_unit(f"base {name}", "rad"), angles)
    yield Covariate("cycle", named_unit("cycle"), tuple(np.asarray(r.cycle, float) for r in runs))
    names = list(dict.fromkeys(r.history.specimen for r in runs))
    yield Covariate(
        "specimen", named_unit("specimen"),
        tuple(np.full(len(r), float(names.index(r.history.specimen))) for r in runs),
        tuple(f"specimen {name}" if name else "no specimen named" for name in names),
    )  # fmt: skip
    if all(r.history.time_s is not None for r in runs):
        yield Covariate("clock_s", named_unit("time in the run", "s"), tuple(_clock(r) for r in runs))
    yield Covariate(
        "run_number", named_unit("run number"), tuple(np.full(len(r), k + 1.0) for k, r in enumerate(runs))
    )


def _bend(measurement: Measurement, predicted: Sequence[Mapping[str, Array]] | None) -> Iterator[Covariate]:
    if not predicted or not all(predicted):
        return
    joints = [name for name in predicted[0] if re.fullmatch(r"joint_\d+_angle_rad", name)]
    names = ["angle_rad"] if "angle_rad" in predicted[0] else joints
    if names and all(name in run for run in predicted for name in names):
        total = tuple(np.sum([run[name] for name in names], axis=0) for run in predicted)
        yield Covariate("predicted_angle_rad", named_unit("predicted bend", "rad"), total)


def _actuation_of(run: MeasuredRun, name: str) -> Array:
    return np.asarray(run.history.actuation.get(name, np.full(len(run), np.nan)), float)


def _input_words(name: str, count: int) -> NamedUnit:
    words = unit_of(name)
    return words if count > 1 else replace(words, label=re.sub(r" \d+$", "", words.label))


def _largest_so_far(runs: Sequence[MeasuredRun], levels: Sequence[Array]) -> Iterator[Array]:
    """The largest level that the specimen has seen, the present one included."""
    seen: dict[str, float] = {}
    for run, level in zip(runs, levels, strict=True):
        before = seen.get(run.history.specimen, -np.inf)
        past = np.fmax.accumulate(np.fmax(level, before)) if len(level) else level
        if len(past):
            seen[run.history.specimen] = float(past[-1])
        yield past


def _main_axis(force: Array) -> Array:
    """Index into −x, +x, −y, +y, −z, +z, none."""
    axis = np.argmax(np.abs(force), axis=1)
    value = np.take_along_axis(force, axis[:, None], axis=1)[:, 0]
    return np.where(value == 0, 6, 2 * axis + (value > 0)).astype(float)


def _clock(run: MeasuredRun) -> Array:
    time = np.asarray(run.history.time_s, float)
    return np.asarray(time - time[:1])


def _varies(item: Covariate) -> bool:
    values = np.concatenate(item.values) if item.values else np.zeros(0)
    there = values[np.isfinite(values)]
    if len(there) < 1:
        return False
    if len(there) < len(values) and np.isfinite(there).any():
        return True  # some samples have it and some do not
    scale = max(float(np.abs(there).max()), 1e-300)
    return bool(np.ptp(there) > VARIES * scale)
