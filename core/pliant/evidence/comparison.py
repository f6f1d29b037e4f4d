"""Model against measurement: how large the error is, against which noise, and where.

Residuals are measured − predicted throughout.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pliant.errors import UserError
from pliant.evidence.bookkeeping.mistake import Mistake
from pliant.evidence.covariates import covariates
from pliant.evidence.excess import STANDARD_ERRORS, Excess
from pliant.evidence.importance import importance
from pliant.evidence.places import (
    Place,
    Residuals,
    find_places,
    noise_of,
    padded,
    residuals_of,
    worst_places,
)
from pliant.evidence.scores import (
    NONE,
    GroupError,
    Interval,
    OutputError,
    group_error,
    output_error,
    overall,
    run_words,
)
from pliant.formatting import listed, unit_of, whole_percent
from pliant.measurements.effective import clock_of
from pliant.measurements.floors import floor_remarks, noise_floors
from pliant.measurements.repeats import repeat_groups
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.records.remark import Rank, Remark

NO_NOISE = "no noise"
ROUNDING = 1e-7  # of the readings: smaller floors come from computed data
JUDGED_BY = ("repeats", "stated sigma")  # floors that hold the bench's own scatter


@dataclass(frozen=True, eq=False)
class Comparison:
    """A model against a measurement.

    Attributes:
        outputs: by name, see `OutputError`.
        rmse_over_floor: root mean square error in units of the floor, all readings; NaN without a floor.
        rmse_over_floor_interval: its 95 % interval.
        runs, conditions: errors run by run, and with repeats taken together.
        places: every bin of every covariate; shares of one covariate sum to 1.
        worst: places that hold more than their part of the error, the worst first.
        depends_on: covariate → share of the error's variance that it tells (see `importance`), largest first.
        labels: covariate → words.
        n_places: (bin, output) pairs that were tested; significance is corrected for so many.
        n_samples, n_effective: readings, and how many independent ones they are worth.
        judged: every floor comes from repeats or a stated sigma, so that "right" and "wrong" have a meaning.
        remarks: what limits the comparison, in sentences.
        bookkeeping: what is probably written down wrongly, before any physics.
    """

    outputs: Mapping[str, OutputError]
    rmse_over_floor: float
    rmse_over_floor_interval: Interval
    runs: tuple[GroupError, ...]
    conditions: tuple[GroupError, ...]
    places: tuple[Place, ...]
    worst: tuple[Place, ...]
    depends_on: Mapping[str, float]
    labels: Mapping[str, str]
    n_places: int
    n_samples: int
    n_effective: float
    judged: bool
    remarks: tuple[str, ...]
    bookkeeping: tuple[Mistake, ...] = ()

    @property
    def has_floor(self) -> bool:
        """Whether every output has a floor of some source."""
        return bool(np.isfinite(self.rmse_over_floor))

    @property
    def significant(self) -> tuple[Place, ...]:
        """Places where the mean error is more than noise, after correction for all that were looked at."""
        return tuple(place for place in self.places if place.significant)


def _residuals(measurement: Measurement, predicted: Sequence[Mapping[str, Array]]) -> Residuals:
    """Those of the outputs with a reading that can be compared; raises `UserError` without one."""
    residuals = residuals_of(measurement, predicted)
    names = [n for n in residuals[0] if any(np.isfinite(run[n]).any() for run in residuals)]
    if not residuals[0]:
        has = ", ".join(sorted({name for run in predicted for name in run})) or "none"
        raise UserError(
            f"{measurement.source or 'the measurement'} has the outputs {', '.join(measurement.outputs) or 'none'}, "
            f"the model has {has}: nothing to compare."
        )
    if not names:
        raise UserError("no reading can be compared: every reading or prediction is missing.")
    return [{name: run[name] for name in names} for run in residuals]


def compare(
    measurement: Measurement,
    predicted: Sequence[Mapping[str, Array]],
    *,
    seed: int = 0,
    bookkeeping: Sequence[Mistake] = (),
) -> Comparison:
    """Errors per output, run and condition against the noise floor, and where they are.

    Args:
        measurement: what the bench recorded.
        predicted: for each run the model's outputs by name, (t,) each.
        seed: of the bootstrap.
        bookkeeping: mistakes of the record that the model shows (`find_mistakes`).

    Raises:
        UserError: no output in common, or no reading that can be compared.
    """
    residuals = _residuals(measurement, predicted)
    names, groups = list(residuals[0]), repeat_groups(measurement)
    every = noise_floors(measurement, padded(measurement, residuals), groups)
    floors = {name: every[name] for name in names}
    readings = {n: np.concatenate([run.outputs[n] for run in measurement.runs]) for n in floors}
    smallest = {name: ROUNDING * float(np.sqrt(np.nanmean(read**2))) for name, read in readings.items()}
    noiseless = [name for name, floor in floors.items() if floor.value <= smallest[name]]  # computed data
    floors = {name: floor for name, floor in floors.items() if name not in noiseless}
    noise = {n: noise_of(floors.get(n), measurement, groups, [run[n] for run in residuals]) for n in names}
    steps_s = [float(np.median(np.diff(clock_of(run)))) if len(run) > 1 else 1.0 for run in measurement.runs]
    found = covariates(measurement, predicted)
    places = find_places(residuals, found, noise, steps_s)
    outputs = {n: output_error(n, residuals, floors.get(n), noise[n], steps_s, seed) for n in names}
    outputs |= {name: replace(outputs[name], source=NO_NOISE) for name in noiseless}
    known = all(np.isfinite(error.noise_floor) for error in outputs.values())
    ratio, ratio_interval = overall(residuals, noise, steps_s, seed) if known else (np.nan, NONE)
    runs = [(k,) for k in range(len(measurement.runs))]
    repeats = {k: group.runs for group in groups for k in group.runs}
    conditions = dict.fromkeys(repeats.get(k, run) for k, run in enumerate(runs))
    score = partial(group_error, measurement, run_words(found, len(runs)), residuals, noise, known)
    return Comparison(
        outputs=outputs,
        rmse_over_floor=ratio,
        rmse_over_floor_interval=ratio_interval,
        runs=tuple(map(score, runs)),
        conditions=tuple(map(score, conditions)),
        places=places,
        worst=worst_places(places),
        depends_on=importance(residuals, found, {name: one.total for name, one in noise.items()}),
        labels={
            "position": "position along the chain",
            **{item.name: item.shown.label for item in found.items},
        },
        n_places=sum(len(place.outputs) for place in places),
        n_samples=sum(error.n for error in outputs.values()),
        n_effective=sum(error.n_effective for error in outputs.values()),
        judged=all(error.source in JUDGED_BY for error in outputs.values()),
        remarks=(
            *measurement.remarks,
            *floor_remarks(floors),
            *_remarks(measurement, names, residuals, noiseless),
        ),
        bookkeeping=tuple(bookkeeping),
    )


def _remarks(
    measurement: Measurement, names: Sequence[str], residuals: Residuals, noiseless: Sequence[str]
) -> list[str]:
    remarks: list[str] = []
    if noiseless:
        remarks.append(
            Remark(
                f"{', '.join(noiseless)}: readings without any noise; there is no floor to compare with.",
                Rank.FLOOR,
            )
        )
    lost = sum(
        int((np.isfinite(run.outputs[name]) & ~np.isfinite(error[name])).sum())
        for run, error in zip(measurement.runs, residuals, strict=True)
        for name in names
    )
    if lost:
        remarks.append(f"{lost} readings are left out, because the model found no equilibrium there.")
    if left := [name for name in measurement.outputs if name not in names]:
        remarks.append(f"Not compared, because the model or the file has no values of it: {', '.join(left)}.")
    if len(measurement.runs) == 1:
        remarks.append("There is one run only: offsets between runs cannot be told from errors of the model.")
    return remarks


LARGE = 0.25  # of the squared error
STANDS_OUT = 0.15  # of the squared error more than of the readings
DENSER = 1.2  # of its share of the readings: below, the error is no denser there than elsewhere
ONE_SIDED = 0.5  # of the rms error there: with a smaller mean the error has both signs
CLUE = 0.15  # of the error's variance
LIFT = 1.25  # a narrower place is named when its error is denser by so much…
KEPT = 0.8  # …and it keeps so much of the error


def interpret(comparison: Comparison) -> str:
    """Whether the model is wrong beyond the noise, and where most."""
    if not comparison.judged:
        why = f"Whether that is more than the bench's own scatter cannot be judged, because {_missing(comparison)}."
        place = headline(comparison)
        return f"{_size(comparison)}. {why}{f' What stands out of it: {_place(place)}' if place else ''}"
    low, high = comparison.rmse_over_floor_interval
    left = Excess(comparison.rmse_over_floor, (high - low) / (2.0 * STANDARD_ERRORS))  # about 95 %
    where = headline(comparison)
    if where is None and not comparison.significant:
        if left.small:
            return (
                f"Within the noise: the error is {times(comparison)} the noise floor and no condition stands out. "
                "Nothing to explain here."
            )
        return (
            f"The error is {times(comparison)} the noise, but no condition stands out among "
            f"{comparison.n_places} looked at: the floor may be too low, or the runs too few to tell."
        )
    start = (
        f"The model is off by {times(comparison)} the noise"
        if not left.slight
        else f"The error is {times(comparison)} the noise, so little is left to explain, yet it is no pure noise"
    )
    if where is None and left.slight:
        where = max(comparison.significant, key=lambda place: abs(place.z))
    if where is None:
        return f"{start}; the error is spread over all conditions{_bias(comparison)}.{_goes_with(comparison)}"
    return f"{start}; {_place(where)}{_goes_with(comparison)}"


def headline(comparison: Comparison) -> Place | None:
    """Where most of the squared error is, or a narrower place inside it where it is clearly denser.

    Only places whose share of it is large and stands out: beyond noise, and clearly more of the error than of the
    readings. Of those that overlap, the one with the most error beyond its part of the readings.
    """
    standing = [
        place
        for place in comparison.places
        if place.more_than_noise
        and place.share_of_error >= LARGE
        and place.excess >= STANDS_OUT
        and place.share_of_error > DENSER * place.share_of_samples
    ]
    if not standing:
        return None
    top = max(standing, key=lambda place: place.excess)
    narrower = [
        place
        for place in standing
        if place is not top
        and top.condition in place.condition
        and place.share_of_error >= KEPT * top.share_of_error
        and place.rms_over_floor**2 >= LIFT * top.rms_over_floor**2
    ]
    return max(narrower, key=lambda place: place.share_of_error) if narrower else top


def times(comparison: Comparison) -> str:
    """The error in units of the floor: "3.1 times"."""
    ratio = comparison.rmse_over_floor
    return f"{ratio:.1f} times" if ratio < 10 else f"{ratio:.0f} times"


def _size(comparison: Comparison) -> str:
    errors = [(unit_of(name), error.rmse) for name, error in comparison.outputs.items()]
    texts = [f"{words.text(rmse, 2)} in {words.label}" for words, rmse in errors]
    more = f" and {len(texts) - 3} more" if len(texts) > 3 else ""
    noise = f", {times(comparison)} the noise between neighbouring readings" if comparison.has_floor else ""
    return f"The error is {', '.join(texts[:3])} (root mean square){more}{noise}"


def _missing(comparison: Comparison) -> str:
    without = [unit_of(n).label for n, error in comparison.outputs.items() if error.source not in JUDGED_BY]
    if all(error.source == NO_NOISE for error in comparison.outputs.values()):
        return "the readings have no noise at all"
    which = "" if len(without) == len(comparison.outputs) else f" for {listed(without)}"
    return f"no run was repeated and no sigma is stated{which}"


def _place(place: Place) -> str:
    """How much of the error lies at a place, and which way it goes."""
    there, words = place.outputs[place.output], unit_of(place.output)
    mean = there.mean
    way = (
        f"There the measured {words.label} lies {words.text(abs(mean), 2)} {_side(mean)} the model on average."
        if abs(mean) >= ONE_SIDED * there.rms
        else f"There the measured {words.label} is off by {words.text(there.rms, 2)} rms, to both sides of the model."
    )
    return (
        f"{whole_percent(place.share_of_error)} of the squared error is at {place.condition} "
        f"({whole_percent(place.share_of_samples)} of the readings). {way}"
    )


def _side(error: float) -> str:
    return "above" if error > 0 else "below"


def _goes_with(comparison: Comparison) -> str:
    """What tells most of the error, where it tells enough to be a clue."""
    name, told = next(iter(comparison.depends_on.items()), ("", 0.0))
    if told < CLUE:
        return ""
    labels = listed([comparison.labels.get(part, part) for part in name.split(" × ")])
    return f" The error goes most with {labels}, which tell{'' if ' × ' in name else 's'} {whole_percent(told)} of it."


def _bias(comparison: Comparison) -> str:
    name, error = max(comparison.outputs.items(), key=lambda one: abs(one[1].bias) / one[1].noise.total)
    if abs(error.bias) < 0.5 * error.rmse:
        return ""
    size = unit_of(name).text(abs(error.bias), 2)
    return f": the measured {unit_of(name).label} lies {size} {_side(error.bias)} the model on average"
