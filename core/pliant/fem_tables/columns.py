"""Columns of a table of states: their names by the joint's kind (docs/command_line.md), and the notes next to it.

The notes state which column is what, in which unit, with which sign (docs/bring_your_own_data.md).
Implausible data are refused: pressures that are hardly in pascals, states that contradict each other or their slopes.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Container, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from pydantic import Field

from pliant.config.measurements import ColumnNotes, Name
from pliant.config.notes import notes_beside
from pliant.errors import UserError
from pliant.records.actuation import actuation_kind, driving, is_known, is_travel
from pliant.records.design import Array
from pliant.records.law import EXTENSIBLE_AXES, EXTENSION, JointKind
from pliant_tables.names import bare, meanings
from pliant_tables.proposals import lines_to_write, proposed
from pliant_tables.schema import check_named, noted
from pliant_tables.units import conversion, stem, unit_in

ACTUATIONS = ("pressure_pa", "tendon_force_n")  # suggested for a header without any
LABELS = ("branch", "status", "role")
EFFORTS = ("iterations", "wall_s")  # of the solver
ALL = "all"  # axis of a state in which several are prescribed
WORDS = {"axis": (*EXTENSIBLE_AXES, ALL), "branch": ("free", "constrained"), "role": ("fit", "check")}
# SI unit of columns that may have another unit.
UNITS = {
    **{"pressure_pa": "Pa", "tendon_force_n": "N", "angle_rad": "rad", "moment_n_m": "N*m"},
    **{"extension_m": "m", "force_n": "N"},
}
_OF_AXIS = re.compile(r"(angle|extension|moment|force)_[xyze]_(rad|m|n_m|n)")
_SLOPE = re.compile(r"d(moment|force)(_[xyze])?_d(?:p(?:_([1-9]\d*))?|u(_[xyze])?)")
_OF_AXES = re.compile(r"angle_[xyz]_rad|extension_[xyze]_m|moment_[xyz]_n_m|force_[xyze]_n")


class StateColumns(NamedTuple):
    """Columns of u, τ and its slopes; every state needs the first two."""

    deformation: str
    effort: str
    by_actuation: str
    by_deformation: str

    @property
    def numbers(self) -> dict[str, str]:
        """Return column → field of `FemDataset`."""
        fields = ("angle_rad", "moment_n_m", "dmoment_dp", "dmoment_du", "energy_j")
        return dict(zip((*self, "energy_j"), fields, strict=True))

    def all_axes_columns(self, axes: Sequence[str], inputs: int = 1) -> list[str]:
        """Return the columns of all axes: u, τ, ∂τ_i/∂p, ∂τ_i/∂u_j row by row.

        With several inputs ∂τ_i/∂a_j, row by row, replace ∂τ_i/∂p.
        """
        columns = [PRISMATIC if i == EXTENSION else self for i in axes]
        names = [[name.split("_", 1) for name in own[:2]] for own in columns]
        efforts = [f"d{effort[0]}_{i}" for (_, effort), i in zip(names, axes, strict=True)]
        return [
            *(f"{u[0]}_{i}_{u[1]}" for (u, _), i in zip(names, axes, strict=True)),
            *(f"{effort[0]}_{i}_{effort[1]}" for (_, effort), i in zip(names, axes, strict=True)),
            *(name for effort in efforts for name in by_inputs(f"{effort}_dp", inputs)),
            *(f"{effort}_du_{j}" for effort in efforts for j in axes),
        ]

    def main_axis_columns(self, inputs: int = 1) -> list[str]:
        """Return columns of the only axis, or of the main one: u, τ, ∂τ/∂p (by each of several inputs), ∂τ/∂u."""
        return [*self[:2], *by_inputs(self.by_actuation, inputs), self.by_deformation]


def by_inputs(slope: str, inputs: int) -> list[str]:
    """Return columns of a slope by all inputs, numbered in the order of the inputs' columns if there are several."""
    return [slope] if inputs == 1 else [f"{slope}_{place}" for place in range(1, inputs + 1)]


