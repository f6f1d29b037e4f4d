"""The designs of a study's sweep: names are looked up in the family, values parsed, combined and counted."""

from __future__ import annotations

import csv
import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from pliant.config.problems import at_place, sentences
from pliant.config.study import Study, varied, written_name
from pliant.errors import UserError, closest
from pliant.interfaces.base import ComponentConfig
from pliant.interfaces.family import FamilyConfig
from pliant.interfaces.material import MaterialConfig
from pliant.registry.discovery import Registry
from pliant_designs.config import RANGE, SWEPT_BLOCKS, SweepConfig

MOST_DESIGNS = 10_000
DIGITS = 12  # of the values of a range: 0.0055, not 0.005500000000000001
Where = Callable[[Sequence[Any]], str]


@dataclass(frozen=True)
class SweptDesign:
    """One design of a sweep.

    Attributes:
        number: its index in the sweep, from 0.
        changes: SI field names → values; those of the material begin with `material.`.
        family, material: the configs with the changes.
        cause: why the family's config refuses this combination; then `family` is the study's own.
    """

    number: int
    changes: Mapping[str, Any]
    family: FamilyConfig
    material: MaterialConfig
    cause: str = ""

    @property
    def parameters(self) -> dict[str, Any]:
        """Return all parameters of the family and the swept constants of the material, SI."""
        own = {name: value for name, value in self.family.canonical().items() if name != "kind"}
        return {**own, **self.changes}


@dataclass(frozen=True)
class _Parameter:
    """A name of the sweep as the study writes it, and the field that it means."""

    written: str
    block: str
    field: str

    @property
    def name(self) -> str:
        """The SI name: `average_radius_m`, `material.shear_modulus_pa`."""
        return self.field if self.block == "family" else f"{self.block}.{self.field}"

    @property
    def path(self) -> tuple[str, ...]:
        return ("sweep", self.written)


def sweep_designs(study: Study, where: Where = lambda path: "") -> tuple[SweptDesign, ...]:
    """Return all designs of the study's sweep, in the order of a nested loop whose first parameter varies slowest.

    Args:
        study: with `sweep`.
        where: returns the place of a key path ("finger.yaml, line 3").

    Raises:
        UserError: an unknown parameter, invalid values, duplicates, too many designs.
    """
    sweep: SweepConfig = study.need("sweep", "this command")
    at = at_place(where(("sweep",)))
    for block in SWEPT_BLOCKS:
        if getattr(study, block) is None:
            raise UserError(f"{at}'sweep' varies designs, but the study has no '{block}' block.")
    if sweep.designs is not None:
        if sweep.axes:
            raise UserError(f"{at}'sweep' has a table in 'designs' and lists of its own; give one of them.")
        return _combined(study, *_table(study, sweep.designs))
    parameters = [_parameter(study, name, at_place(where(("sweep", name))), "sweep.") for name in sweep.axes]
    if not parameters:
        raise UserError(f"{at}'sweep' names no parameter; write for example 'average_radius: [5 mm, 6 mm]'.")
    _no_doubles([p.name for p in parameters], "'sweep'", at)
    axes = [_values(study, p, value, where) for p, value in zip(parameters, sweep.axes.values(), strict=True)]
    count = math.prod(map(len, axes))
    if count > MOST_DESIGNS:
        product = " × ".join(str(len(axis)) for axis in axes)
        raise UserError(
            f"{at}'sweep' has {count} designs ({product}), more than {MOST_DESIGNS}; shorten its lists or give the "
            "designs that you want as a table, 'designs: designs.csv'."
        )
    return _combined(study, parameters, itertools.product(*axes))


def check_sweep(study: Study, registry: Registry, where: Where) -> None:
    """Raise `UserError`, with its line, for a sweep whose designs cannot be listed."""
    sweep_designs(study, where)


def _combined(
    study: Study, parameters: Sequence[_Parameter], rows: Iterable[tuple[Any, ...]]
) -> tuple[SweptDesign, ...]:
    designs = []
    for number, row in enumerate(rows):
        configs: dict[str, Any] = {block: getattr(study, block) for block in SWEPT_BLOCKS}
        cause = ""
        for block in SWEPT_BLOCKS:
            changes = {p.field: value for p, value in zip(parameters, row, strict=True) if p.block == block}
            try:
                configs[block] = varied(configs[block], changes) if changes else configs[block]
            except ValidationError as error:  # each value is possible, but not this combination
                cause = cause or sentences(error, type(configs[block]), lambda path: "", (block,))
        changes = {p.name: value for p, value in zip(parameters, row, strict=True)}
        designs.append(SweptDesign(number, changes, configs["family"], configs["material"], cause))
    return tuple(designs)


def _parameter(study: Study, written: str, at: str, prefix: str = "") -> _Parameter:
    """Look a name up in the family, or in the block that its prefix names."""
    block, _, bare = str(written).rpartition(".")
    block = block or "family"
    if block not in SWEPT_BLOCKS:
        raise UserError(
            at + f"'{prefix}{written}' cannot be swept; a sweep varies parameters of the family, such as "
            "'average_radius', and of the material, such as 'material.shear_modulus'."
        )
    fields = _fields(getattr(study, block))
    if bare not in fields:
        kind = getattr(study, block).kind
        hint = closest(bare, fields)
        if block == "family" and bare in _fields(study.material):
            hint = f"; did you mean 'material.{bare}'?"
        known = ", ".join(
            dict.fromkeys(written_name(type(getattr(study, block)), f) for f in fields.values())
        )
        raise UserError(
            at + f"'{prefix}{written}' is not a parameter of {block} '{kind}'{hint} Allowed: {known}."
        )
    return _Parameter(str(written), block, fields[bare])


