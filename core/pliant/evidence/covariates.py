"""Covariates: the circumstances of each sample on which a model's error may depend.

Bins: a covariate divided into a few named intervals or categories.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import NamedUnit, displayed_in, named_unit, number, output_unit, stem_and_unit
from pliant.measurements.effective import run_clock
from pliant.records.design import Array
from pliant.records.measurement import MeasuredRun, Measurement

STILL = 0.05  # of the run's range per duration: slower changes are a hold
NOISE_WIDTHS = 4.5  # slopes below this number of standard deviations of the reading's noise are a hold
LONGEST_WINDOW = 32  # samples over which a noisy reading is differenced


@dataclass(frozen=True, eq=False)
class Phases:
    """(t,) each: `direction` −1, 0, 1; `rate` per second, NaN at rest; `hold_s` since the change, NaN in motion."""

    direction: Array
    rate: Array
    hold_s: Array


def phases(level: Array, time_s: Array | None) -> Phases:
    """Return the phases of one run from its actuation, which may be a noisy reading.

    Slopes are backward differences, so that a step belongs to the sample that it leads to. The window grows until a
    typical slope exceeds the reading's noise, which is estimated from second differences (Var = 6 σ²). Without time,
    samples count as seconds.
    """
    n = len(level)
    clock = np.arange(n, dtype=float) if time_s is None else np.asarray(time_s, float)
    if n < 2 or np.ptp(level) == 0:
        return Phases(np.zeros(n), np.full(n, np.nan), clock - clock[:1])
    # second differences of white noise, untouched by ramps, corners and holds
    sigma = float(1.4826 * np.median(np.abs(np.diff(level, 2))) / np.sqrt(6)) if n >= 8 else 0.0
    now = np.arange(n)
    window = 1
    while True:
        before, after = (
            np.maximum(now - window, 0),
            np.maximum(now, min(window, n - 1)),
        )  # the first samples use forward differences
        span = np.maximum(clock[after] - clock[before], 1e-12)
        slope = (level[after] - level[before]) / span
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


VARIES = 1e-6  # relative: smaller spreads are rounding
ALONG_CHAIN = re.compile(r"(joint|marker)_(\d+)_(.+)")


@dataclass(frozen=True, eq=False)
class Covariate:
    """One circumstance, sample by sample.

    Attributes:
        name: machine-readable, with the SI unit at its end.
        shown: name and unit for display.
        values: per run (t,): numbers in SI, or indices into `categories`; NaN where it has no value.
        categories: in words, for a covariate without an order; empty for a numeric one.
        rest: label of samples without a value, such as "holding" for a rate.
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
    """Return every circumstance of the measurement that varies.

    Args:
        measurement: runs in the order in which they were done.
        predicted: per run the model's outputs; adds the predicted bend.

    Returns:
        pressure (or tension) of each input, direction of its change, rate, time in hold, cycle, largest past
        level of the specimen, moment, tip force, payload, temperature, orientation, specimen, time in the run,
        run number, predicted bend; those that are the same everywhere are left out.
    """
    runs = measurement.runs
    histories = [run.history for run in runs]
    made: list[Covariate] = []

    def add(name: str, shown: NamedUnit, values: Iterable[Array], *categories: str, **rest: str) -> None:
        item = Covariate(name, shown, tuple(values), categories, **rest)
        if _varies(item):
            made.append(item)

    _add_actuation(add, runs)
    moment = [h.moment_n_m for h in histories]
    add("moment_n_m", named_unit("moment", "N*m"), moment)
    if any((m < 0).any() for m in moment):
        ways = ("moment that helps", "no moment", "moment that opposes")
        add(
            "moment_direction", named_unit("direction of the moment"), (np.sign(m) + 1 for m in moment), *ways
        )
    force = [h.tip_force_n for h in histories]
    add("tip_force_n", named_unit("tip force", "N"), (np.linalg.norm(f, axis=1) for f in force))
    toward = [_main_axis(f) for f in force]
    if len(np.unique(np.concatenate(toward))) > 2:
        sides = [f"tip force toward {sign}{axis}" for axis in "xyz" for sign in "−+"]
        add("tip_force_direction", named_unit("direction of the tip force"), toward, *sides, "no tip force")
    payload = (np.full(len(h), np.nan) if h.payload_kg is None else h.payload_kg for h in histories)
    add("payload_kg", named_unit("payload", "kg"), payload, rest="no payload stated")
    add("temperature_c", named_unit("temperature", "degC"), (h.temperature_c for h in histories))
    for k, turn in enumerate(("roll", "pitch", "yaw")):
        angles = (h.base_angles_rad[:, k] for h in histories)
        add(f"base_{turn}_rad", named_unit(f"base {turn}", "rad"), angles)
    add("cycle", named_unit("cycle"), (np.asarray(run.cycle, float) for run in runs))
    bodies = list(dict.fromkeys(h.specimen for h in histories))
    named = [f"specimen {body}" if body else "no specimen named" for body in bodies]
    which = (np.full(len(h), float(bodies.index(h.specimen))) for h in histories)
    add("specimen", named_unit("specimen"), which, *named)
    if all(h.time_s is not None for h in histories):
        add("clock_s", named_unit("time in the run", "s"), (run_clock(run) for run in runs))
    add("run_number", named_unit("run number"), (np.full(len(run), k + 1.0) for k, run in enumerate(runs)))
    if predicted and all(predicted):
        joints = [name for name in predicted[0] if re.fullmatch(r"joint_\d+_angle_rad", name)]
        names = ["angle_rad"] if "angle_rad" in predicted[0] else joints
        if names and all(name in run for run in predicted for name in names):
            total = (np.sum([run[name] for name in names], axis=0) for run in predicted)
            add("predicted_angle_rad", named_unit("predicted bend", "rad"), total)
    return Covariates(tuple(made), positions(measurement.outputs))


