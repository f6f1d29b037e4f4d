"""Accuracy and speed of the bending bellow's FEM: python -m benchmarks.fem_bending

(a) free bending of the reference design against the published curve, one shear modulus fitted
(b) exact slopes against fourth-order differences of converged states
(c) mesh refinement, and cells with and without mean dilatation
(d) seconds per converged state, pardiso and SuperLU

Prints the figures and writes them to benchmarks/out/fem_bending.json.
"""

from __future__ import annotations

import statistics
import sys
import time
from typing import Any

import numpy as np
from benchmarks.families.published_y import make_solver
from benchmarks.output import REFERENCE, make_parser, reference_table, write
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from pliant.errors import MissingDependencyError
from pliant.records.fem import FemState
from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig
from pliant_plugins.fem.skfem.backend import SkfemSolver

MU = 248e3
PRESSURES = (500.0, 1e3, 2e3, 3e3, 4.5e3, 6e3, 8e3, 10e3, 12e3, 14e3, 16e3)


def solver(refinement: int = 1, **options: Any) -> SkfemSolver:
    """Return a solver of the reference design: r 2, R 6, t 1.5, l 11 mm."""
    lengths = {"inner_radius": 2e-3, "average_radius": 6e-3, "wall": 1.5e-3, "module_length": 11e-3}
    family = BellowBending(BellowBendingConfig.model_validate(lengths))
    return make_solver(family.problem(refinement), MU, **{"pressure_max_pa": 16e3, **options})


def free_branch(model: SkfemSolver, pressures: tuple[float, ...] = PRESSURES) -> list[FemState]:
    """Return free states at rising pressure, rest first."""
    states = [model.rest()]
    for pressure in pressures:
        states.append(model.free(pressure, states[-1]))
    return states


def spline(states: list[FemState]) -> CubicSpline:
    """Return the half-module angle against p/μ, on which alone it depends."""
    return CubicSpline([s.actuation / MU for s in states], [s.angle_rad / 2 for s in states])


def fit_modulus(states: list[FemState], pressure: np.ndarray, published: np.ndarray) -> dict[str, float]:
    """Return the modulus with the least RMS error of the half angle, relative to the RMS angle."""
    curve = spline(states)

    def relative(mu: float) -> np.ndarray:
        return np.asarray(curve(pressure / mu) - published)

    size, bounds = np.linalg.norm(published), (232e3, 280e3)
    best = minimize_scalar(lambda mu: np.linalg.norm(relative(mu)) / size, bounds=bounds, method="bounded")
    at = {p: float(e / a) for p, e, a in zip(pressure, relative(best.x), published, strict=True) if a > 0}
    errors = {f"error_at_{p}_kpa": at[1e3 * p] for p in (1, 5, 15)}
    return {"shear_modulus_pa": float(best.x), "relative_rms": float(best.fun), **errors}


def published_curve() -> tuple[np.ndarray, np.ndarray]:
    """Return pressures (Pa) and half angles (rad) of the published free branch."""
    table = reference_table("bellow_bending_fem.csv")
    if table is None:
        sys.exit(f"fem_bending: the reference data are absent: {REFERENCE} (see docs: reference study)")
    free = table["edge_force_n"] == 0
    return table["pressure_pa"][free], table["half_angle_rad"][free]


def slope_errors(model: SkfemSolver, free: FemState) -> dict[str, float]:
    """Return relative error of dτ/dp and dτ/du at a free and a held state, against fourth-order differences."""
    found: dict[str, float] = {}
    for name, angle in (("free", free.angle_rad), ("held", 0.6 * free.angle_rad)):
        here = model.constrained(free.actuation, angle, free)

        def along(dp: float, du: float, here: FemState = here) -> float:
            def moment(n: int) -> float:
                return model.constrained(here.actuation + n * dp, here.angle_rad + n * du, here).moment_n_m

            return (8 * (moment(1) - moment(-1)) - (moment(2) - moment(-2))) / (12 * (dp or du))

        found[f"dmoment_dp_{name}"] = abs(here.dmoment_dp / along(50.0, 0.0) - 1)
        found[f"dmoment_du_{name}"] = abs(here.dmoment_du / along(0.0, 2e-3) - 1)
    return found