def _fields(config: ComponentConfig | None) -> dict[str, str]:
    """Return names that people may write → field."""
    model = type(config)
    names = [name for name in getattr(model, "model_fields", {}) if name != "kind"]
    return {written: name for name in names for written in (written_name(model, name), name)}  # type: ignore[arg-type]


def _values(study: Study, parameter: _Parameter, written: Any, where: Where) -> list[Any]:
    """Return the parsed values of one parameter: those of a list, or of a range, both ends included."""
    at, key = at_place(where(parameter.path)), f"'{'.'.join(parameter.path)}'"
    if isinstance(written, list | tuple) and written:
        values = [_parsed(study, parameter, value, where) for value in written]
        _no_doubles([repr(value) for value in values], key, at, [str(value) for value in written])
        return values
    if not isinstance(written, Mapping):
        raise UserError(
            f"{at}{key} is an empty list; leave the parameter out or give it values."
            if isinstance(written, list | tuple)
            else f"{at}{key} is {written!r}; it needs a list such as [a, b] or a range "
            "{low: a, high: b, count: 5}."
        )
    if set(written) != RANGE:
        raise UserError(at + f"{key}: a range has the keys low, high and count, no others.")
    count = written["count"]
    if isinstance(count, bool) or not isinstance(count, int) or count < 2:
        raise UserError(at + f"{key}: a range needs a whole number of at least 2 as its count.")
    if count > MOST_DESIGNS:
        raise UserError(
            at + f"{key}: a range of {count} values is more than the {MOST_DESIGNS} designs of a sweep."
        )
    low, high = (_parsed(study, parameter, written[end], where) for end in ("low", "high"))
    if any(isinstance(end, bool) or not isinstance(end, int | float) for end in (low, high)):
        raise UserError(at + f"{key} is no number, so it has no range; give a list.")
    if not low < high:
        raise UserError(at + f"{key}: low must be below high.")
    steps = [low + (high - low) * i / (count - 1) for i in range(count)]
    return [_parsed(study, parameter, float(f"{step:.{DIGITS}g}"), where) for step in steps]


def _parsed(study: Study, parameter: _Parameter, value: Any, where: Where) -> Any:
    """Return one value in SI, checked by the config's rules for that field but not those for several fields."""
    config: ComponentConfig = getattr(study, parameter.block)
    try:
        return getattr(varied(config, {parameter.field: value}), parameter.field)
    except ValidationError as error:
        model = type(config)
        names = {parameter.field, written_name(model, parameter.field)}
        if not any(detail["loc"] and detail["loc"][0] in names for detail in error.errors()):
            return value
        at = ("sweep",) if parameter.block == "family" else ("sweep", parameter.block)
        raise UserError(sentences(error, model, lambda path: where(parameter.path), at)) from None


def _table(study: Study, path: Path) -> tuple[list[_Parameter], list[tuple[Any, ...]]]:
    """Read designs from a CSV: a header of parameters, then one design per row; '#' begins a comment line."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(
            f"{path}: the table of designs cannot be read ({getattr(error, 'strerror', None) or 'not UTF-8'})."
        ) from None
    numbered = [(i, line) for i, line in enumerate(text.splitlines(), start=1)]
    numbered = [(i, line) for i, line in numbered if line.strip() and not line.lstrip().startswith("#")]
    cells = list(csv.reader([line for _, line in numbered], skipinitialspace=True))
    if len(cells) < 2:
        raise UserError(f"{path}: a table of designs needs a header of parameters and at least one row.")
    if len(cells) - 1 > MOST_DESIGNS:
        raise UserError(f"{path}: it has {len(cells) - 1} designs, more than {MOST_DESIGNS}.")
    header = [name.strip() for name in cells[0]]
    parameters = [_parameter(study, name, f"{path}, line {numbered[0][0]}: ") for name in header]
    _no_doubles([p.name for p in parameters], "the header", f"{path}, line {numbered[0][0]}: ")
    rows, lines = [], [i for i, _ in numbered[1:]]
    for line, row in zip(lines, cells[1:], strict=True):
        place = f"{path}, line {line}"
        if len(row) != len(header):
            raise UserError(f"{place}: {len(row)} cells, but the header has {len(header)}.")
        where: Where = lambda keys, place=place: place  # type: ignore[misc]  # noqa: E731
        rows.append(
            tuple(_parsed(study, p, cell.strip(), where) for p, cell in zip(parameters, row, strict=True))
        )
    _no_doubles([repr(row) for row in rows], str(path), "", [f"the design of line {i}" for i in lines])
    return parameters, rows


def _no_doubles(keys: Sequence[str], owner: str, at: str, written: Sequence[str] = ()) -> None:
    first: dict[str, int] = {}
    for index, key in enumerate(keys):
        if key in first:
            shown = written or keys
            again = "" if shown[index] == shown[first[key]] else f" (again as {shown[index]})"
            raise UserError(at + f"{owner} has {shown[first[key]]} twice{again}; keep one.")
        first[key] = index
