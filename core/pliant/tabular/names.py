"""What people call the quantities, in German and English, and the lines that would say which column is what."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from pliant.tabular.units import fits, stem, unit_at_the_end, unit_in

# Stem of Pliant's name → words that mean it and nothing else, in small letters; # is a number, @ an axis.
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
    "frame": ("frame", "frame number", "frame id", "bild", "bildnummer"),
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
# Words that may mean it, for the lines to write alone: what solvers and benches call things.
LIKELY: Mapping[str, str] = {
    "pressure": r"p|pres.*|pn.*|druck.*",
    "tendon_force": r"tendon.*|cable.*|t|tension.*|kraft.*|force.*",
    "angle": r"th.*|phi|alpha|angle.*|rot.*|ur\d?|beta|winkel.*|joint_angle.*|half.*angle.*|bend.*|biege.*",
    "moment": r"m|mom.*|torque.*|rm\d?|mz|my|tau|drehmoment.*",
    "tendon_travel": r"weg|travel.*|stroke.*|hub",
    "payload": r"masse|mass|load.*|last",
    "nominal_stress": r"stress.*|sig.*|spannung.*",
    "extension": r"displ.*|ext.*|delta_?l|elong.*|verschiebung.*",
    "time": r"t|time.*|zeit.*",
}
_FILLED = {
    stem: re.compile(
        "|".join(re.escape(w).replace(r"\#", r"([1-9]\d*)").replace("@", "([xyz])") for w in words)
    )
    for stem, words in WORDS.items()
}
# Numbers of rows: never a quantity.
COUNTER = re.compile(
    r"(sample|row|index|idx|line|record|point|zeile|messpunkt|lfd)([ _]*(nr|no|number|id|index))?|no|nr|n|i|#"
)
# Commands of motors in steps or turns of an encoder, with the motor's number.
STEPS = re.compile(
    r"(?:motor|servo|stepper|m)[ _]*(\d*)[ _]*(?:steps?|pos(?:ition)?|counts?|ticks?|schritte)"
)
CLOSE = 0.7  # likeness from which on a name is a slip of the pen


def is_counter(written: str) -> bool:
    """Whether a name is that of a column that numbers the rows."""
    return COUNTER.fullmatch(stem(written).strip().lower()) is not None


def motor_of_steps(written: str) -> str | None:
    """Return the number of the motor whose steps a column holds, "" for one without a number, or None."""
    match = STEPS.fullmatch(stem(written).strip().lower())
    return None if match is None else match[1]


def meanings(name: str) -> list[str]:
    """The stems that a name without its unit means: ``Druck 2`` → pressure_2; none for a name that nobody knows."""
    plain = re.sub(r"[\s\-.]+", " ", name.strip().lower())
    found = []
    for meant, pattern in _FILLED.items():
        if match := pattern.fullmatch(plain):
            parts = [part for part in match.groups() if part is not None]
            for part in sorted(parts, key=str.isdigit, reverse=True):
                meant = meant.replace("#" if part.isdigit() else "@", part, 1)
            found.append(meant)
    return found


def likely(written: str, units: Mapping[str, str]) -> str:
    """Which of some columns a name and its unit speak for, or an empty text.

    Args:
        written: the name in the file.
        units: SI unit by name of each column that it may be.
    """
    unit = unit_in(written) or unit_at_the_end(written)
    fitting = [name for name in units if unit is None or (units[name] and fits(unit, units[name]))]
    if unit is not None and not fitting and unit_in(written) is None:  # an axis or a number, no unit
        unit, fitting = None, list(units)
    plain = stem(written).lower().strip()
    stems = {name: _stem_of(name, units[name]) for name in fitting}
    known = [name for name in fitting if set(meanings(bare(written))) & {stems[name]}]
    named = [name for name in fitting if re.fullmatch(LIKELY.get(stems[name], "$."), plain)]
    near = difflib.get_close_matches(bare(written).lower(), [stems[n] for n in fitting], n=1, cutoff=CLOSE)
    slips = [name for name in fitting if [stems[name]] == near]
    return [*known, *slips, *named, *(fitting if unit is not None else ()), ""][0]


def bare(written: str) -> str:
    """A name without its unit, in brackets or at its end: ``angel_deg`` → angel."""
    plain = stem(written)
    if plain == written and unit_at_the_end(plain):
        return re.sub(r"(_n)?_[^_]+$", "", plain)
    return plain


def _stem_of(name: str, unit: str) -> str:
    """`pressure_pa` → pressure."""
    return re.sub(r"(_n_m|_pa|_rad|_kg|_strain|_n|_m|_s|_c)$", "", name) if unit else name


def lines_to_write(
    path: Path, notes_name: str, rename: Mapping[str, str], units: Mapping[str, str], more: Iterable[str] = ()
) -> str:
    """The YAML to paste, on lines of its own below a message; an empty text where there is nothing to say."""
    blocks = [(key, pairs) for key, pairs in (("rename", rename), ("units", units)) if pairs]
    lines = [
        line for key, pairs in blocks for line in (f"{key}:", *(f'  "{n}": {v}' for n, v in pairs.items()))
    ]
    lines += more
    if not lines:
        return ""
    if " block of " in notes_name:
        lines = ["measurements:", *("  " + line for line in lines)]
        where = f"Write into {notes_name}"
    else:
        where = f"Write into {notes_name or path.with_suffix('.yaml').name} beside it"
    return "\n".join([f"\n{where} (and check that they are meant so):", *lines])


def proposed(written: Sequence[str], units: Mapping[str, str]) -> tuple[dict[str, str], dict[str, str]]:
    """What `rename` and `units` may say: for each needed column the first name in the file that speaks for it.

    Args:
        written: names in the file that are free to mean something.
        units: SI unit by name of each column that is needed.
    """
    rename: dict[str, str] = {}
    said: dict[str, str] = {}
    for name in written:
        if is_counter(name):
            continue
        meant = likely(name, {other: unit for other, unit in units.items() if other not in rename.values()})
        if meant:
            rename[name] = meant
            if unit_in(name) is None and units[meant]:
                asked = f"{units[meant]}  # or another unit: the file does not say"
                said[name] = unit_at_the_end(name) or asked
    return rename, said
