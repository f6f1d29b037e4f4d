"""Sentences on a comparison: whether the model is wrong beyond the noise, and where most."""

from __future__ import annotations

from pliant.evidence.comparison import JUDGED_BY, NO_NOISE, Comparison
from pliant.evidence.error_bins import ErrorBin
from pliant.evidence.excess import STANDARD_ERRORS, Excess
from pliant.formatting import listed, output_unit, whole_percent

LARGE = 0.25  # of the squared error
STANDS_OUT = 0.15  # of the squared error more than of the readings
DENSER = 1.2  # of its share of the readings: below, the error is no denser there than elsewhere
ONE_SIDED = 0.5  # of the rms error there: with a smaller mean the error has both signs
CLUE = 0.15  # of the error's variance
LIFT = 1.25  # a narrower place is named when its error is denser by this factor…
KEPT = 0.8  # …and it keeps this share of the error


def interpret(comparison: Comparison) -> str:
    """Return a sentence on whether the model is wrong beyond the noise, and where most."""
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
                "No unexplained error."
            )
        return (
            f"The error is {times(comparison)} the noise, but no condition stands out among "
            f"{comparison.n_places} looked at: the floor may be too low, or the runs too few to decide."
        )
    start = (
        f"The model is off by {times(comparison)} the noise"
        if not left.slight
        else f"The error is {times(comparison)} the noise: little is left to explain, but more than noise leaves"
    )
    if where is None and left.slight:
        where = max(comparison.significant, key=lambda place: abs(place.z))
    if where is None:
        return f"{start}; the error is spread over all conditions{_bias(comparison)}.{_goes_with(comparison)}"
    return f"{start}; {_place(where)}{_goes_with(comparison)}"


def located(comparison: Comparison) -> str:
    """Return where the error is, without its size, which other runs or another floor would change."""
    where = headline(comparison)
    if where is not None:
        said = _place(where)
        return f"{said[:1].upper()}{said[1:]}{_goes_with(comparison)}"
    if not comparison.judged or not comparison.significant:
        return "No condition stands out in the error."
    return f"The error is spread over all conditions{_bias(comparison)}.{_goes_with(comparison)}"


def headline(comparison: Comparison) -> ErrorBin | None:
    """Return the place with most of the squared error, or a narrower place inside it with a clearly denser error.

    Only places with a large and prominent share count: beyond noise, and clearly more of the error than of the
    readings. Among overlapping places the one with the largest excess over its share of the readings is taken; None
    without one.
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
    """Return the error in units of the floor, such as "3.1 times"."""
    ratio = comparison.rmse_over_floor
    return f"{ratio:.1f} times" if ratio < 10 else f"{ratio:.0f} times"


def _size(comparison: Comparison) -> str:
    errors = [(output_unit(name), error.rmse) for name, error in comparison.outputs.items()]
    texts = [f"{words.text(rmse, 2)} in {words.label}" for words, rmse in errors]
    more = f" and {len(texts) - 3} more" if len(texts) > 3 else ""
    noise = f", {times(comparison)} the noise between neighbouring readings" if comparison.has_floor else ""
    return f"The error is {', '.join(texts[:3])} (root mean square){more}{noise}"


def _missing(comparison: Comparison) -> str:
    without = [
        output_unit(n).label for n, error in comparison.outputs.items() if error.source not in JUDGED_BY
    ]
    if all(error.source == NO_NOISE for error in comparison.outputs.values()):
        return "the readings have no noise at all"
    which = "" if len(without) == len(comparison.outputs) else f" for {listed(without)}"
    return f"no run was repeated and no sigma is stated{which}"


def _place(place: ErrorBin) -> str:
    """Return a sentence on a place's share of the error and its sign."""
    there, words = place.outputs[place.output], output_unit(place.output)
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
    """Return a sentence on the covariate that explains most of the error; empty if it explains little."""
    name, told = next(iter(comparison.depends_on.items()), ("", 0.0))
    if told < CLUE:
        return ""
    labels = listed([comparison.labels.get(part, part) for part in name.split(" × ")])
    verb = "explain" if " × " in name else "explains"
    return f" The error goes most with {labels}, which {verb} {whole_percent(told)} of it."


def _bias(comparison: Comparison) -> str:
    name, error = max(comparison.outputs.items(), key=lambda one: abs(one[1].bias) / one[1].noise.total)
    if abs(error.bias) < 0.5 * error.rmse:
        return ""
    size = output_unit(name).text(abs(error.bias), 2)
    return f": the measured {output_unit(name).label} lies {size} {_side(error.bias)} the model on average"