def positions(outputs: Sequence[str]) -> dict[str, int]:
    """Return the number along the chain of outputs such as ``joint_3_angle_rad`` or ``marker_2_x_m``."""
    found = ((name, ALONG_CHAIN.fullmatch(name)) for name in outputs)
    return {name: int(match[2]) for name, match in found if match}


def _add_actuation(add: Callable[..., None], runs: Sequence[MeasuredRun]) -> None:
    """Add each input, and for the first that moves its direction, rate, hold time and largest past level."""
    names = list(dict.fromkeys(name for run in runs for name in run.history.actuation))
    levels = {name: [run.input(name) for run in runs] for name in names}
    for name in names:
        words = output_unit(name)
        only = replace(words, label=re.sub(r" \d+$", "", words.label))
        add(name, words if len(names) > 1 else only, levels[name])
    if not names:
        return
    moving = [name for name in names if any(np.ptp(v) > 0 for v in levels[name] if len(v))]
    lead = (moving or names)[0]
    shown, (stem, si) = output_unit(lead), stem_and_unit(lead)
    label, unit = shown.label, (lead.removeprefix(stem) if si else lead.rsplit("_", 1)[-1]).strip("_")
    found = [phases(v, run.history.time_s) for v, run in zip(levels[lead], runs, strict=True)]
    ways = (f"rising {label}", f"held {label}", f"falling {label}")
    add("direction", named_unit(f"direction of {label} change"), (1 - f.direction for f in found), *ways)
    if all(run.history.time_s is not None for run in runs):
        rate = NamedUnit(f"{shown.symbol or 1}/s", shown.factor, label=f"{label} rate")
        add(f"rate_{unit}_s", rate, (f.rate for f in found), rest=f"held {label}")
        add("hold_s", named_unit("time in hold", "s"), (f.hold_s for f in found), rest=f"{label} in motion")
    past = replace(output_unit(lead), label=f"largest {label} so far")
    add(f"past_{lead}", past, _largest_so_far(runs, levels[lead]))


