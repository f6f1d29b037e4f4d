"""Plausibility checks of laboratory data: strain in percent or named stretch, a wrong sign, a recording in motion."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant_tables.cells import Problems
from pliant_tables.schema import FileColumn

ADVICE = "correct the file"
LARGEST_STRAIN = 20.0
DOUBTFUL_STRETCH = 8.0
# Of the largest stress: negligible stress; and a strain without stress that is closer to a stretch of 1.
SMALL, DOUBTFUL_BEGIN = 0.01, 0.8
# Of the range: allowed difference of a free curve's rise and fall, or of readings at one actuation; smallest step.
MOTION, HELD, FEWEST = 0.1, 1e-3, 3
# A pull's first rows: the largest strain, their least number and reach, and the rise of the secant that is doubted.
FIRST_STRAIN, FEWEST_STEEP, LEAST_STRAIN, STEEPER = 0.4, 5, 0.1, 0.1
# Shear moduli in Pa: outside the first range a unit is wrong, outside the second a value is remarked on.
POSSIBLE_PA = (100.0, 1e9)
USUAL_PA = (2e3, 1e8)


def check_tensile(
    path: Path, x_name: str, y_name: str, stretch: Array, stress: Array, lines: Array, as_strain: bool
) -> list[str]:
    """Refuse impossible stretches and stresses; return remarks on doubtful ones.

    Args:
        path: the file, for messages.
        x_name, y_name: the file's names of the columns.
        stretch: (n,); 1 + strain if the file has strains.
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
    tension = (stretch < 1 - 1e-3) & (stress > SMALL * np.abs(stress).max())
    rises = stress[np.argmax(stretch)] > stress[np.argmin(stretch)]  # decreasing if compression is positive
    if not as_strain and tension.any() and rises and not np.any(stress < 0):
        worst = int(np.argmax(tension))
        raise UserError(
            f"{path}, line {lines[worst]}, column {x_name}: a stretch of {stretch[worst]:.3g} is a compression, and "
            "the stress there is a tension, as everywhere; if the column holds strains, write 'rename: "
            f"{{{x_name}: strain}}' into the YAML beside the file."
        )
    away = np.abs(stretch - 1) > 1e-3
    wrong = away & (stress * (stretch - 1) < 0)
    if wrong.sum() > 0.5 * max(away.sum(), 1):
        line = lines[np.argmax(wrong)]
        raise UserError(
            f"{path}, line {line}, column {y_name}: stress and strain have opposite signs in most rows; write tension "
            "positive and compression negative in both."
        )
    remarks = _pulled_and_let_back(stretch, stress, y_name)
    if as_strain and (begin := _without_stress(written, stress)) > DOUBTFUL_BEGIN:
        remarks.append(
            f"By its first rows the stress is zero at a strain of {begin:.2f}, as it is at a stretch of 1; if column "
            f"{x_name} holds stretches, name it stretch."
        )
    if stretch.max() > DOUBTFUL_STRETCH:
        remarks.append(f"The data reach a stretch of {stretch.max():.3g}; is the strain in percent?")
    return remarks


def steepening(stretch: Array, stress: Array) -> list[str]:
    """Return a remark if a pull stiffens from its first rows on: compression that counts positive, or a slack strip.

    Args:
        stretch, stress: (n,) of the rows of a uniaxial test.
    """
    strain = stretch - 1
    first = (strain >= 0) & (strain <= FIRST_STRAIN)
    reach = float(strain[first].max(initial=0.0))
    if first.sum() < FEWEST_STEEP or reach < LEAST_STRAIN or (strain < 0).any():
        return []
    slope, bend = np.linalg.lstsq(np.column_stack([strain, strain**2])[first], stress[first], rcond=None)[0]
    if not slope > 0 or bend * reach < STEEPER * slope:
        return []
    return [
        f"Up to a strain of {reach:.2g} the stress rises ever more steeply, and rubber that is pulled softens there. "
        "If the rows are of compression, write strain and stress negative; if the strip was slack at first, "
        "subtract that."
    ]


def _without_stress(strain: Array, stress: Array) -> float:
    """Return the strain at which the line through the two smallest strains has zero stress; 0 without such a line."""
    places, first = np.unique(strain, return_index=True)
    if len(places) < 2 or stress[first[1]] == stress[first[0]]:
        return 0.0
    slope = (places[1] - places[0]) / (stress[first[1]] - stress[first[0]])
    return float(places[0] - stress[first[0]] * slope)


def _pulled_and_let_back(stretch: Array, stress: Array, y_name: str) -> list[str]:
    """Return a remark if the rows go up to the largest stretch and back at lower stress, in the file's order."""
    top = int(np.argmax(stretch))
    up, down = slice(0, top + 1), slice(top, len(stretch))
    once = np.all(np.diff(stretch[up]) >= 0) and np.all(np.diff(stretch[down]) <= 0)
    if min(top, len(stretch) - top - 1) < FEWEST or not once:
        return []
    back = np.interp(stretch[up], stretch[down][::-1], stress[down][::-1])
    inside = stretch[up] >= stretch[-1]
    apart = float(np.max(np.abs(stress[up] - back)[inside], initial=0.0)) / float(np.ptp(stress) or 1.0)
    if apart < MOTION / 2:
        return []
    return [
        f"The strip is pulled and let back, and on its way back {y_name} differs by up to {100 * apart:.0f} % of its "
        "range (softening, creep or friction); one law is fitted to both ways. Leave out the way that your robot does "
        "not go."
    ]


def check_free(
    path: Path, x_name: str, y_name: str, actuation: Array, output: Array, lines: Array, of_angle: bool
) -> list[str]:
    """Check a free curve in the same way: actuation (n,) and angle or extension (n,)."""
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
    """Refuse a recording in motion, whose output is not a function of the actuation; return a remark on any recording.

    Args:
        path: the file.
        clock: its column of time.
        x, y: columns of the actuation and of the measured output.
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
    """Refuse a fitted shear modulus that no rubber has; return a remark on an unusual one."""
    value = shear_modulus_pa
    if not POSSIBLE_PA[0] <= value <= POSSIBLE_PA[1]:
        raise UserError(
            f"The data require a shear modulus of {value:.3g} Pa; rubbers have 2 kPa to 100 MPa. Is a unit wrong? A "
            f"column's name says its unit, such as nominal_stress_mpa, pressure_kpa ({y_name} is read in SI)."
        )
    if not USUAL_PA[0] <= value <= USUAL_PA[1]:
        return [
            f"A shear modulus of {value:.3g} Pa is unusual for a rubber (2 kPa to 100 MPa); check the units."
        ]
    return []
