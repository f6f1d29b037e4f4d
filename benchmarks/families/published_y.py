"""The helical bellow's published bending data and how a family's law is scored against them.

With a shear modulus μ and a constraint whose EA scales with it, τ(p, u; μ) = (μ/μ₀) τ(p μ₀/μ, u; μ₀): one table of
states, solved at μ₀, serves every modulus.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from benchmarks.output import REFERENCE, reference_table
from scipy.interpolate import CubicHermiteSpline, CubicSpline, RectBivariateSpline
from scipy.optimize import minimize_scalar

from pliant.errors import NotReachedError
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleProblem
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.skfem.backend import Skfem, SkfemSolver
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig

CURVE = REFERENCE / "helical_y_fem_R5.66_l4.72.csv"
MU = 200e3
PRESSURES = (4e3, 8e3, 12e3, 16e3)
# Half angles (rad) between which neighbouring convolutions do not cross each other's plane.
LOW, HIGH = -0.15, 0.30
HALF_ANGLES = (LOW, -0.09, -0.03, 0.03, 0.1, 0.17, 0.24, HIGH)
PREDICTED = (5e3, 7.5e3, 10e3, 12.5e3)


@dataclass(frozen=True, eq=False)
class Published:
    """Columns of the file, (n,): pressure (Pa), opposing moment (N·m), half angle (rad); `free` marks free states."""

    pressure: Array
    moment: Array
    half_angle: Array
    free: Array


def published() -> Published | None:
    """Return the data, or None without the folder."""
    table = reference_table(CURVE.name)
    if table is None:
        return None
    columns = list(table.values())
    return Published(*columns, free=np.arange(len(columns[0])) < 31)


def make_solver(problem: ModuleProblem, mu_pa: float = MU, **options: Any) -> SkfemSolver:
    """Return the default backend's solver with the given options and neo-Hookean rubber, ν = 0.49."""
    material = NeoHookean(NeoHookeanConfig(shear_modulus_pa=mu_pa))
    config = SkfemConfig.model_validate(options or {"pressure_max_pa": 20e3})
    return Skfem(config).solver(problem, material)


@dataclass(frozen=True, eq=False)
class Table:
    """States of one variant at μ₀: opposing moments [pressure, half angle], and the free half angles by pressure."""

    moments: Array
    free_pressure: Array
    free_half_angle: Array

    def moment(self, mu_pa: float, pressure: Array, half_angle: Array) -> Array:
        """Return τ (N·m) at another modulus."""
        factor = mu_pa / MU
        surface = RectBivariateSpline(PRESSURES, HALF_ANGLES, self.moments)
        return factor * surface.ev(pressure / factor, half_angle)

    def free(self, mu_pa: float, pressure: Array) -> Array:
        """Return free half angles (rad) at another modulus."""
        return CubicSpline(self.free_pressure, self.free_half_angle)(pressure * MU / mu_pa)


def solve_table(problem: ModuleProblem) -> Table:
    """Solve the table of a half module at μ₀; angles that are not reached are continued by a spline."""
    solver = make_solver(problem)
    moments = np.full((len(PRESSURES), len(HALF_ANGLES)), np.nan)
    middle = HALF_ANGLES.index(0.03)
    rest = solver.rest()
    row = rest
    for i, pressure in enumerate(PRESSURES):
        row = solver.constrained(pressure, 2 * HALF_ANGLES[middle], row)
        moments[i, middle] = row.moment_n_m
        for way in (range(middle + 1, len(HALF_ANGLES)), range(middle - 1, -1, -1)):
            state = row
            for j in way:
                try:
                    state = solver.constrained(pressure, 2 * HALF_ANGLES[j], state)
                except NotReachedError:
                    break
                moments[i, j] = state.moment_n_m
        reached = np.isfinite(moments[i])
        angles = np.array(HALF_ANGLES)
        moments[i, ~reached] = CubicSpline(angles[reached], moments[i, reached])(angles[~reached])
    state, free = rest, [(0.0, 0.0)]
    for pressure in (1e3, 2e3, *PRESSURES, 18e3):
        state = solver.free(pressure, state)
        free.append((pressure, state.angle_rad / 2))
    return Table(moments, *np.array(free).T)


def free_curve(states: Sequence[FemState], mu_pa: float = 1.0) -> CubicHermiteSpline:
    """Return u over p/μ through free states and their slopes: u depends on p/μ alone, so one curve serves all μ."""
    points = [(s.actuation / mu_pa, s.angle_rad, -mu_pa * s.dmoment_dp / s.dmoment_du) for s in states]
    return CubicHermiteSpline(*zip(*points, strict=True))


def relative_rms(model: Array, data: Array) -> float:
    """Return ‖model − data‖ / ‖data‖."""
    return float(np.linalg.norm(model - data) / np.linalg.norm(data))


def relative_errors(table: Table, data: Published, mu_pa: float) -> dict[str, float]:
    """Return relative RMS errors: the free curve, the 15 kPa moments, and the predicted moments.

    `half_…` and `module_…` take the states whose half angle or whose module angle (twice it) is within ± 0.3 rad, as
    far as −0.15 rad of half angle: beyond it the published states have convolutions inside one another.
    """
    free = data.free
    found = {"free": relative_rms(table.free(mu_pa, data.pressure[free]), data.half_angle[free])}
    parts: dict[str, tuple[float, ...]] = {f"{p / 1e3:g}_kpa": (p,) for p in (*PREDICTED, 15e3)}
    for part, pressures in {**parts, "predicted": PREDICTED}.items():
        at = ~free & np.isin(data.pressure, pressures) & (data.half_angle >= LOW)
        for name, limit in (("half", 0.3), ("module", 0.15)):
            use = at & (np.abs(data.half_angle) <= limit)
            model = table.moment(mu_pa, data.pressure[use], data.half_angle[use])
            found[f"{name}_{part}"] = relative_rms(model, data.moment[use])
    return found


def fitted_modulus(table: Table, data: Published, by: str) -> float:
    """Return the modulus with the least error of the free curve (`free`), or of it and the 15 kPa moments (`both`)."""

    def cost(mu_pa: float) -> float:
        errors = relative_errors(table, data, mu_pa)
        return errors["free"] ** 2 + (errors["module_15_kpa"] ** 2 if by == "both" else 0.0)

    return float(minimize_scalar(cost, bounds=(150e3, 270e3), method="bounded", options={"xatol": 50}).x)