def _largest_so_far(runs: Sequence[MeasuredRun], levels: Sequence[Array]) -> Iterator[Array]:
    """Yield the largest level that the specimen has seen, the present one included, per run."""
    seen: dict[str, float] = {}
    for run, level in zip(runs, levels, strict=True):
        before = seen.get(run.history.specimen, -np.inf)
        past = np.fmax.accumulate(np.fmax(level, before)) if len(level) else level
        if len(past):
            seen[run.history.specimen] = float(past[-1])
        yield past


def _main_axis(force: Array) -> Array:
    """Return (t,) index into −x, +x, −y, +y, −z, +z, none."""
    axis = np.argmax(np.abs(force), axis=1)
    value = np.take_along_axis(force, axis[:, None], axis=1)[:, 0]
    return np.where(value == 0, 6, 2 * axis + (value > 0)).astype(float)


def _varies(item: Covariate) -> bool:
    values = np.concatenate(item.values) if item.values else np.zeros(0)
    there = values[np.isfinite(values)]
    if len(there) < len(values):
        return len(there) > 0  # some samples have it and some do not
    return bool(len(there) and np.ptp(there) > VARIES * max(float(np.abs(there).max()), 1e-300))


Codes = NDArray[np.int64]
MOST_LEVELS = 8  # a covariate with at most this number of values has a bin for each
N_BINS = 5
ATOM = 0.1  # of the samples at one value: it gets a separate bin
LEVEL_WIDTH = 0.02  # of the range: values closer than this are one level…
LEVEL_RATIO = 1.3  # …unless one exceeds the other by this factor
PAIRS = (
    ("direction", "pressure"),
    ("direction", "rate"),
    ("direction", "moment_direction"),
    ("moment_direction", "pressure"),
)


@dataclass(frozen=True, eq=False)
class Bins:
    """A covariate divided into bins; every sample is in exactly one.

    Attributes:
        name: the covariate's, or two joined by " × ".
        shown: the covariate in words.
        words: each bin in words.
        codes: per run (t,) the bin of each sample.
        centres: position of each bin on the covariate's axis (SI); NaN for categories and the rest.
    """

    name: str
    shown: NamedUnit
    words: tuple[str, ...]
    codes: tuple[Codes, ...]
    centres: tuple[float, ...]

    def __len__(self) -> int:
        return len(self.words)


def binned(covariate: Covariate) -> Bins:
    """Return the covariate in bins: one per category or level, else `N_BINS` with about equal numbers of samples."""
    values = np.concatenate(covariate.values)
    if not np.isfinite(values).any():
        found, words, centres = values, [], []
    elif not covariate.numeric:
        found, words, centres = values, list(covariate.categories), [np.nan] * len(covariate.categories)
    else:
        with displayed_in({}):  # cut at round numbers of the usual units: independent of the displayed unit
            usual = output_unit(covariate.name).factor
        found, words, centres = _numeric(covariate.shown, values, usual)
    codes = np.where(np.isfinite(found), found, len(words)).astype(np.int64)
    return _used(
        covariate.name, covariate.shown, codes, [*words, covariate.rest], [*centres, np.nan], covariate.values
    )


def crossed(first: Bins, second: Bins) -> Bins:
    """Return every combination that occurs of a bin of `first` and one of `second`."""
    size = len(second)
    codes = np.concatenate([a * size + b for a, b in zip(first.codes, second.codes, strict=True)])
    label = second.shown.label + " "  # "rising pressure, pressure 5 kPa" names it twice
    words = [
        f"{a}, {b.removeprefix(label) if a.endswith(label.strip()) else b}"
        for a in first.words
        for b in second.words
    ]
    return _used(
        f"{first.name} × {second.name}",
        named_unit(f"{first.shown.label} × {second.shown.label}"),
        codes,
        words,
        [np.nan] * len(words),
        first.codes,
    )


def _used(
    name: str,
    shown: NamedUnit,
    codes: Codes,
    words: Sequence[str],
    centres: Sequence[float],
    like: Sequence[Array] | Sequence[Codes],
) -> Bins:
    """Return the bins that contain a sample; `codes` of all runs one after another, runs as long as in `like`."""
    used, codes = np.unique(codes, return_inverse=True)
    by_run = tuple(np.split(codes, np.cumsum([len(v) for v in like])[:-1]))
    return Bins(name, shown, tuple(words[k] for k in used), by_run, tuple(float(centres[k]) for k in used))


