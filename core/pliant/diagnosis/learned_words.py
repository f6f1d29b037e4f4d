"""Sentences on a learned term: its covariates, the reduction of the error, that it is no cause, what to inspect."""

from __future__ import annotations

from pliant.diagnosis.learned_term import LearnedTerm
from pliant.formatting import NamedUnit, Unit, display_unit, listed, named_unit, output_unit
from pliant.mechanics.learned_curve import CurveAxis

# What the curve changes: its quantity with the SI unit (of the input if empty), and possible causes.
ACTS = {
    "input": ("added to the {input}", "", "the {input} that arrives: gauge, regulator, hose, valve"),
    "moment": (
        "a moment at every joint",
        "N*m",
        "the joints: contact, friction or another additional moment",
    ),
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
    """Return a covariate's name and display unit; `drive` is the name of the chain's input."""
    words = output_unit(drive)
    if axis.name == "actuation":
        return NamedUnit(words.symbol, words.factor, words.word, words.label)
    label, unit = COVARIATES[axis.name]
    if unit == "{input}":
        return NamedUnit(words.symbol, words.factor, words.word, label.format(input=words.label))
    return named_unit(label.format(input=words.label), unit)


def quantity(term: LearnedTerm) -> tuple[str, Unit]:
    """Return what the curve changes, and the unit in which it is shown: shares in percent."""
    label, unit, _ = ACTS[term.form.acts_on]
    words = output_unit(term.drive)
    shown: Unit = Unit("%", 100.0) if unit == "1" else display_unit(unit) if unit else words
    return label.format(input=words.label), shown


def depends_on(term: LearnedTerm) -> str:
    """Return the covariates in words."""
    return listed([covariate_words(axis, term.drive).label for axis in term.form.axes])


def offer(term: LearnedTerm) -> str:
    """Return a sentence that it would help, how much, and how to add it."""
    return (
        f"A learned term would lower the error on {term.on} from {term.before:.2f} to {term.after:.2f} times the "
        f"noise: {described(term)} Add it with pliant improve --learned."
    )


def described(term: LearnedTerm) -> str:
    """Return a description of the term and of its limits."""
    label, _ = quantity(term)
    look = ACTS[term.form.acts_on][2].format(input=output_unit(term.drive).label)
    form = "curve" if len(term.form.axes) == 1 else "surface"
    return (
        f"a smooth {form} over {depends_on(term)} that changes {label.removeprefix('added to ')}, "
        f"{term.freedom:.0f} numbers' worth. It is a description and no cause, and is not valid outside these data; "
        f"look at {look}."
    )
