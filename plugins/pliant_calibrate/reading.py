"""Laboratory data for a calibration: a tensile test, or a module's free actuation curve, from a CSV.

tensile: `stretch` or `strain` (nominal), `nominal_stress_pa`; free: `pressure_pa` (or `tendon_force_n`), `angle_rad`
(or `extension_m`). Endings may name other units (`nominal_stress_mpa`, `strain_percent`, `angle_deg`). Either may have
`specimen` and a `sigma_…` of the measured column; a tensile table `test`, a free curve `moment_n_m`, which must be 0.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from pliant.config.measurements import TensileNotes
from pliant.config.notes import notes_beside
from pliant.errors import UserError, closest
from pliant.formatting import plural
from pliant.mechanics.homogeneous import MODES
from pliant.records.design import Array
from pliant_calibrate.checks import ADVICE, check_at_rest, check_free, check_tensile, steepening
from pliant_tables.cells import Problems, lines_text
from pliant_tables.opening import open_sheet
from pliant_tables.proposals import COMPRESSION, SHEAR, TRUE, lines_to_write, plain_words, proposed
from pliant_tables.schema import (
    FileColumn,
    Known,
    Schema,
    Values,
    check_named,
    read_columns,
    stamped,
)
from pliant_tables.testers import blank_columns, sizes_said, with_stretch_and_stress
from pliant_tables.units import stem

Kind = Literal["tensile", "free"]
SIDE_BY_SIDE = re.compile(r"(stretch|strain|stress)[ _-]+(\w+?)(?:[ _]*[(\[].*)?", re.IGNORECASE)
TESTS = (*MODES, "free")
SIMPLE_SHEAR = "simple shear is not fitted, and 'planar', the pull of a wide strip, is another deformation"
KNOWN = (
    Known("specimen", "", "", "text"),
    Known("test", "", "", "text"),
    Known("stretch", "", "dimensionless", "input"),
    Known("strain", "", "dimensionless", "input"),
    Known("pressure", "_pa", "Pa", "input"),
    Known("tendon_force", "_n", "N", "input"),
    Known("moment", "_n_m", "N*m", "condition"),
    Known("nominal_stress", "_pa", "Pa", "output"),
    Known("angle", "_rad", "rad", "output"),
    Known("extension", "_m", "m", "output"),
)
UNITS = {known.stem + known.unit_suffix: known.unit for known in KNOWN}
OF_KIND: dict[Kind, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "tensile": (("stretch", "strain"), ("nominal_stress_pa",)),
    "free": (("pressure_pa", "tendon_force_n"), ("angle_rad", "extension_m")),
}
CLOCK = Schema((Known("time", "_s", "s", "time"),), "time_s")
SCHEMAS = {
    "tensile": Schema(KNOWN, "stretch,nominal_stress_pa"),
    "free": Schema(KNOWN, "pressure_pa,angle_rad"),
}


@dataclass(frozen=True, eq=False)
class BenchData:
    """The rows of one table.

    Attributes:
        source, sha256: the file and its digest.
        kind: tensile or free.
        x_name, y_name: `stretch` (strains are converted) and `nominal_stress_pa`; or those of a free curve.
        x, y: (n,) in SI.
        mode: (n,) kind of homogeneous test of each row; "" for a free curve.
        sigma: (n,) standard deviations of y, None if the file states none.
        specimen: (n,) names, empty if the file has none.
        remarks: on omitted or converted rows.
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


