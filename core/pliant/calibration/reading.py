"""Bench data for a calibration: a tensile test, or a module's free actuation curve, from a CSV.

tensile: `stretch` or `strain` (nominal), `nominal_stress_pa`; free: `pressure_pa` (or `tendon_force_n`), `angle_rad`
(or `extension_m`). Endings may name other units (`nominal_stress_mpa`, `strain_percent`, `angle_deg`). Either may have
`specimen` and a `sigma_…` of the measured column; a tensile table `test`, a free curve `moment_n_m`, which must be 0.

What bench data can and cannot be: a strain in percent, a stress of the wrong sign, a modulus no rubber has.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from pliant.config.measurements import ColumnNotes
from pliant.errors import UserError, closest
from pliant.formatting import plural
from pliant.mechanics.homogeneous import MODES
from pliant.records.design import Array
from pliant.tabular.cells import Problems, lines_text
from pliant.tabular.names import lines_to_write, proposed
from pliant.tabular.opening import open_sheet
from pliant.tabular.schema import (
    FileColumn,
    Known,
    Schema,
    Values,
    check_named,
    notes_beside,
    read_columns,
    stamped,
)
from pliant.tabular.units import fits, stem, unit_at_the_end, unit_in

ADVICE = "correct the file"
LARGEST_STRAIN = 20.0
DOUBTFUL_STRETCH = 8.0
# Shear moduli in Pa: outside the first range a unit is wrong, outside the second a value deserves a look.
# Of the range: how far a free curve's rise and fall, or readings at one actuation, may part; steps that are none.
MOTION, HELD, FEWEST = 0.1, 1e-3, 3
POSSIBLE_PA = (100.0, 1e9)
USUAL_PA = (2e3, 1e8)


def check_tensile(
    path: Path, x_name: str, y_name: str, stretch: Array, stress: Array, lines: Array, as_strain: bool
) -> list[str]:
    """Refuse stretches and stresses that cannot be; returns remarks on doubtful ones.

    Args:
        path: the file, for messages.
        x_name, y_name: columns as the file names them.
        stretch: (n,); 1 + strain where the file has strains.
        stress: (n,) Pa.
        lines: (n,) of the file.
        as_strain: whether the file has strains.
    """
    written = stretch - 1 if as_strain else stretch
    if np.max(np.abs(written)) > LARGEST_STRAIN:
        worst = int(np.argmax(np.abs(written)))
        kind = "strain" if as_strain else "stretch"
        raise UserError(
            f"{path}, line {lines[worst]}, column {x_name}: a {kind} of {written[worst]:g} is more than any rubber "
            "bears; if it is a strain in percent, name the column strain_percent."
        )
    if not as_strain and stretch.min() <= 0 <= stretch.max() and np.mean(stretch <= 0) < 0.5:
        worst = int(np.argmin(stretch))
        raise UserError(
            f"{path}, line {lines[worst]}, column {x_name}: the stretch is {stretch[worst]:g}, and a stretch is length "
            "over length at rest, always above 0; if the column holds strains, name it strain."
        )
    problems = Problems(path, advice=ADVICE)
    for line, value in zip(lines.tolist(), stretch.tolist(), strict=True):
        if value <= 0:
            problems.add(line, f"column {x_name}: a stretch of {value:g} is impossible; it must be above 0")
    problems.raise_if_any()
    away = np.abs(stretch - 1) > 1e-3
    wrong = away & (stress * (stretch - 1) < 0)
    if wrong.sum() > 0.5 * max(away.sum(), 1):
        line = lines[np.argmax(wrong)]
        raise UserError(
            f"{path}, line {line}, column {y_name}: stress and strain have opposite signs in most rows; write tension "
            "positive and compression negative in both."
        )
    if stretch.max() > DOUBTFUL_STRETCH:
        return [f"The data reach a stretch of {stretch.max():.3g}; is the strain in percent?"]
    return []


def check_free(
    path: Path, x_name: str, y_name: str, actuation: Array, output: Array, lines: Array, of_angle: bool
) -> list[str]:
    """The same for a free curve: actuation (n,) and angle or extension (n,)."""
    problems = Problems(path, advice=ADVICE)
    for line, value in zip(lines.tolist(), actuation.tolist(), strict=True):
        if value < 0:
            problems.add(line, f"column {x_name}: {value:g} is below 0; a free curve is fitted from 0 upward")
    problems.raise_if_any()
    if not np.any(actuation > 0):
        raise UserError(f"{path}, column {x_name}: it is 0 throughout; a curve needs some actuation.")
    if of_angle and np.abs(output).max() > 2 * math.pi:
        worst = int(np.argmax(np.abs(output)))
        raise UserError(
            f"{path}, line {lines[worst]}, column {y_name}: {output[worst]:.4g} rad is more than a full turn of one "
            "module; is the column in degrees (angle_deg), or a sum of several modules?"
        )
    return []


def check_at_rest(
    path: Path, clock: str, x: FileColumn, y: FileColumn, set_to: Array, output: Array
) -> list[str]:
    """Refuse a recording in motion, whose output is not a function of the actuation; returns a remark on any recording.

    Args:
        path: the file.
        clock: its column of time.
        x, y: columns of the actuation and of what was measured.
        set_to, output: their values (n,) in the order of the file.
    """
    span, reach = float(np.ptp(output)), float(np.ptp(set_to))
    apart, where = 0.0, ""
    step = np.diff(set_to, prepend=set_to[:1])
    branches = [np.flatnonzero(step > 0), np.flatnonzero(step < 0)]
    if min(map(len, branches)) >= FEWEST and span > 0:
        rise, fall = (
            (set_to[k], output[k]) for k in (b[np.argsort(set_to[b], kind="stable")] for b in branches)
        )
        low, high = max(rise[0][0], fall[0][0]), min(rise[0][-1], fall[0][-1])
        if high > low:
            grid = np.linspace(low, high, 50)
            apart = float(np.abs(np.interp(grid, *rise) - np.interp(grid, *fall)).max())
            where = f"between rise and fall of {x.written}"
    starts = np.flatnonzero(np.concatenate([[True], np.abs(step[1:]) > HELD * reach]))
    creep = max(
        (float(np.ptp(part)) for part in np.split(output, starts[1:]) if len(part) >= FEWEST), default=0.0
    )
    if creep > apart:
        apart, where = creep, f"while {x.written} stands still"
    if apart > MOTION * span:
        raise UserError(
            f"{path}: it is a recording in motion (column {clock}): {y.written} differs by "
            f"{100 * apart / span:.0f} % of its range {where}. A free curve has states at rest, one row for each that "
            "was waited for; leave those alone in the file, and take the recording for `pliant compare`."
        )
    return [f"The file has a clock ({clock}): its rows are taken as states at rest."]


def check_modulus(shear_modulus_pa: float, y_name: str) -> list[str]:
    """Refuse a fitted shear modulus that no rubber has; returns a remark on an unusual one."""
    value = shear_modulus_pa
    if not POSSIBLE_PA[0] <= value <= POSSIBLE_PA[1]:
        raise UserError(
            f"The data ask for a shear modulus of {value:.3g} Pa; rubbers have 2 kPa to 100 MPa. Is a unit wrong? A "
            f"column's name says its unit, such as nominal_stress_mpa, pressure_kpa ({y_name} is read in SI)."
        )
    if not USUAL_PA[0] <= value <= USUAL_PA[1]:
        return [
            f"A shear modulus of {value:.3g} Pa is unusual for a rubber (2 kPa to 100 MPa); look at the units."
        ]
    return []


Kind = Literal["tensile", "free"]
TESTS = (*MODES, "free")
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
    schema = SCHEMAS["free" if test == "free" else "tensile"]
    found, beside = notes_beside(path, ColumnNotes)
    notes_name = beside.name if found is not None and beside is not None else path.with_suffix(".yaml").name
    notes = found or ColumnNotes()
    with open_sheet(path, schema.example, notes, notes_name) as sheet:
        sheet.problems.advice = ADVICE
        named = [*sheet.header, *map(stem, sheet.header)]
        check_named(path, notes_name, "rename", notes.rename, named)
        check_named(path, notes_name, "units", notes.units, [*named, *notes.rename.values()])
        columns = schema.matched(path, sheet.header, notes)
        clock = CLOCK.matched(path, sheet.header, notes, stamped=stamped(sheet)).get("time_s")
        kind = _kind(path, sheet.header, columns, test)
        x, y = _needed(path, sheet.header, columns, kind)
        rows = read_columns(sheet, columns)
    remarks = rows.remarks
    kept = _kept(path, rows, (x, y), remarks)
    problems, lines = Problems(path, advice=ADVICE), rows.lines[kept]
    mode, specimen = (np.array(rows.texts.get(n, [""] * len(kept)), str)[kept] for n in ("test", "specimen"))
    default = "" if kind == "free" else (test or "uniaxial")
    mode = np.array([word.lower() or default for word in mode.tolist()])
    for line, word in zip(lines.tolist(), mode.tolist(), strict=True):
        if kind == "tensile" and word not in MODES:
            problems.add(
                line, f"column test: '{word}' is not one of {', '.join(MODES)}{closest(word, MODES)}"
            )
    stated = f"sigma_{y.name}"
    sigma = rows.numbers[stated][kept] if stated in columns else None
    if sigma is not None:
        for line in lines[~(sigma > 0)].tolist():
            problems.add(line, f"column {stated}: it must be a number above 0 in every row")
    problems.raise_if_any()
    set_to, measured = (rows.numbers[column.name][kept] for column in (x, y))
    set_to = 1 + set_to if x.name == "strain" else set_to
    if kind == "tensile":
        remarks += check_tensile(path, x.written, y.written, set_to, measured, lines, x.name == "strain")
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


def _check_tester(path: Path, header: Sequence[str], columns: dict[str, FileColumn]) -> None:
    """Raise `UserError` for a tester's export of loads and extensions, which say nothing without the strip's sizes."""
    loads = [name for name in header if name and _has_unit(name, "N")]
    known = {"stretch", "strain", "nominal_stress_pa", "pressure_pa", "angle_rad", "tendon_force_n"}
    if loads and "extension_m" in columns and not known & set(columns):
        raise UserError(
            f"{path}: '{loads[0]}' is a load and '{columns['extension_m'].written}' an extension, as a tester exports "
            "them. A tensile test needs columns stretch = 1 + extension / gauge length and nominal_stress_pa = load / "
            "area of the section at rest: write these, with the gauge length and the area of your strip."
        )


def _has_unit(name: str, unit: str) -> bool:
    written = unit_in(name) or unit_at_the_end(name)
    return written is not None and fits(written, unit)


def _kind(path: Path, header: Sequence[str], columns: dict[str, FileColumn], test: str | None) -> Kind:
    if test is not None:
        return "free" if test == "free" else "tensile"
    _check_tester(path, header, columns)
    for place in (1, 0):  # what was measured says more than what was set
        for kind, columns_of_kind in OF_KIND.items():
            if set(columns) & set(columns_of_kind[place]):
                return kind
    named = [name for name in header if name]
    wanted = {name: UNITS[name] for kind in OF_KIND.values() for names in kind for name in names}
    lines = lines_to_write(path, "", *proposed(named, wanted))
    raise UserError(
        f"{path}: it is neither a tensile test (stretch or strain, nominal_stress_pa) nor a free curve (pressure_pa or "
        f"tendon_force_n, angle_rad or extension_m); its columns are {', '.join(named)}.{lines}"
    )


def _needed(
    path: Path, header: Sequence[str], columns: dict[str, FileColumn], kind: Kind
) -> tuple[FileColumn, FileColumn]:
    """What was set and what was measured, one column each."""
    found = []
    for names in OF_KIND[kind]:
        given = [columns[name] for name in names if name in columns]
        if not given:
            read = {column.written for column in columns.values()}
            unknown = [name for name in header if name and name not in read]
            wanted = "' or '".join(names)
            lines = lines_to_write(path, "", *proposed(unknown, {name: UNITS[name] for name in names}))
            raise UserError(f"{path}: column '{wanted}' is missing{_meant(names, unknown)}{lines}")
        if len(given) > 1:
            raise UserError(
                f"{path}: columns '{given[0].written}' and '{given[1].written}'; keep one of them."
            )
        found.append(given[0])
    return found[0], found[1]


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


def _kept(path: Path, rows: Values, needed: tuple[FileColumn, FileColumn], remarks: list[str]) -> np.ndarray:
    """Rows that have both numbers and no moment; what is left out is said."""
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