REVOLUTE = StateColumns("angle_rad", "moment_n_m", "dmoment_dp", "dmoment_du")
PRISMATIC = StateColumns("extension_m", "force_n", "dforce_dp", "dforce_du")
KNOWN = frozenset((*WORDS, *LABELS, *EFFORTS, *REVOLUTE.numbers, *PRISMATIC.numbers))


def joint_columns(joint: JointKind) -> StateColumns:
    """Return the columns of a joint."""
    return PRISMATIC if joint == "prismatic" else REVOLUTE


def is_data(name: str) -> bool:
    """Return whether a column contains data and is therefore no parameter of the design."""
    patterns = (_OF_AXES, _SLOPE)
    return (
        name in KNOWN
        or is_known(name)
        or is_travel(name)
        or any(pattern.fullmatch(name) is not None for pattern in patterns)
    )


def state_column_unit(name: str) -> str | None:
    """Return the SI unit of an input, of u or of the effort, also of one axis of several; None for other columns."""
    plain = _plain(name)
    return actuation_kind(plain).unit if is_known(plain) else UNITS.get(plain)


def slope_input_number(name: str) -> int | None:
    """Return the number of the input of a slope: 1 for the first, 0 without a number; None for other columns."""
    slope = _SLOPE.fullmatch(name)
    return int(slope[3] or 0) if slope is not None and "_dp" in name else None


class TableNotes(ColumnNotes):
    """Notes on an external table. The file `fem.yaml` next to `fem.csv` contains these keys."""

    angle: Literal["module", "half_module"] = Field(
        default="module", description="half_module: the angle is that of half a module and is doubled"
    )
    moment: Literal["opposes actuation", "sign reversed"] = Field(
        default="opposes actuation", description="sign reversed: a positive moment helps the actuation"
    )
    between: dict[Name, tuple[float, float]] = Field(
        default_factory=dict,
        description="rows outside are left out, SI: {angle_rad: [-0.02, 0.9]} ends a law at the module's stops",
    )


def table_digest(path: Path) -> str:
    """Return the digest that identifies a table's content, its notes included."""
    notes, file = notes_beside(path, TableNotes)
    beside = b"\0" + file.read_bytes() if notes is not None and file is not None else b""
    return "sha256:" + hashlib.sha256(path.read_bytes() + beside).hexdigest()


def table_notes(path: Path) -> tuple[TableNotes, str]:
    """Return the notes next to a table, and the name of the file to write them into."""
    found, beside = notes_beside(path, TableNotes)
    return found or TableNotes(), (beside if found is not None and beside else path.with_suffix(".yaml")).name


