"""The study's 87 bending designs: free angle at 10 kPa by FEM with ONE modulus, against the study's polynomials.

    python -m benchmarks.families.gripper_designs [--designs 8]

The polynomials are fits of the published solver's data with fit errors of up to about 8 %; the free angle
is the root of τ(10 kPa, u) = 0. With p/μ as the only scale, one FEM curve per design gives its angle for every μ; μ is
the one with the smallest median error, and is printed with that of the published free curve.
"""

from __future__ import annotations

import time

import numpy as np
from benchmarks.families.published_y import free_curve, make_solver
from benchmarks.output import REFERENCE, Bar, make_parser, reference_table, write
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import minimize_scalar

from pliant.errors import InvalidDesignError
from pliant.interfaces.fem import StateNotConvergedError
from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig

PRESSURE_KPA = 10.0
MU_PA = 249e3  # the states are solved with this one
LEVELS = (0.25, 0.5, 0.75, 0.9, 1.0, 1.12)  # of the pressure
# Fitted on the published free curve of one design (tests/fem/test_reference_bending.py).
CURVE_MU_PA = 249.3e3


def published_angle(row: dict[str, float]) -> float:
    """Return root in u of k_n p + (m_a p + b_a) u − (m_e u²/2 + b_e u), p in kPa."""
    p = PRESSURE_KPA
    linear = row["m_a"] * p + row["b_a"] - row["b_e"]
    roots = np.roots([-row["m_e"] / 2, linear, row["k_n"] * p])
    return float(min(r.real for r in roots if abs(r.imag) < 1e-12 and r.real > 0))


def interpolate_free_curve(row: dict[str, float]) -> tuple[CubicHermiteSpline, int]:
    """Return u(p/μ) of a design and the number of states in self-contact. Raises `StateNotConvergedError`."""
    names = {"inner_radius": "r", "average_radius": "R", "wall": "t", "module_length": "l"}
    lengths = {name: row[letter] / 1e3 for name, letter in names.items()}
    family = BellowBending(BellowBendingConfig.model_validate(lengths))
    solver = make_solver(family.problem(), MU_PA, pressure_max_pa=15e3)
    states = [solver.rest()]
    for level in LEVELS:
        states.append(solver.free(1e3 * PRESSURE_KPA * level, states[-1]))
    return free_curve(states, MU_PA), sum(s.status == "self_contact" for s in states)


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--designs", type=int, default=None, help="only this many, spread over the table")
    count = parser.parse_args().designs
    table = reference_table("gripper_poly_coefficients.csv")
    if table is None:
        print(f"skipped: the published coefficients are not in {REFERENCE}")
        return
    rows = [dict(zip(table, map(float, row), strict=True)) for row in zip(*table.values(), strict=True)]
    if count:
        rows = [rows[i] for i in np.linspace(0, len(rows) - 1, count).astype(int)]
    begun = time.perf_counter()
    solved, failed = [], []
    for number, row in enumerate(rows):
        try:
            solved.append((row, *interpolate_free_curve(row)))
        except (InvalidDesignError, StateNotConvergedError) as error:
            failed.append({**_design(row), "cause": str(error)})
        print(f"\r{number + 1}/{len(rows)} designs, {time.perf_counter() - begun:.0f} s", end="", flush=True)
    print()
    wanted = np.array([published_angle(row) for row, *_ in solved])

    def errors(mu: float) -> np.ndarray:
        return np.array([curve(1e3 * PRESSURE_KPA / mu) for _, curve, _ in solved]) / wanted - 1

    found = minimize_scalar(lambda mu: np.median(np.abs(errors(mu))), bounds=(230e3, 275e3), method="bounded")
    best = float(found.x)
    result = {"n": len(solved), "failed": failed, "at": {}}
    for label, mu in (("fitted on all designs", best), ("of the published free curve", CURVE_MU_PA)):
        share = np.abs(errors(mu))
        at = {"median": 0.5, "p95": 0.95, "worst": 1.0}
        quantiles = {name: float(np.quantile(share, q)) for name, q in at.items()}
        result["at"][label] = {"shear_modulus_pa": mu, **quantiles}
        shown = ", ".join(f"{k} {100 * v:.2f} %" for k, v in quantiles.items())
        print(f"μ {mu / 1e3:6.1f} kPa {label}: {shown}")
    beyond = [
        {**_design(row), "error": float(e), "contact": contact}
        for (row, _, contact), e in zip(solved, errors(best), strict=True)
        if abs(e) > 0.08
    ]
    result["beyond_8_percent"] = beyond
    for entry in beyond:
        print("beyond 8 %: " + ", ".join(f"{k} {v:.4g}" for k, v in entry.items()))
    for entry in failed:
        print("failed: " + ", ".join(f"{k} {v}" for k, v in entry.items()))
    reached = result["at"]["fitted on all designs"]
    limits = {"median": 3.0, "p95": 8.0}
    bars = [Bar(f"{q} error", 100 * reached[q], limit, "%", True) for q, limit in limits.items()]
    write("gripper_designs", result, bars)


def _design(row: dict[str, float]) -> dict[str, float]:
    flank = 2 * (row["R"] - row["r"]) - row["l"] / 2
    sizes = {f"{name}_mm": row[name] for name in ("r", "t", "R", "l")}
    return {**sizes, "flank_mm": flank, "arc_minus_wall_mm": row["l"] / 4 - row["t"]}


if __name__ == "__main__":
    main()
