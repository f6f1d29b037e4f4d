"""Common names of the quantities, in German and English."""

from __future__ import annotations

import re
from collections.abc import Mapping

from pliant_tables.units import last_word, stem, unit_at_the_end

# Stem of Pliant's name → words that mean only that, in small letters; # is a number, @ an axis.
WORDS: Mapping[str, tuple[str, ...]] = {
    "run": ("run", "run id", "messung", "versuch", "durchlauf", "aufnahme", "recording"),
    "specimen": ("specimen", "specimen id", "probe", "probekörper", "prüfling"),
    "cycle": ("cycle", "cycle number", "zyklus", "zyklusnummer"),
    "time": (
        "time",
        "t",
        "zeit",
        "elapsed time",
        "messzeit",
        "timestamp",
        "time stamp",
        "zeitstempel",
        "datum",
        "date",
    )
    + ("datetime", "date time", "date/time", "datum/uhrzeit", "uhrzeit", "time of day"),
    "frame": ("frame", "frame number", "frame id", "frame#", "coords", "bild", "bildnummer"),
    "pressure": (
        "pressure",
        "p",
        "druck",
        "chamber pressure",
        "kammerdruck",
        "innendruck",
        "gauge pressure",
        "überdruck",
    ),
    "pressure_#": ("pressure #", "p#", "p #", "druck #", "kammerdruck #", "pressure chamber #"),
    "tendon_force": ("tendon force", "tendon tension", "cable force", "cable tension", "seilkraft"),
    "tendon_travel": ("tendon travel", "cable travel", "seilweg"),
    "moment": ("moment", "torque", "drehmoment", "biegemoment"),
    "angle": ("angle", "winkel", "bend angle", "bending angle", "biegewinkel"),
    "joint_#_angle": ("joint # angle", "joint angle #", "gelenkwinkel #"),
    "tip_@": ("tip @", "@ tip", "tip position @", "spitze @"),
    "marker_#_@": ("marker # @", "marker #@"),
    "elongation": ("elongation", "strain", "dehnung"),
    "strain": ("strain", "dehnung", "nominal strain", "engineering strain"),
    "stretch": ("stretch", "stretch ratio", "streckung"),
    "nominal_stress": ("nominal stress", "nennspannung"),
    "force": ("force", "kraft"),
    "extension": ("extension", "längung", "verlängerung"),
    "payload": ("payload", "nutzlast", "zuladung"),
    "temperature": ("temperature", "temperatur", "t"),
    "successes": ("successes", "erfolge"),
    "trials": ("trials", "versuche"),
}
_FILLED = {
    stem: re.compile(
        "|".join(re.escape(w).replace(r"\#", r"([1-9]\d*)").replace("@", "([xyz])") for w in words)
    )
    for stem, words in WORDS.items()
}
# Numbers of rows, never a quantity.
COUNTER = re.compile(
    r"(sample|row|index|idx|line|record|point|zeile|messpunkt|lfd)([ _]*(nr|no|number|id|index))?|no|nr|n|i|#"
)
# Commands of motors in steps or turns of an encoder, with the motor's number.
STEPS = re.compile(
    r"(?:motor|servo|stepper|m)[ _]*(\d*)[ _]*(?:steps?|pos(?:ition)?|counts?|ticks?|schritte)"
)


def is_counter(written: str) -> bool:
    """Return whether a name is that of a column that numbers the rows."""
    return COUNTER.fullmatch(stem(written).strip().lower()) is not None


def step_motor_number(written: str) -> str | None:
    """Return the number of the motor whose steps a column contains, "" for one without a number, or None."""
    match = STEPS.fullmatch(stem(written).strip().lower())
    return None if match is None else match[1]


def meanings(name: str) -> list[str]:
    """Return the stems that a name without its unit means: ``Druck 2`` → pressure_2; empty for an unknown name."""
    plain = re.sub(r"[\s\-.]+", " ", name.strip().lower())
    found = []
    for meant, pattern in _FILLED.items():
        if match := pattern.fullmatch(plain):
            parts = [part for part in match.groups() if part is not None]
            for part in sorted(parts, key=str.isdigit, reverse=True):
                meant = meant.replace("#" if part.isdigit() else "@", part, 1)
            found.append(meant)
    return found


def bare(written: str) -> str:
    """Return a name without its unit, in brackets or at its end: ``angel_deg`` → angel."""
    plain = stem(written)
    if plain == written and unit_at_the_end(plain):
        return (
            re.sub(r"(_n)?_[^_]+$", "", plain) if not last_word(plain) else plain.rpartition(" ")[0].strip()
        )
    return plain