class StateHeader:
    """The columns of one table: their names after renaming, the factor to SI of each."""

    def __init__(self, path: Path, written: Sequence[str]) -> None:
        """Read the notes; raise `UserError` for notes on missing columns, and for units that do not fit."""
        self.notes, self.file = notes, _ = table_notes(path)
        self.written = written
        stems = list(map(stem, written))
        check_named(path, self.file, "rename", notes.rename, [*written, *stems], notes)
        check_named(path, self.file, "units", notes.units, [*written, *stems, *notes.rename.values()], notes)
        renamed = [noted(notes.rename, *both) for both in zip(written, stems, strict=True)]
        self.names = [
            new or (plain if plain in UNITS or is_known(plain) else name)
            for name, plain, new in zip(written, stems, renamed, strict=True)
        ]
        check_named(path, self.file, "between", notes.between, self.names, notes)
        self.stated: dict[str, str] = {}
        self.factors = dict.fromkeys(self.names, 1.0)
        for name, both in zip(self.names, zip(written, stems, strict=True), strict=True):
            self._convert(path, name, *both)
        for name in self.factors:
            if _plain(name) == "angle_rad" and notes.angle == "half_module":
                self.factors[name] *= 2
            if _plain(name) in ("moment_n_m", "force_n") and notes.moment == "sign reversed":
                self.factors[name] *= -1
        for name in self.factors:
            if slope := _SLOPE.fullmatch(name):
                self.factors[name] = self._slope_factor(slope)

    @property
    def inputs(self) -> list[str]:
        """Return the columns that drive the module, in their order."""
        return driving(self.names)

    def _convert(self, path: Path, name: str, written: str, plain: str) -> None:
        key = next((key for key in (written, plain, name) if key in self.notes.units), None)
        si = state_column_unit(name)
        if si is None:
            if key is not None:
                slope = "; a slope is in the units of its columns" if _SLOPE.fullmatch(name) else ""
                raise UserError(
                    f"{self.file}: 'units' has '{key}', which is read as it stands{slope}. Units are "
                    f"understood of {', '.join(UNITS)}."
                )
        elif unit := self.notes.units[key] if key else unit_in(written):
            where = f"{self.file}: 'units' of '{key}'" if key else f"{path}: column '{written}'"
            where += f", which is taken for {name}"
            self.stated[name] = unit
            self.factors[name] = conversion(unit, si, where)[0]

    def _slope_factor(self, slope: re.Match[str]) -> float:
        """Return the factor to SI of a slope, which has the units and signs of its two columns."""
        effort, axis, place, along = slope.groups()
        of = (REVOLUTE if effort == "moment" else PRISMATIC).effort.split("_", 1)
        travels = along == f"_{EXTENSION}" or (effort == "force" and along is None)
        u = (PRISMATIC if travels else REVOLUTE).deformation.split("_", 1)
        of_input = [*self.inputs, ""][int(place or 1) - 1 : int(place or 1)]
        divisor = "".join(of_input) if "_dp" in slope[0] else f"{u[0]}{along or ''}_{u[1]}"
        return self.factors.get(f"{of[0]}{axis or ''}_{of[1]}", 1.0) / self.factors.get(divisor, 1.0)

    @property
    def _free(self) -> list[str]:
        return [name for name, known in zip(self.written, self.names, strict=True) if not is_data(known)]

    def asked_inputs(self) -> Sequence[str]:
        """Return the inputs to suggest for a header without any: numbered ones if its words number several."""
        meant = {one for name in self._free for one in meanings(bare(name))}
        numbered = sorted(f"{one}_pa" for one in meant if re.fullmatch(r"pressure_\d+", one))
        return numbered if len(numbered) > 1 else ACTUATIONS

    def lines_to_write(self, path: Path, needed: Sequence[str]) -> str:
        """Return the YAML that would map the header; columns that names and units do not identify are left blank.

        It also lists what no header states: whether an angle is that of half a module, which way a moment acts.
        """
        free = self._free
        asked = {name: state_column_unit(name) or "" for name in needed if name not in self.written}
        found = proposed(free, asked)
        rename, units = dict(found.rename), dict(found.units)
        given = set(rename.values())
        lacking = [
            one
            for one in needed
            if one not in given and (one not in ACTUATIONS or not given & set(ACTUATIONS))
        ]
        for name in [name for name in free if name not in rename] if lacking else ():
            rename[name] = f"  # <- one of {', '.join(lacking)}, or leave the line out"
            if unit_in(name) is None:
                units[name] = "  # <- its unit"
        more = []
        if of_angle := [name for name, meant in rename.items() if "angle_rad" in meant]:
            half = "half" in of_angle[0].lower()
            more.append(f"angle: {'half_module  # or: module' if half else 'module  # or: half_module'}")
        if {"moment_n_m", "force_n"} & {*rename.values(), *lacking}:
            more.append("moment: opposes actuation  # or: sign reversed")
        return lines_to_write(path, "", rename, units, found.reasons, more)


def _plain(name: str) -> str:
    """Return the name of a column of one axis of several without the axis: angle_x_rad is an angle_rad."""
    match = _OF_AXIS.fullmatch(name)
    return f"{match[1]}_{match[2]}" if match else name


# Range of a soft robot's largest pressure; a gauge in kPa or a pressure in mPa is outside.
LEAST_PA, MOST_PA = 500.0, 5e6
LEAST_IN_KPA = 0.5  # smaller values are unlikely in kPa; in bar or MPa they are possible
MOST_N = 5000.0  # of a soft robot's tendon
# Of the effort's change along a line of states: error of stated slopes, and least change.
SLOPE_MISS, LEAST_CHANGE = 0.3, 0.1
# Of the moment's range: repeats scatter, a tenth is a mistake.
CONTRADICTION = 0.1
FEWEST = 6  # states: with fewer there is no law, and nothing to judge
Named = tuple[str, Array]  # a column's name and its numbers (n,), SI


