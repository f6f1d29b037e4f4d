"""A learned term in words: what it depends on, how far the error falls, that it is no cause, what to look for."""

from __future__ import annotations

from pliant.diagnosis.learned_term import LearnedTerm
from pliant.formatting import NamedUnit, Unit, display_unit, listed, named_unit, unit_of
from pliant.mechanics.learned_curve import CurveAxis

# What the curve changes: its quantity with the SI unit (of the input where it is empty), and what may do such a thing.
ACTS = {
    "input": ("added to the {input}", "", "the {input} that arrives: gauge, regulator, hose, valve"),
    "moment": ("a moment at every joint", "N*m", "something that pushes, rubs or catches at the joints"),
    "elastic": ("the stiffness of every joint", "1", "the walls: what makes them stiffer or softer"),
    "actuation": (
        "what the {input} does at every joint",
        "1",
        "the drive: what makes the {input} act more or less",
    ),
    "reading": ("the angles that are read", "rad", "the angle sensor and how it is mounted"),
}
COVARIATES = {
    "angle": ("angle", "rad"),
    "rate": ("rate of the angle", ""),
    "temperature": ("temperature", "degC"),
    "time": ("time in the run", "s"),
    "travel": ("cycles of the {input} done by the specimen", ""),
    "actuation_rate": ("rate of the {input}", ""),
    "actuation_direction": ("direction of the {input}'s change", ""),
    "angle_direction": ("direction of the angle's change", ""),
    "actuation_change": ("recent change of the {input}", "{input}"),
    "angle_change": ("recent change of the angle", "rad"),
    "largest_angle": ("largest angle so far", "rad"),
}


def covariate_words(axis: CurveAxis, drive: str) -> NamedUnit:
    """A covariate's name and display unit; `drive` is the name of the chain's input."""
    words = unit_of(drive)
    if axis.name == "actuation":
        return NamedUnit(words.symbol, words.factor, words.word, words.label)
    label, unit = COVARIATES[axis.name]
    if unit == "{input}":
        return NamedUnit(words.symbol, words.factor, words.word, label.format(input=words.label))
    return named_unit(label.format(input=words.label), unit)


def quantity(found: LearnedTerm) -> tuple[str, Unit]:
    """What the curve changes, and the unit in which it is shown: shares in percent."""
    label, unit, _ = ACTS[found.form.acts_on]
    words = unit_of(found.drive)
    shown: Unit = Unit("%", 100.0) if unit == "1" else display_unit(unit) if unit else words
    return label.format(input=words.label), shown


def depends_on(found: LearnedTerm) -> str:
    """The covariates in words."""
    return listed([covariate_words(axis, found.drive).label for axis in found.form.axes])


def offer(found: LearnedTerm) -> str:
    """That it would help, how far, and how it is added."""
    return (
        f"A learned term would lower the error on {found.on} from {found.before:.2f} to {found.after:.2f} times the "
        f"noise: {described(found)} Add it with pliant improve --learned."
    )


def described(found: LearnedTerm) -> str:
    """What it is and what it is not."""
    label, _ = quantity(found)
    look = ACTS[found.form.acts_on][2].format(input=unit_of(found.drive).label)
    form = "curve" if len(found.form.axes) == 1 else "surface"
    return (
        f"a smooth {form} over {depends_on(found)} that changes {label.removeprefix('added to ')}, "
        f"{found.freedom:.0f} numbers' worth. It is a description and no cause, and says nothing outside these data; "
        f"look at {look}."
    )
