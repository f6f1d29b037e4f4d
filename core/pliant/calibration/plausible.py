"""What bench data can and cannot be: a strain in percent, a stress of the wrong sign, a modulus no rubber has."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.tabular.text import Problems

ADVICE = "correct the file"
LARGEST_STRAIN = 20.0
DOUBTFUL_STRETCH = 8.0
# Shear moduli in Pa: outside the first range a unit is wrong, outside the second a value deserves a look.
POSSIBLE_PA = (100.0, 1e9)
USUAL_PA = (2e3, 1e8)


def check_tensile(
    path: Path, x_name: str, y_name: str, stretch: Array, stress: Array, lines: Array
) -> list[str]:
    """Refuse stretches and stresses that cannot be; returns remarks on doubtful ones.

    Args:
        path: the file, for messages.
        x_name, y_name: columns as the file names them.
        stretch: (n,); 1 + strain where the file has strains.
        stress: (n,) Pa.
        lines: (n,) of the file.
    """
    as_strain = x_name.lower().startswith("strain")
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
    path: Path, x_name: str, y_name: str, actuation: Array, output: Array, lines: Array
) -> list[str]:
    """The same for a free curve: actuation (n,) and angle or extension (n,)."""
    problems = Problems(path, advice=ADVICE)
    for line, value in zip(lines.tolist(), actuation.tolist(), strict=True):
        if value < 0:
            problems.add(line, f"column {x_name}: {value:g} is below 0; a free curve is fitted from 0 upward")
    problems.raise_if_any()
    if not np.any(actuation > 0):
        raise UserError(f"{path}, column {x_name}: it is 0 throughout; a curve needs some actuation.")
    if "angle" in y_name.lower() and np.abs(output).max() > 2 * math.pi:
        worst = int(np.argmax(np.abs(output)))
        raise UserError(
            f"{path}, line {lines[worst]}, column {y_name}: {output[worst]:.4g} rad is more than a full turn of one "
            "module; is the column in degrees (angle_deg), or a sum of several modules?"
        )
    return []


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
