"""Columns of a measurement file: which names are known, in which unit, and what each is for."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from typing import Literal

from pliant.errors import UserError, closest
from pliant.tabular.units import ENDINGS, conversion, fits, stem, unit_in

Role = Literal["text", "time", "input", "condition", "cycle", "output", "sigma", "count"]


@dataclass(frozen=True)
class Known:
    """A family of columns: `stem` and `unit_suffix` make the name, as regular expressions."""

    stem: str
    unit_suffix: str
    unit: str
    role: Role


# The measurement CSV of docs/measurement_files.md.
KNOWN = (
    Known(r"run", "", "", "text"),
    Known(r"specimen", "", "", "text"),
    Known(r"time", "_s", "s", "time"),
    Known(r"pressure(_[1-9]\d*)?", "_pa", "Pa", "input"),
    Known(r"tendon_force(_[1-9]\d*)?", "_n", "N", "input"),
    Known(r"tendon_travel", "_m", "m", "output"),  # an input where the chain says so
    Known(r"moment", "_n_m", "N*m", "condition"),
    Known(r"tip_force_[xyz]", "_n", "N", "condition"),
    Known(r"payload", "_kg", "kg", "condition"),
    Known(r"valve_open", "", "", "condition"),  # 1: connected to the supply, 0: closed off
    Known(r"temperature", "_c", "degC", "condition"),
    Known(r"base_(roll|pitch|yaw)", "_rad", "rad", "condition"),
    Known(r"cycle", "", "", "cycle"),
    Known(r"angle", "_rad", "rad", "output"),
    Known(r"joint_[1-9]\d*_angle", "_rad", "rad", "output"),
    Known(r"tip_[xyz]", "_m", "m", "output"),
    Known(r"marker_[1-9]\d*_[xyz]", "_m", "m", "output"),
    Known(r"elongation", "_strain", "dimensionless", "output"),
    Known(r"successes", "", "", "count"),
    Known(r"trials", "", "", "count"),
)
# Names to suggest from: one of each family.
EXAMPLES = (
    *("run", "specimen", "time_s", "pressure_pa", "pressure_1_pa", "tendon_force_n", "tendon_travel_m"),
    *(
        "moment_n_m",
        "tip_force_x_n",
        "tip_force_y_n",
        "tip_force_z_n",
        "payload_kg",
        "temperature_c",
        "valve_open",
    ),
    *("base_roll_rad", "base_pitch_rad", "base_yaw_rad", "cycle", "angle_rad", "joint_1_angle_rad"),
    *("tip_x_m", "tip_y_m", "tip_z_m", "marker_1_x_m", "marker_1_y_m", "marker_1_z_m"),
    *("elongation_strain", "successes", "trials", "sigma_angle_rad"),
)


@dataclass(frozen=True)
class Column:
    """A column of a file that Pliant reads.

    Attributes:
        written: its name in the file.
        name: Pliant's name, SI unit in it.
        role: what it is for.
        unit: SI unit of `name`.
        scale, shift: value in SI = scale · written value + shift.
    """

    written: str
    name: str
    role: Role
    unit: str
    scale: float = 1.0
    shift: float = 0.0


@cache
def find(name: str) -> Known | None:
    """The family of a column in SI, or None."""
    for known in KNOWN:
        if re.fullmatch(known.stem + known.unit_suffix, name):
            return known
    return None


def unit_of(name: str) -> str:
    """SI unit of a column or output: "rad" for `angle_rad`, "" for texts and counts.

    Raises `UserError` for a name that is not in docs/measurement_files.md.
    """
    known = find(name.removeprefix("sigma_"))
    if known is None:
        raise UserError(f"'{name}' is not a column of a measurement{closest(name, EXAMPLES)}")
    return known.unit


def is_output(name: str) -> bool:
    known = find(name)
    return known is not None and known.role == "output"


def column_of(written: str, name: str, unit: str | None, inputs: frozenset[str]) -> Column | None:
    """The column that `name` means; None for a name that is not known.

    Args:
        written: the name in the file, for messages.
        name: the name after renaming; it may end in another unit of the same kind (`angle_deg`).
        unit: the unit that the notes give for it, before the one in the name.
        inputs: names that drive the chain; `tendon_travel_m` is an output where it does not.

    Raises `UserError` for a unit that does not fit.
    """
    plain = stem(name).lower().replace(" ", "_")
    prefix = "sigma_" if plain.startswith("sigma_") else ""
    plain = plain.removeprefix(prefix)
    si, suffix_unit = _in_si(plain, unit or unit_in(written))
    known = find(si)
    if known is None or (prefix and known.role != "output"):
        return None
    role: Role = "sigma" if prefix else "input" if si in inputs else known.role
    scale, shift = 1.0, 0.0
    source = unit or suffix_unit or (unit_in(written) if known.unit else None)
    if source is not None:
        if not known.unit:
            raise UserError(f"column '{written}' has no unit; take it out of 'units'.")
        scale, shift = conversion(source, known.unit, f"column '{written}'")
    return Column(written, prefix + si, role, known.unit, scale, 0.0 if prefix else shift)


def _in_si(name: str, unit: str | None) -> tuple[str, str | None]:
    """`angle_deg` → (`angle_rad`, "deg"); a name in SI → (itself, None); `angle` with a unit beside it → its name."""
    if find(name) is not None:
        return name, None
    for known in KNOWN if unit else ():
        if known.unit and re.fullmatch(known.stem, name) and fits(str(unit), known.unit):
            return name + known.unit_suffix, unit
    parts = name.split("_")
    for cut in range(1, len(parts)):
        stem, ending = "_".join(parts[:cut]), ENDINGS.get("_".join(parts[cut:]))
        for known in KNOWN if ending else ():
            if known.unit and re.fullmatch(known.stem, stem) and fits(str(ending), known.unit):
                return stem + known.unit_suffix, ending
    return name, None
