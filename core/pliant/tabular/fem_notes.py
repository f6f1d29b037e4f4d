"""The YAML beside a table from elsewhere: which column is what, in which unit, with which sign."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from pydantic import Field

from pliant.config.measurements import ColumnNotes, Name
from pliant.errors import UserError
from pliant.tabular.notes import check_named, noted, notes_beside
from pliant.tabular.units import conversion, fits, stem, unit_at_the_end, unit_in

# SI unit of what may come in another unit.
UNITS = {
    **{"pressure_pa": "Pa", "tendon_force_n": "N", "angle_rad": "rad", "moment_n_m": "N*m"},
    **{"extension_m": "m", "force_n": "N"},
}
# What solvers call them, where a unit does not tell.
CALLED = {
    "pressure_pa": r"p|pres.*|pn.*|druck.*",
    "tendon_force_n": r"tendon.*|cable.*|t|tension.*",
    "angle_rad": r"th.*|phi|alpha|angle.*|rot.*|ur\d?|beta|winkel.*|joint_angle.*|half.*angle.*",
    "moment_n_m": r"m|mom.*|torque.*|rm\d?|mz|my|tau|drehmoment.*",
}
_OF_AXIS = re.compile(r"(angle|extension|moment|force)_[xyz]_(rad|m|n_m|n)")
_SLOPE = re.compile(r"d(moment|force)(_[xyz])?_d([pu])(_[xyz])?")


class TableNotes(ColumnNotes):
    """What a table from elsewhere does not say of itself. The file `fem.yaml` beside `fem.csv` holds these keys."""

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
    """What keys a table's content, its notes included."""
    content = path.read_bytes()
    notes, file = notes_beside(path, TableNotes)
    if notes is not None and file is not None:
        content += b"\0" + file.read_bytes()
    return "sha256:" + hashlib.sha256(content).hexdigest()


class Columns:
    """The columns of one table: their names after renaming, the factor to SI of each."""

    def __init__(self, path: Path, header: Sequence[str]) -> None:
        """Raises `UserError` for notes on columns that are not there, and for units that do not fit."""
        found, beside = notes_beside(path, TableNotes)
        self.file = (beside if found is not None and beside else path.with_suffix(".yaml")).name
        self.notes = found or TableNotes()
        self.written = list(header)
        named = [*header, *map(stem, header)]
        check_named(path, self.file, "rename", self.notes.rename, named)
        check_named(path, self.file, "units", self.notes.units, [*named, *self.notes.rename.values()])
        self.names = [self._name(written) for written in header]
        check_named(path, self.file, "between", self.notes.between, self.names)
        self.stated: dict[str, str] = {}
        self.factors: dict[str, float] = {}
        for written, name in zip(header, self.names, strict=True):
            self._convert(path, written, name)
        for name in self.names:
            if plain_name(name) == "angle_rad" and self.notes.angle == "half_module":
                self.factors[name] = 2 * self.factors.get(name, 1.0)
            if plain_name(name) in ("moment_n_m", "force_n") and self.notes.moment == "sign reversed":
                self.factors[name] = -self.factors.get(name, 1.0)
        for name in self.names:
            if slope := _SLOPE.fullmatch(name):
                self.factors[name] = self._of_slope(*slope.groups())

    def converted(self, name: str, text: str) -> str:
        """A cell in SI; what is not a number stays as it is, for the message."""
        factor = self.factors.get(name, 1.0)
        if factor == 1.0 or not text:
            return text
        try:
            return repr(factor * float(text)) if "_" not in text else text
        except ValueError:
            return text

    def keeps(self, row: Mapping[str, str]) -> bool:
        """Whether a row in SI lies where the notes want it; a cell that is no number is kept, for the message."""
        for name, (low, high) in self.notes.between.items():
            try:
                if not low <= float(row[name]) <= high:
                    return False
            except ValueError:
                continue
        return True

    def _of_slope(self, effort: str, axis: str | None, by: str, along: str | None) -> float:
        """Factor to SI of a slope, which is in the units and signs of the columns that it is of."""
        effort_unit, deformation, unit = (
            ("n_m", "angle", "rad") if effort == "moment" else ("n", "extension", "m")
        )
        of = f"{effort}{axis or ''}_{effort_unit}"
        actuations = [name for name in ("pressure_pa", "tendon_force_n") if name in self.names]
        by_names = actuations if by == "p" else [f"{deformation}{along or ''}_{unit}"]
        return self.factors.get(of, 1.0) / self.factors.get(by_names[0] if by_names else "", 1.0)

    def _name(self, written: str) -> str:
        new = noted(self.notes.rename, written, stem(written))
        return new or (stem(written) if stem(written) in UNITS else written)

    def _convert(self, path: Path, written: str, name: str) -> None:
        units = self.notes.units
        unit = noted(units, written, stem(written), name) or unit_in(written)
        noted_as = next((key for key in (written, stem(written), name) if key in units), None)
        if plain_name(name) not in UNITS:
            if noted_as is not None:
                slope = "; a slope is in the units of its columns" if _SLOPE.fullmatch(name) else ""
                raise UserError(
                    f"{self.file}: 'units' has '{noted_as}', which is read as it stands{slope}. Units are "
                    f"understood of {', '.join(UNITS)}."
                )
            return
        if unit is None:
            return
        where = f"{self.file}: 'units' of '{noted_as}'" if noted_as else f"{path}: column '{written}'"
        factor, _ = conversion(unit, UNITS[plain_name(name)], f"{where}, which is taken for {name}")
        self.stated[name] = unit
        if factor != 1.0:
            self.factors[name] = factor


def plain_name(name: str) -> str:
    """The name of a column of one axis of several, without the axis: angle_x_rad is an angle_rad."""
    match = _OF_AXIS.fullmatch(name)
    return f"{match[1]}_{match[2]}" if match else name


def lines_to_write(path: Path, header: Sequence[str], needed: Sequence[str]) -> str:
    """The YAML that would map the header, as far as names and units tell; an empty text where nothing does."""
    rename: dict[str, str] = {}
    units: dict[str, str] = {}
    half = False
    for written in header:
        meant = _meant(written)
        if meant is None or meant in rename.values() or meant in header or meant not in needed:
            continue
        rename[written] = meant
        half = half or (meant == "angle_rad" and "half" in written.lower())
        if unit_in(written) is None and (unit := unit_at_the_end(written)):
            units[written] = unit
    if not rename:
        return ""
    file = path.with_suffix(".yaml").name
    text = f"\nWrite into {file} beside it (and check that they are meant so):\n{_block('rename', rename)}"
    if units:
        text += f"\n{_block('units', units)}"
    return text + ("\nangle: half_module" if half else "")


def _block(key: str, pairs: Mapping[str, str]) -> str:
    return "\n".join([f"{key}:", *(f'  "{name}": {value}' for name, value in pairs.items())])


def _meant(written: str) -> str | None:
    """The column that a name and its unit speak for."""
    unit = unit_in(written) or unit_at_the_end(written)
    plain = stem(written).lower().strip()
    fitting = [name for name in CALLED if unit is None or fits(unit, UNITS[name])]
    if unit is not None and not fitting and unit_in(written) is None:  # an axis or a number, no unit
        unit, fitting = None, list(CALLED)
    named = [name for name in fitting if re.fullmatch(CALLED[name], plain)]
    if unit is not None and fitting and not named:
        return fitting[0]
    return named[0] if named else None
