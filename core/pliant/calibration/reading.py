"""Bench data for a calibration: a tensile test, or a module's free actuation curve, from a CSV.

tensile: `stretch` or `strain` (nominal), `nominal_stress_pa`; free: `pressure_pa` (or `tendon_force_n`), `angle_rad`
(or `extension_m`). Endings may name other units (`nominal_stress_mpa`, `strain_percent`, `angle_deg`). Either may have
`specimen` and a `sigma_…` of the measured column; a tensile table `test`, a free curve `moment_n_m`, which must be 0.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from pliant.calibration.plausible import ADVICE, check_free, check_tensile
from pliant.errors import UserError, closest
from pliant.formatting import plural
from pliant.mechanics.homogeneous import MODES
from pliant.records.design import Array
from pliant.tabular.text import Problems, Sheet, lines_text, open_sheet
from pliant.tabular.units import ENDINGS, conversion, stem, unit_in

Kind = Literal["tensile", "free"]
TESTS = (*MODES, "free")
# Column without its unit → unit in SI, "" for a pure number.
UNITS = {
    **{"stretch": "", "strain": "", "nominal_stress": "Pa"},
    **{"pressure": "Pa", "tendon_force": "N", "angle": "rad", "extension": "m", "moment": "N*m"},
}
SUFFIXES = {"Pa": "_pa", "N": "_n", "rad": "_rad", "m": "_m", "N*m": "_n_m", "": ""}
TEXTS = ("specimen", "test")
OF_KIND: dict[Kind, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "tensile": (("stretch", "strain"), ("nominal_stress",)),
    "free": (("pressure", "tendon_force"), ("angle", "extension")),
}
EXAMPLES: dict[Kind, str] = {"tensile": "stretch,nominal_stress_pa", "free": "pressure_pa,angle_rad"}


@dataclass(frozen=True)
class Column:
    """A column of the file: what it holds without its unit, and value in SI = scale · written value."""

    written: str
    stem: str
    scale: float
    sigma: bool = False

    @property
    def name(self) -> str:
        """The name in SI."""
        return self.stem + SUFFIXES[UNITS[self.stem]]


@dataclass(frozen=True, eq=False)
class BenchData:
    """The rows of one table.

    Attributes:
        source, sha256: the file and its digest.
        kind: tensile or free.
        x_name, y_name: `stretch` (strains are turned into stretches) and `nominal_stress_pa`; or those of a free curve.
        x, y: (n,) in SI.
        mode: (n,) kind of homogeneous test of each row; empty texts for a free curve.
        sigma: (n,) standard deviations of y, None where the file states none.
        specimen: (n,) names, empty where the file has none.
        remarks: what was left out or converted.
    """

    source: str
    sha256: str
    kind: Kind
    x_name: str
    y_name: str
    x: Array
    y: Array
    mode: np.ndarray
    sigma: Array | None
    specimen: np.ndarray
    remarks: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.y)


@dataclass
class _Rows:
    """Columns as they are read: texts and numbers by name, and the line of each row."""

    texts: dict[str, list[str]] = field(default_factory=dict)
    numbers: dict[str, list[float]] = field(default_factory=dict)
    lines: list[int] = field(default_factory=list)


def read_bench_data(path: Path, test: str | None = None) -> BenchData:
    """Read a table.

    Args:
        path: the CSV.
        test: free, or the kind of homogeneous test of rows that do not say; by default the columns tell.

    Raises:
        UserError: with the file and the line: no such file, a column is missing, numbers that cannot be.
    """
    path = Path(path)
    if test is not None and test not in TESTS:
        raise UserError(f"--test {test}: it is one of {', '.join(TESTS)}{closest(test, TESTS)}")
    with open_sheet(path, EXAMPLES["free" if test == "free" else "tensile"]) as sheet:
        sheet.problems.advice = ADVICE
        columns = _columns(path, sheet.header)
        kind = _kind(path, sheet.header, columns, test)
        x, y = _needed(path, sheet.header, columns, kind)
        rows = _read(sheet, columns)
    sheet.problems.raise_if_any()
    remarks = _unread(sheet.header, columns)
    kept = _kept(path, rows, (x, y), remarks)
    found = _assembled(path, kind, columns, (x, y), rows, kept, test)
    check = check_tensile if kind == "tensile" else check_free
    lines = np.array(rows.lines)[kept]
    remarks += check(path, x.written, y.written, found[0], found[1], lines)
    return BenchData(
        source=path.name,
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        kind=kind,
        x_name="stretch" if kind == "tensile" else x.name,
        y_name=y.name,
        x=found[0],
        y=found[1],
        mode=found[2],
        sigma=found[3],
        specimen=found[4],
        remarks=tuple(remarks),
    )


def _columns(path: Path, header: Sequence[str]) -> dict[str, Column]:
    """By their names in SI (`sigma_` before it for a standard deviation)."""
    found: dict[str, Column] = {}
    for written in filter(None, header):
        column = _column(written)
        if column is None:
            continue
        key = ("sigma_" if column.sigma else "") + column.name
        if key in found:
            raise UserError(
                f"{path}: columns '{found[key].written}' and '{written}' both mean {key}; keep one."
            )
        found[key] = column
    return found


def _column(written: str) -> Column | None:
    """`nominal_stress_mpa` → the nominal stress, in 1e6 Pa; None for a name that is not known."""
    plain = stem(written).lower().replace(" ", "_")
    bracket = unit_in(written)
    sigma = plain.startswith("sigma_")
    plain = plain.removeprefix("sigma_")
    for name, unit in sorted(UNITS.items(), key=lambda item: -len(item[0])):
        given = ENDINGS.get(plain.removeprefix(f"{name}_")) if plain.startswith(f"{name}_") else None
        if plain == name + SUFFIXES[unit]:
            given = None
        elif given is None and not (plain == name and bracket):
            continue
        if (given := bracket or given) is None:
            return Column(written, name, 1.0, sigma)
        scale, _ = conversion(given, unit or "dimensionless", f"column '{written}'")
        return Column(written, name, scale, sigma)
    return None


def _kind(path: Path, header: Sequence[str], columns: dict[str, Column], test: str | None) -> Kind:
    if test is not None:
        return "free" if test == "free" else "tensile"
    stems = {column.stem for column in columns.values() if not column.sigma}
    for place in (1, 0):  # what was measured says more than what was set
        for kind, columns_of_kind in OF_KIND.items():
            if stems & set(columns_of_kind[place]):
                return kind
    raise UserError(
        f"{path}: it is neither a tensile test (stretch or strain, nominal_stress_pa) nor a free curve (pressure_pa or "
        f"tendon_force_n, angle_rad or extension_m); its columns are {', '.join(filter(None, header))}."
    )


def _needed(
    path: Path, header: Sequence[str], columns: dict[str, Column], kind: Kind
) -> tuple[Column, Column]:
    """What was set and what was measured, one column each."""
    found = []
    for stems in OF_KIND[kind]:
        given = [c for c in columns.values() if c.stem in stems and not c.sigma]
        names = [stem + SUFFIXES[UNITS[stem]] for stem in stems]
        if not given:
            unknown = [name for name in header if name and _column(name) is None]
            raise UserError(f"{path}: column '{_or(names)}' is missing{_meant(names, unknown)}")
        if len(given) > 1:
            raise UserError(
                f"{path}: columns '{given[0].written}' and '{given[1].written}'; keep one of them."
            )
        found.append(given[0])
    return found[0], found[1]


def _or(names: Sequence[str]) -> str:
    return "' or '".join(names)


def _meant(names: Sequence[str], unknown: Sequence[str]) -> str:
    """The end of a sentence: the column that may have been meant."""
    for name in unknown:
        if "half" in name.lower() and "angle" in name.lower():
            return f": it is the joint angle of a module, twice the half-module angle that '{name}' seems to hold."
        if "true" in name.lower() or "cauchy" in name.lower():
            return f": it is force over the area at rest; '{name}' seems to be a true stress (divide by the stretch)."
        if name.lower() in ("stress", "engineering_stress") or name.lower().startswith(("stress_", "eng")):
            return f"; name the column '{name}' so, with its unit, if it is force over the area at rest."
    for name in names:
        hint = closest(name, unknown)
        if hint != ".":
            return hint.replace("did you mean", "the file has").replace("?", ".")
    return "."


def _read(sheet: Sheet, columns: dict[str, Column]) -> _Rows:
    rows = _Rows({name: [] for name in TEXTS if name in sheet.header}, {key: [] for key in columns})
    for block in sheet.blocks():
        rows.lines += block.lines.tolist()
        for name, texts in rows.texts.items():
            texts += [cell.strip() for cell in block.columns[sheet.header.index(name)]]
        for key, column in columns.items():
            values = block.numbers(sheet.header.index(column.written), column.written)
            rows.numbers[key] += (column.scale * values).tolist()
    return rows


def _unread(header: Sequence[str], columns: dict[str, Column]) -> list[str]:
    known = {*TEXTS, *(column.written for column in columns.values())}
    unknown = [name for name in header if name and name not in known]
    if not unknown:
        return []
    return [f"Not read: {plural(len(unknown), 'column')} {', '.join(unknown)}."]


def _kept(path: Path, rows: _Rows, needed: tuple[Column, Column], remarks: list[str]) -> np.ndarray:
    """Rows that have both numbers and no moment; what is left out is said."""
    values = [np.array(rows.numbers[column.name]) for column in needed]
    kept = np.isfinite(values[0]) & np.isfinite(values[1])
    if not np.all(kept):
        lines = [rows.lines[i] for i in np.flatnonzero(~kept)]
        remarks.append(f"Left out: {plural(len(lines), 'row')} with a blank ({lines_text(lines)}).")
    if "moment_n_m" in rows.numbers:
        loaded = kept & (np.nan_to_num(np.array(rows.numbers["moment_n_m"])) != 0)
        if loaded.any():
            lines = [rows.lines[i] for i in np.flatnonzero(loaded)]
            remarks.append(
                f"Left out: {plural(len(lines), 'row')} with a moment ({lines_text(lines)}); a free curve has none."
            )
        kept &= ~loaded
    if not kept.any():
        raise UserError(f"{path}: no row is left to fit. {' '.join(remarks)}".strip())
    return kept


def _assembled(
    path: Path,
    kind: Kind,
    columns: dict[str, Column],
    needed: tuple[Column, Column],
    rows: _Rows,
    kept: np.ndarray,
    test: str | None,
) -> tuple[Array, Array, np.ndarray, Array | None, np.ndarray]:
    """x, y, mode, sigma and specimen of the rows that are kept."""
    x, y = (np.array(rows.numbers[column.name])[kept] for column in needed)
    if needed[0].stem == "strain":
        x = 1 + x
    lines = np.array(rows.lines)[kept]
    problems = Problems(path, advice=ADVICE)
    default = "" if kind == "free" else (test or "uniaxial")
    words = np.array(rows.texts.get("test", [""] * len(rows.lines)), dtype=str)[kept]
    mode = np.array([word.lower() or default for word in words.tolist()])
    for line, word in zip(lines.tolist(), mode.tolist(), strict=True):
        if kind == "tensile" and word not in MODES:
            problems.add(
                line, f"column test: '{word}' is not one of {', '.join(MODES)}{closest(word, MODES)}"
            )
    sigma = None
    if f"sigma_{needed[1].name}" in columns:
        sigma = np.array(rows.numbers[f"sigma_{needed[1].name}"])[kept]
        for line in lines[~(sigma > 0)].tolist():
            problems.add(line, f"column sigma_{needed[1].name}: it must be a number above 0 in every row")
    problems.raise_if_any()
    names = np.array(rows.texts.get("specimen", [""] * len(rows.lines)), dtype=str)[kept]
    return x, y, np.where(mode == default, default, mode), sigma, names