def read_bench_data(path: Path, test: str | None = None) -> BenchData:
    """Read a table.

    Args:
        path: the CSV.
        test: free, or the kind of homogeneous test of rows that do not state it; by default from the columns.

    Raises:
        UserError: with the file and the line: the file or a column is missing, or numbers are impossible.
    """
    path = Path(path)
    if test is not None and test not in TESTS:
        raise UserError(f"--test {test}: it is one of {', '.join(TESTS)}{closest(test, TESTS)}")
    schema = SCHEMAS["free" if test == "free" else "tensile"]
    found, beside = notes_beside(path, TensileNotes)
    notes_name = beside.name if found is not None and beside is not None else path.with_suffix(".yaml").name
    notes = found or TensileNotes()
    with open_sheet(path, schema.example, notes, notes_name) as sheet:
        sheet.problems.advice = ADVICE
        named = [*sheet.header, *map(stem, sheet.header)]
        check_named(path, notes_name, "rename", notes.rename, named, notes)
        check_named(path, notes_name, "units", notes.units, [*named, *notes.rename.values()], notes)
        blank = {name for name in blank_columns(sheet) if schema.find(name) is None}
        written = ["" if name in blank else name for name in sheet.header]
        columns = schema.matched(path, written, notes)
        if test != "free":
            columns = with_stretch_and_stress(sheet, written, columns, notes, notes_name)
        clock = CLOCK.matched(path, sheet.header, notes, stamped=stamped(sheet)).get("time_s")
        kind = _kind(path, written, columns, test)
        x, y = _needed(path, written, columns, kind)
        if kind == "tensile":
            _check_at_rest_sizes(path, (x, y), notes, notes_name)
        rows = read_columns(sheet, columns)
    remarks = rows.remarks
    if notes.gauge_length_m or notes.section_m2:
        remarks.append(sizes_said(notes))
    kept = _kept(path, rows, (x, y), remarks)
    problems, lines = Problems(path, advice=ADVICE), rows.lines[kept]
    mode, specimen = (np.array(rows.texts.get(n, [""] * len(kept)), str)[kept] for n in ("test", "specimen"))
    default = "" if kind == "free" else (test or "uniaxial")
    mode = np.array([word.lower() or default for word in mode.tolist()])
    for line, word in zip(lines.tolist(), mode.tolist(), strict=True):
        if kind == "tensile" and word not in MODES:
            why = f"; {SIMPLE_SHEAR}" if SHEAR.search(word) else closest(word, MODES)
            problems.add(line, f"column test: '{word}' is not one of {', '.join(MODES)}{why}")
    stated = f"sigma_{y.name}"
    sigma = rows.numbers[stated][kept] if stated in columns else None
    if sigma is not None:
        for line in lines[~(sigma > 0)].tolist():
            problems.add(line, f"column {stated}: it must be a number above 0 in every row")
    problems.raise_if_any()
    set_to, measured = (rows.numbers[column.name][kept] for column in (x, y))
    set_to = 1 + set_to if x.name == "strain" else set_to
    if kind == "tensile":
        set_to, measured = _with_compression_negative((x, y), set_to, measured, remarks)
    if kind == "tensile":
        remarks += check_tensile(path, x.written, y.written, set_to, measured, lines, x.name == "strain")
        remarks += steepening(set_to[mode == "uniaxial"], measured[mode == "uniaxial"])
    else:
        remarks += check_free(path, x.written, y.written, set_to, measured, lines, y.name == "angle_rad")
        remarks += check_at_rest(path, clock.written, x, y, set_to, measured) if clock is not None else []
    return BenchData(
        source=path.name,
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        kind=kind,
        x_name="stretch" if kind == "tensile" else x.name,
        y_name=y.name,
        x=set_to,
        y=measured,
        mode=mode,
        sigma=sigma,
        specimen=specimen,
        remarks=tuple(remarks),
    )


def _kind(path: Path, header: Sequence[str], columns: dict[str, FileColumn], test: str | None) -> Kind:
    if test is not None:
        return "free" if test == "free" else "tensile"
    for place in (1, 0):  # the measured column is more specific than the set one
        for kind, columns_of_kind in OF_KIND.items():
            if set(columns) & set(columns_of_kind[place]):
                return kind
    named = [name for name in header if name]
    _check_side_by_side(path, named)
    wanted = {name: UNITS[name] for kind in OF_KIND.values() for names in kind for name in names}
    said = proposed(named, wanted)
    lines = lines_to_write(path, "", said.rename, said.units, said.reasons)
    sheared = next((name for name in named if SHEAR.search(plain_words(name))), None)
    if sheared is not None and not said.rename:
        raise UserError(f"{path}: '{sheared}': {SIMPLE_SHEAR}. Measure a pull of the rubber.")
    raise UserError(
        f"{path}: it is neither a tensile test (stretch or strain, nominal_stress_pa) nor a free curve (pressure_pa or "
        f"tendon_force_n, angle_rad or extension_m); its columns are {', '.join(named)}.{lines}"
    )


def _needed(
    path: Path, header: Sequence[str], columns: dict[str, FileColumn], kind: Kind
) -> tuple[FileColumn, FileColumn]:
    """Return the set and the measured quantity, one column each."""
    found = []
    for names in OF_KIND[kind]:
        given = [columns[name] for name in names if name in columns]
        if not given:
            read = {column.written for column in columns.values()}
            unknown = [name for name in header if name and name not in read]
            wanted = "' or '".join(names)
            _check_side_by_side(path, unknown)
            said = proposed(unknown, {name: UNITS[name] for name in names})
            lines = lines_to_write(path, "", said.rename, said.units, said.reasons)
            raise UserError(f"{path}: column '{wanted}' is missing{_meant(names, unknown)}{lines}")
        if len(given) > 1:
            raise UserError(
                f"{path}: columns '{given[0].written}' and '{given[1].written}'; keep one of them."
            )
        found.append(given[0])
    return found[0], found[1]


