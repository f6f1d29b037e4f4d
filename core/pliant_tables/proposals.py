"""Proposals of columns of a file for those that are needed, and the lines of notes for them.

A column is proposed by its name, its unit and its content, each with the reason, never by its position in the file.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pliant_tables.names import bare, is_counter, meanings
from pliant_tables.units import fits, stem, unit_at_the_end, unit_in

_NO_POSITION = (
    r"(?!.*(rotat|\brot|orient|quat|covar|euler|angl|forc|momen|torq|accel|veloc|gyro|magn|curv|press))"
)
_AXIS = _NO_POSITION + r"(.*[ :_])?{0}([ _]?(pos(ition)?|coord(inate)?))?"
_OF_A_TEST = r"(nominal|eng|engineering|technical|tensile|compressive|compression)"
# Possible names, for proposals only: names used by solvers and laboratories.
LIKELY: Mapping[str, str] = {
    "pressure": r"p|pres.*|pn.*|druck.*",
    "tendon_force": r"tendon.*|cable.*|t|tension.*|(kraft|force)(?!.*(plat|ground|boden|grip|contact)).*",
    "angle": r"th.*|phi|alpha|angle.*|rot.*|ur\d?|beta|winkel.*|joint_angle.*|half.*angle.*|bend.*|biege.*",
    "moment": r"m|mom.*|torque.*|rm\d?|mz|my|tau|drehmoment.*",
    "tendon_travel": r"weg|travel.*|stroke.*|hub",
    "payload": r"masse|mass|load.*|last",
    "nominal_stress": rf"({_OF_A_TEST}[ _])?stress.*|sig.*|spannung.*",
    "strain": rf"({_OF_A_TEST}[ _])?strain.*|dehnung.*|stauchung.*",
    "extension": r"displ.*|ext.*|delta_?l|elong.*|verschiebung.*",
    "time": r"t|time.*|zeit.*",
    **{f"tip_{axis}": _AXIS.format(axis) for axis in "xyz"},
}
COMMAND = re.compile(
    r"\b(command\w*|cmd|set|set ?point|soll\w*|target|desired|demand\w*|reference|ref|theoretical|nominal)\b"
)
QUALIFIERS = re.compile(r"\b(actual|measured|meas|ist|real|raw|filtered|sensor|current)\b")
# True (deformed) quantities of the strip: force over the area under load, and the logarithm of the stretch.
VACUUM = re.compile(r"\b(vacuum|vakuum|unterdruck|suction)\b")
COMPRESSION = re.compile(r"\b(compress\w*|stauch\w*|druckkraft|druckspannung)\b")
SHEAR = re.compile(r"\b(shear|schub\w*|scher\w*)\b")
TRUE = re.compile(r"\b(true|cauchy|log|logarithmic|hencky|wahre)\b")
OF_THE_STRIP_AT_REST = ("nominal_stress", "strain", "stretch")
CLOSE = 0.7  # likeness from which a name is a misspelling
NOT_BY_UNIT = ("dimensionless", "", "N", "m")  # a force may be a tester's, a length any position
ANYTHING = ("percent", "%", "dimensionless", "-", "1")


@dataclass(frozen=True)
class Proposed:
    """Proposed `rename` and `units`, by the file's names, with the `reasons` for each."""

    rename: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)


def plain_words(written: str) -> str:
    """Return a name in small letters, blanks between its parts, without its unit: ``Measured_pressure`` → …"""
    return " ".join(re.split(r"[\s_\-.:]+", bare(written).lower().strip()))


def is_command(written: str) -> bool:
    """Return whether a name is that of a command, whose measured value may be in another column."""
    return COMMAND.search(plain_words(written)) is not None


