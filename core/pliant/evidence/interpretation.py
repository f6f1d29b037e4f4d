"""A comparison in one or two plain sentences."""

from __future__ import annotations

from pliant.evidence.comparison import JUDGED_BY, NO_NOISE, Comparison
from pliant.evidence.places import Place
from pliant.formatting import listed, unit_of, whole_percent

NEAR = 1.2  # times the floor: nothing to explain when no place stands out
DENSER = 1.2  # of its share of the readings: below, the error is no denser there than elsewhere
CLUE = 0.15  # of the error's variance
LIFT = 1.25  # a narrower place is named when its error is denser by so much…
KEPT = 0.8  # …and it keeps so much of the error


def interpret(comparison: Comparison) -> str:
    """Whether the model is wrong beyond the noise, and where most."""
    if not comparison.judged:
        why = f"Whether that is more than the bench's own scatter cannot be judged, because {_missing(comparison)}."
        return f"{_size(comparison)}. {why}{_mostly(comparison)}"
    ratio = comparison.rmse_over_floor
    if not comparison.significant:
        if ratio < NEAR:
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
        if ratio >= NEAR
        else f"The error is {times(comparison)} the noise, so little is left to explain, yet it is no pure noise"
    )
    where = headline(comparison)
    if where is None and ratio < NEAR:
        where = max(comparison.significant, key=lambda place: abs(place.z))
    if where is None:
        return f"{start}; the error is spread over all conditions alike{_bias(comparison)}.{_goes_with(comparison)}"
    return f"{start}; {_share(where)}. {_direction(where)}{_goes_with(comparison)}"


def headline(comparison: Comparison) -> Place | None:
    """The place to look at first: the worst, or a narrower one inside it where the error is clearly denser."""
    significant = [
        p for p in comparison.worst if p.significant and p.share_of_error > DENSER * p.share_of_samples
    ]
    if not significant:
        return None
    top = significant[0]
    narrower = [
        place
        for place in significant[1:]
        if top.condition in place.condition
        and place.share_of_error >= KEPT * top.share_of_error
        and place.rms_over_floor**2 >= LIFT * top.rms_over_floor**2
    ]
    return narrower[0] if narrower else top


def times(comparison: Comparison) -> str:
    """The error in units of the floor: "3.1 times"."""
    ratio = comparison.rmse_over_floor
    return f"{ratio:.1f} times" if ratio < 10 else f"{ratio:.0f} times"


def _size(comparison: Comparison) -> str:
    texts = [
        f"{unit_of(name).text(error.rmse, 2)} in {unit_of(name).label}"
        for name, error in comparison.outputs.items()
    ]
    more = f" and {len(texts) - 3} more" if len(texts) > 3 else ""
    noise = f", {times(comparison)} the noise between neighbouring readings" if comparison.has_floor else ""
    return f"The error is {', '.join(texts[:3])} (root mean square){more}{noise}"


def _missing(comparison: Comparison) -> str:
    without = [unit_of(n).label for n, error in comparison.outputs.items() if error.source not in JUDGED_BY]
    if all(error.source == NO_NOISE for error in comparison.outputs.values()):
        return "the readings have no noise at all"
    which = "" if len(without) == len(comparison.outputs) else f" for {listed(without)}"
    return f"no run was repeated and no sigma is stated{which}"


def _mostly(comparison: Comparison) -> str:
    place = headline(comparison)
    return f" What stands out of it: {_share(place)}. {_direction(place)}" if place else ""


def _share(place: Place) -> str:
    return (
        f"{whole_percent(place.share_of_error)} of the squared error is at {place.condition} "
        f"({whole_percent(place.share_of_samples)} of the readings)"
    )


def _direction(place: Place) -> str:
    mean = place.outputs[place.output].mean
    words = unit_of(place.output)
    side = "above" if mean > 0 else "below"
    return f"There the measured {words.label} lies {words.text(abs(mean), 2)} {side} the model on average."


def _goes_with(comparison: Comparison) -> str:
    """What tells most of the error, where it tells enough to be a clue."""
    name, told = next(iter(comparison.depends_on.items()), ("", 0.0))
    if told < CLUE:
        return ""
    labels = listed([comparison.labels.get(part, part) for part in name.split(" × ")])
    return f" The error goes most with {labels}, which tell{'' if ' × ' in name else 's'} {whole_percent(told)} of it."


def _bias(comparison: Comparison) -> str:
    name = max(
        comparison.outputs, key=lambda n: abs(comparison.outputs[n].bias) / comparison.outputs[n].noise.total
    )
    error, words = comparison.outputs[name], unit_of(name)
    if abs(error.bias) < 0.5 * error.rmse:
        return ""
    side = "above" if error.bias > 0 else "below"
    return f": the measured {words.label} lies {words.text(abs(error.bias), 2)} {side} the model on average"