def _check_at_rest_sizes(
    path: Path, needed: Sequence[FileColumn], notes: TensileNotes, notes_name: str
) -> None:
    """Raise `UserError` if a column of the deformed strip, or of simple shear, is renamed to one of a pull."""
    for column in needed:
        if SHEAR.search(plain_words(column.written)):
            where = notes.at(notes_name, "rename", column.written)
            raise UserError(f"{where}: '{column.written}' of {path.name}: {SIMPLE_SHEAR}.")
        if TRUE.search(plain_words(column.written)):
            where = notes.at(notes_name, "rename", column.written)
            raise UserError(
                f"{where}: '{column.written}' of {path.name} says that it is of the deformed strip, and {column.name} "
                "is of the strip at rest. Stretch is exp(true strain), nominal stress the true one over the stretch: "
                "take the file's engineering columns, or convert these and name them so."
            )


def _check_side_by_side(path: Path, named: Sequence[str]) -> None:
    """Raise `UserError` for a table with several tests side by side, each with a stretch and a stress."""
    pairs: dict[str, dict[str, str]] = {}
    for name in named:
        if match := SIDE_BY_SIDE.fullmatch(name):
            pairs.setdefault(match[2].lower(), {})[match[1].lower()] = name
    tests = {test: pair for test, pair in pairs.items() if "stress" in pair and len(pair) == 2}
    if len(tests) < 2:
        return
    first = next(iter(tests.values()))
    strain = next(kind for kind in first if kind != "stress")
    raise UserError(
        f"{path}: it has {len(tests)} tests beside each other ({', '.join(tests)}). Write them below each other, with "
        f"a column test of {', '.join(MODES)}, or take one of them: 'rename: {{{first[strain]}: {strain}, "
        f"{first['stress']}: nominal_stress_pa}}' and its unit, 'units: {{{first['stress']}: MPa}}'."
    )


def _meant(names: Sequence[str], unknown: Sequence[str]) -> str:
    """Return the end of a sentence with the column that was probably meant."""
    for name in unknown:
        if "half" in name.lower() and "angle" in name.lower():
            return f": it is the joint angle of a module, twice the half-module angle that '{name}' seems to hold."
        if "stress" in name.lower() and TRUE.search(plain_words(name)):
            return f": it is force over the area at rest; '{name}' seems to be a true stress (divide by the stretch)."
        if name.lower() in ("stress", "engineering_stress") or name.lower().startswith(("stress_", "eng")):
            return f"; name the column '{name}' so, with its unit, if it is force over the area at rest."
    for name in names:
        hint = closest(name, unknown)
        if hint != ".":
            return hint.replace("did you mean", "the file has").replace("?", ".")
    return "."


def _with_compression_negative(
    columns: Sequence[FileColumn], stretch: Array, stress: Array, remarks: list[str]
) -> tuple[Array, Array]:
    """Return stretch and stress with compression negative; columns that are named as compressive count it positive."""
    x, y = (COMPRESSION.search(plain_words(column.written)) is not None for column in columns)
    turned = []
    if x and np.median(stretch) > 1:
        stretch, turned = 2 - stretch, [columns[0].written]
    if y and np.median(stress) > 0:
        stress, turned = -stress, [*turned, columns[1].written]
    if turned:
        names = " and ".join(f"'{name}'" for name in turned)
        remarks.append(f"{names}: compression is positive there, and was taken as negative.")
    return stretch, stress


def _kept(path: Path, rows: Values, needed: tuple[FileColumn, FileColumn], remarks: list[str]) -> np.ndarray:
    """Return the rows that have both numbers and no moment; add remarks on the omitted ones."""
    kept = np.all([np.isfinite(rows.numbers[column.name]) for column in needed], axis=0)
    loaded = kept & (np.nan_to_num(rows.numbers.get("moment_n_m", np.zeros(len(kept)))) != 0)
    reasons = ((~kept, "with a blank", ""), (loaded, "with a moment", "; a free curve has none"))
    for which, why, end in reasons:
        lines = [rows.lines[i] for i in np.flatnonzero(which)]
        if lines:
            remarks.append(f"Left out: {plural(len(lines), 'row')} {why} ({lines_text(lines)}){end}.")
    kept &= ~loaded
    if not kept.any():
        raise UserError(f"{path}: no row is left to fit. {' '.join(remarks)}".strip())
    return kept