def likely(written: str, units: Mapping[str, str]) -> tuple[str, str]:
    """Return which of some columns a name and its unit indicate, and why; empty texts if they indicate none.

    Args:
        written: the name in the file.
        units: SI unit by name of each column that it may be.
    """
    unit = unit_in(written) or unit_at_the_end(written)
    fitting = [name for name in units if unit is None or (units[name] and fits(unit, units[name]))]
    if unit is not None and not fitting and unit_in(written) is None:  # an axis or a number, not a unit
        unit, fitting = None, list(units)
    words = QUALIFIERS.sub("", COMMAND.sub("", plain_words(written))).strip()
    spelt = (stem(written).lower().strip(), words, words.replace(" ", "_"))
    stems = {name: _name_stem(name, units[name]) for name in fitting}
    known = [name for name in fitting if set(meanings(bare(written))) & {stems[name]}]
    near = difflib.get_close_matches(bare(written).lower(), [stems[n] for n in fitting], n=1, cutoff=CLOSE)
    slips = [name for name in fitting if [stems[name]] == near]
    named = [n for n in fitting if any(re.fullmatch(LIKELY.get(stems[n], "$."), text) for text in spelt)]
    by = "name" if unit is None else "name and unit"
    true = TRUE.search(plain_words(written)) is not None
    if speaking := [n for n in (*known, *slips, *named) if not (true and stems[n] in OF_THE_STRIP_AT_REST)]:
        return speaking[0], f"by its {by}"
    alone = [name for name in fitting if units[name] not in NOT_BY_UNIT and not true]
    kinds = {re.sub(r"_([xyz]|\d+)$", "", stems[name]) for name in alone}
    if unit is not None and unit not in ANYTHING and len(kinds) == 1:
        return alone[0], f"by its unit, {unit}, alone"
    return "", ""


def _name_stem(name: str, unit: str) -> str:
    """Return the stem of a name: `pressure_pa` → pressure."""
    return re.sub(r"(_n_m|_pa|_rad|_kg|_strain|_n|_m|_s|_c)$", "", name) if unit else name


def proposed(written: Sequence[str], units: Mapping[str, str]) -> Proposed:
    """Return proposed `rename` and `units`: for each needed column the first name that indicates it.

    Measured values precede commands. Numbers of rows are never proposed.

    Args:
        written: names in the file that are free to mean something.
        units: SI unit by name of each column that is needed.
    """
    proposal = Proposed()
    passed: dict[str, str] = {}
    for name in sorted(written, key=is_command):
        if is_counter(name):
            continue
        free = {other: unit for other, unit in units.items() if other not in proposal.rename.values()}
        meant, reason = likely(name, free)
        if not meant and is_command(name):
            passed.setdefault(likely(name, units)[0], name)
        if not meant:
            continue
        proposal.rename[name], proposal.reasons[name] = meant, reason
        if unit_in(name) is None and units[meant]:
            asked = f"{units[meant]}  # or another unit: the file does not say"
            proposal.units[name] = unit_at_the_end(name) or asked
    for name, meant in proposal.rename.items():
        if meant in passed:
            proposal.reasons[name] += f"; '{passed[meant]}' is its command"
    return proposal


def lines_to_write(
    path: Path,
    notes_name: str,
    rename: Mapping[str, str],
    units: Mapping[str, str],
    reasons: Mapping[str, str] | None = None,
    more: Iterable[str] = (),
) -> str:
    """Return the YAML to paste, on separate lines below a message; an empty text without proposals."""
    why = reasons or {}
    said = {name: f"{meant}  # {why[name]}" if name in why else meant for name, meant in rename.items()}
    blocks = [(key, pairs) for key, pairs in (("rename", said), ("units", units)) if pairs]
    lines = [
        line
        for key, pairs in blocks
        for line in (f"{key}:", *(f"  {_key(n)}: {v}" for n, v in pairs.items()))
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


def _key(name: str) -> str:
    """Return a column's name as a quoted key of YAML."""
    return '"{}"'.format(name.replace("\\", "\\\\").replace('"', '\\"'))