def refinement_table(finest: int) -> list[dict[str, Any]]:
    """Return the free half angle at 1, 5 and 15 kPa by mesh and by the cells' dilatation method."""
    rows = []
    for dilatation in ("cell", "point"):
        for refinement in range(1, finest + 1):
            model = solver(refinement, dilatation=dilatation)
            states = free_branch(model)
            curve = spline(states)
            size = {"cells": len(model.problem.mesh.cells), "unknowns": model.assembler.pattern.size}
            angles = {str(p): float(curve(p / MU)) for p in (1e3, 5e3, 15e3)}
            seconds = statistics.median(s.wall_s for s in states[1:])
            row = {"dilatation": dilatation, "refinement": refinement, **size, "half_angle_rad": angles}
            rows.append({**row, "seconds_per_state": seconds, "states": states})
    return rows


def timing(repeats: int) -> dict[str, Any]:
    """Return median seconds per free state (16 kPa in 11 steps), by linear solver, in turns."""
    times: dict[str, list[float]] = {}
    for _ in range(repeats):
        for kind in ("pardiso", "superlu"):
            try:
                model = solver(linear_solver=kind)
            except MissingDependencyError:
                continue
            times.setdefault(kind, []).extend(s.wall_s for s in free_branch(model)[2:])
    medians = {kind: statistics.median(values) for kind, values in times.items()}
    ratio = medians["superlu"] / medians["pardiso"] if "pardiso" in medians else None
    return {"seconds_per_state": medians, "superlu_over_pardiso": ratio}


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--finest", type=int, default=2, help="largest mesh refinement (3 takes minutes)")
    parser.add_argument("--repeats", type=int, default=2)
    options = parser.parse_args()
    pressure, published = published_curve()
    begun = time.perf_counter()

    print("(c) mesh          cells  unknowns  θ(1 kPa)   θ(5 kPa)   θ(15 kPa)  s/state")
    table = refinement_table(options.finest)
    for row in table:
        angles = "  ".join(f"{a:.6f} " for a in row["half_angle_rad"].values())
        name = f"{row['dilatation']} × {row['refinement']}"
        cells = f"{row['cells']:6d} {row['unknowns']:9d}"
        print(f"    {name:12s} {cells}  {angles} {row['seconds_per_state']:.3f}")

    print("(a) published free curve, one modulus fitted")
    for row in table:
        row["fit"] = fit_modulus(row.pop("states"), pressure, published)
        print(
            f"    {row['dilatation']} × {row['refinement']}: μ = {row['fit']['shear_modulus_pa'] / 1e3:.1f} kPa, "
            f"relative RMS {row['fit']['relative_rms']:.2%}; at 1, 5, 15 kPa "
            + ", ".join(f"{row['fit'][f'error_at_{p}_kpa']:+.2%}" for p in (1, 5, 15))
        )

    model = solver()
    slopes = slope_errors(model, free_branch(model, (2e3, 5e3, 8e3))[-1])
    print("(b) slopes, relative error: " + ", ".join(f"{k} {v:.1e}" for k, v in slopes.items()))

    speed = timing(options.repeats)
    medians = ", ".join(f"{k} {v:.3f}" for k, v in speed["seconds_per_state"].items())
    print(f"(d) seconds per state: {medians}")
    if speed["superlu_over_pardiso"]:
        print(f"    SuperLU / pardiso {speed['superlu_over_pardiso']:.2f}")

    results = {"meshes": table, "slope_errors": slopes, **speed, "wall_s": time.perf_counter() - begun}
    write("fem_bending", results)


if __name__ == "__main__":
    main()