def check_actuation(path: Path, name: str, values: Array, stated: Container[str], notes: str) -> None:
    """Raise `UserError` where an actuation is unlikely in its SI unit and its unit is not stated."""
    largest = float(np.abs(values).max())
    if len(values) < FEWEST or name in stated:
        return
    beside, kind = f"into {notes} beside it", actuation_kind(name).name
    if kind == "tendon_force_n" and largest > MOST_N:
        raise UserError(
            f"{path}: column {name} reaches {largest:g} N; is it in mN? Write {beside} the line "
            f"'units: {{{name}: mN}}', or 'units: {{{name}: N}}' if it is right."
        )
    if kind == "pressure_pa" and largest > MOST_PA:
        raise UserError(
            f"{path}: column {name} reaches {largest:g} Pa ({largest / 1e6:g} MPa), which no soft robot bears; "
            f"correct it, or write 'units: {{{name}: Pa}}' {beside} if it is right."
        )
    if kind == "pressure_pa" and 0 < largest < LEAST_PA:
        in_kpa = largest >= LEAST_IN_KPA
        guess, asked = ("kPa", "is it in kPa?") if in_kpa else ("MPa", "is it in MPa, or in bar?")
        raise UserError(
            f"{path}: column {name} reaches only {largest:g} Pa; {asked} Write {beside} the line "
            f"'units: {{{name}: {guess}}}', or 'units: {{{name}: Pa}}' if it is right."
        )


def check_slopes(
    path: Path, lines: Sequence[int], along: Array, fixed: Array, of: Named, stated: Named
) -> None:
    """Raise `UserError` where a column of slopes contradicts the change of the effort between neighbouring states.

    Neighbours along `along` (n,) have the same `fixed` (n, f); between two of them the effort changes by the mean of
    their slopes times the step, to second order. A wrong sign or unit has a much larger error.
    """
    (effort_name, efforts), (slope_name, slopes) = of, stated
    there = np.flatnonzero(np.isfinite(slopes))
    order = there[np.lexsort((slopes[there], efforts[there], along[there], *fixed[there].T))]
    a, b = order[:-1], order[1:]
    steps = np.all(fixed[a] == fixed[b], axis=1) & (along[a] < along[b])
    a, b = a[steps], b[steps]
    changes = efforts[b] - efforts[a]
    told = (slopes[a] + slopes[b]) / 2 * (along[b] - along[a])
    missed, change = np.abs(changes - told), float(np.abs(changes).sum())
    if not a.size or missed.sum() <= SLOPE_MISS * change or change <= LEAST_CHANGE * np.ptp(efforts[there]):
        return
    worst = int(np.argmax(missed))
    raise UserError(
        f"{path}: column {slope_name} contradicts {effort_name}: from line {lines[a[worst]]} to line {lines[b[worst]]} "
        f"it changes by {changes[worst]:.3g} (SI), by the slopes by {told[worst]:.3g}. Slopes are in the units and "
        "signs of the columns that they are of; correct the column, or leave it out."
    )


def check_agreement(path: Path, lines: Sequence[int], at: Sequence[Named], effort: Named) -> None:
    """Raise `UserError` with the lines of two states that have the same position and different efforts."""
    allowed = CONTRADICTION * np.ptp(effort[1])
    first: dict[tuple[float, ...], tuple[float, int]] = {}
    for *place, moment, line in zip(*(values for _, values in at), effort[1], lines, strict=True):
        other, before = first.setdefault(tuple(place), (moment, line))
        if abs(moment - other) > allowed:
            where = " and ".join(f"{name} = {value:g}" for (name, _), value in zip(at, place, strict=True))
            raise UserError(
                f"{path}, lines {before} and {line} contradict each other: at {where} one has {effort[0]} = {other:g}, "
                f"the other {moment:g}"
            )