def _numeric(shown: NamedUnit, values: Array, usual: float) -> tuple[Array, list[str], list[float]]:
    there = values[np.isfinite(values)]
    levels = _levels(there)
    if levels is not None:
        edges, centres = (levels[1:] + levels[:-1]) / 2, levels.tolist()
        words = [f"{shown.label} {shown.text(value, 3)}" for value in centres]
    else:
        edges, marks = _edges(there, usual)
        place = np.searchsorted(edges, there, side="right")
        inside = [there[place == k] for k in range(len(edges) + 1)]
        centres = [float(np.median(v)) if len(v) else np.nan for v in inside]
        at = [number(mark * shown.factor, 3) for mark in marks]
        ranges = [f"below {at[0]}", *(f"{a} to {b}" for a, b in pairwise(at)), f"above {at[-1]}"]
        words = [shown.attached(f"{shown.label} {text}") for text in ranges]
        for k, v in enumerate(inside):
            if len(v) > 0 and np.ptp(v) <= LEVEL_WIDTH * np.ptp(there) / 4:  # a single level
                words[k] = f"{shown.label} {shown.text(centres[k], 3)}"
    found = np.where(np.isfinite(values), np.searchsorted(edges, values, side="right"), np.nan)
    return found, words, centres


def _levels(there: Array) -> Array | None:
    """Return the discrete levels of the values; None where they are spread or more than `MOST_LEVELS`.

    A level ends where the next value is farther away than `LEVEL_WIDTH` of the range, or than the factor `LEVEL_RATIO`.
    """
    unique = np.unique(there)
    width = LEVEL_WIDTH * np.ptp(unique)
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = (np.diff(unique) > width) | ((unique[:-1] > 0) & (unique[1:] / unique[:-1] > LEVEL_RATIO))
    groups = np.split(unique, np.flatnonzero(apart) + 1)
    if len(groups) > MOST_LEVELS or any(np.ptp(group) > 2 * width for group in groups):
        return None
    return np.array([np.median(there[(there >= g[0]) & (there <= g[-1])]) for g in groups])


def _edges(there: Array, factor: float) -> tuple[Array, Array]:
    """Return the inner edges, and the values by which they are named.

    A value that many samples share (a rest, a plateau) gets its own bin; the others are divided near their quantiles,
    at round numbers.
    """
    unique, counts = np.unique(there, return_counts=True)
    atoms = np.flatnonzero(counts > ATOM * len(there))
    rest = there[~np.isin(there, unique[atoms])]
    edges, marks = [], []
    for k in atoms:
        for before, after in ((k - 1, k), (k, k + 1)):
            if before >= 0 and after < len(unique):
                edges.append((unique[before] + unique[after]) / 2)
                marks.append(unique[k])
    for edge in _rounded(rest, max(N_BINS - len(atoms), 2), factor):
        if all(abs(edge - other) > LEVEL_WIDTH * np.ptp(there) for other in marks):
            edges.append(edge)
            marks.append(edge)
    order = np.argsort(edges)
    return np.array(edges)[order], np.array(marks)[order]


def _rounded(there: Array, parts: int, factor: float) -> Array:
    """Return the inner edges of `parts` intervals near the quantiles, inside the range."""
    if not len(there):
        return np.zeros(0)
    edges = np.quantile(there, np.arange(1, parts) / parts)
    shown = edges * factor
    step = 10.0 ** np.floor(np.log10(max(np.ptp(there) * factor, 1e-300))) / 10
    fine = np.maximum(10.0 ** np.floor(np.log10(np.maximum(np.abs(shown), 1e-300))) / 2, 1e-12)
    step = np.minimum(step, fine)
    rounded = np.unique(np.round(shown / step) * step) / factor
    inside = rounded[(rounded > there.min()) & (rounded <= there.max())]
    return inside if len(inside) else np.array([np.median(there)])
