"""The helical bellow against its published bending curves: python -m benchmarks.families.helical [--quick]

(a) variants of the unpublished structure (crest, trough, constraint): one modulus fitted to the free curve; what the
    free curve and the 15 kPa moments choose
(b) the family's defaults: moments at 5 to 12.5 kPa predicted
(c) bending about z and twist at 5 and 15 kPa, with what decides them: the constraint's width, the twist's pivot
(d) the published bending about z and twist, M_y = 0: the constraint's width is identified on z at 15 kPa, the rest is
    predicted; up to a half angle of 0.2 rad, and all of it

Prints the figures and writes them to benchmarks/out/family_helical.json. (a) takes minutes, --quick leaves it out."""

from __future__ import annotations

import csv
import sys
import time
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from benchmarks.families.published_y import (
    CURVE,
    MU,
    Published,
    Table,
    fitted_modulus,
    make_solver,
    published,
    relative_errors,
    relative_rms,
    solve_table,
)
from benchmarks.output import REFERENCE, Bar, make_parser, write

from pliant.errors import NotReachedError
from pliant.interfaces.fem import ModuleSolver
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleProblem
from pliant_plugins.families.bellow_helical.family import BellowHelical, BellowHelicalConfig
from pliant_plugins.families.reference import HELIX_MODULE

MOMENTS = (3e-3, 6e-3)
MOST_STEPS, CLOSE = 6, 1e-4
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Row:
    """One axis at one pressure, moments on it alone.

    Attributes:
        held: condition on the main axis: M_y = 0 ("free") or u_y as on the free branch ("held").
        tangent: −dM/du (N·m/rad) at M = 0.
        secants: M/u (N·m/rad) at the moments of `MOMENTS`, NaN where no state was reached.
    """

    axis: str
    pressure_pa: float
    held: str
    tangent: float
    secants: tuple[float, ...]


def condensed(stiffness: Array, kept: tuple[int, ...]) -> Array:
    """Return the stiffness (3, 3) of some axes with the others free."""
    out = [i for i in range(len(stiffness)) if i not in kept]
    K = stiffness[np.ix_(kept, kept)]
    cross = stiffness[np.ix_(kept, out)]
    return K - cross @ np.linalg.solve(stiffness[np.ix_(out, out)], cross.T)


def free_states(solver: ModuleSolver, pressures: tuple[float, ...]) -> list[FemState]:
    """Return states without moments, each from the one before."""
    states: list[FemState] = []
    state = solver.rest()
    for pressure in pressures:
        state = solver.free(pressure, state)
        states.append(state)
    return states


def secant(solver: ModuleSolver, free: FemState, axis: str, moment: float, held: bool) -> float:
    """Return M/u (N·m/rad) under a moment that turns the module by +u about an axis, by Newton on u (two states)."""
    place = AXES.index(axis)
    kept = tuple(sorted({place, 1})) if held else (place,)
    others = {"y": float(free.deformation[1])} if held else {}
    u, state = 0.0, free
    for _ in range(3):
        slope = condensed(-state.dtau_du, kept)[kept.index(place), kept.index(place)]
        # τ opposes: a moment that helps is −τ
        missing = moment + float(state.tau[place])
        u += missing / slope
        if state is not free and abs(missing) < 0.02 * moment:
            break
        state = solver.constrained(free.actuation, {**others, axis: u}, state)
    return float(moment / u)


def stiffness_rows(
    solver: ModuleSolver, free: FemState, axes: tuple[str, ...] = ("z", "x"), secants: bool = True
) -> list[Row]:
    """Return stiffness of the axes at one free state."""
    rows = []
    for axis in axes:
        place = AXES.index(axis)
        for held in (False, True):
            kept = tuple(sorted({place, 1})) if held else (place,)
            where = kept.index(place)
            tangent = float(condensed(-free.dtau_du, kept)[where, where])
            found = tuple(secant(solver, free, axis, m, held) for m in MOMENTS) if secants else ()
            rows.append(Row(axis, free.actuation, "held" if held else "free", tangent, found))
    return rows


def asymmetry(state: FemState) -> float:
    """Return largest |K_ij − K_ji| / √(K_ii K_jj)."""
    K = -state.dtau_du
    size = np.sqrt(np.diag(K))
    return float(np.abs((K - K.T) / np.outer(size, size)).max())


def energy_error(solver: ModuleSolver, start: FemState, turn: dict[str, float]) -> float:
    """Return |ΔU − work| / work between two near states of one pressure at u ± turn/2 (midpoint: third order)."""
    u = dict(zip(AXES, start.deformation.tolist(), strict=True))
    low, mid, high = (
        solver.constrained(start.actuation, {a: u[a] + s * turn.get(a, 0.0) for a in AXES}, start)
        for s in (-0.5, 0.0, 0.5)
    )
    step = high.deformation - low.deformation
    work = start.actuation * (high.travel - low.travel) - float((low.tau + 4 * mid.tau + high.tau) @ step / 6)
    return abs((high.energy_j - low.energy_j - work) / work)


VARIANTS: tuple[dict[str, Any], ...] = (
    {"constraint_offset": "2.45 mm"},
    {"constraint_offset": "2.5 mm"},
    {"constraint_offset": "2.5 mm", "constraint_stiffness": "100 N"},
    {"constraint_offset": "2.6 mm", "constraint_stiffness": "40 N"},
    {"constraint_offset": "2.7 mm", "constraint_stiffness": "20 N"},
    {"constraint_offset": "2.4 mm", "crest": "free"},
    {"constraint_offset": "2.6 mm", "crest": "free"},
    {"constraint_offset": "2.8 mm", "crest": "free"},
    {"constraint_offset": "2.6 mm", "crest": "free", "constraint_stiffness": "80 N"},
    {"constraint_offset": "2.6 mm", "crest": "free", "constraint_stiffness": "40 N"},
    {"constraint_offset": "2.9 mm", "crest": "free", "constraint_stiffness": "15 N"},
    {"constraint_offset": "3.09 mm", "crest": "free", "constraint_stiffness": "10 N"},
    {"constraint_offset": "2.6 mm", "crest": "free", "trough": "free"},
)
INEXTENSIBLE = "10000 N"
SPATIAL: tuple[dict[str, Any], ...] = (
    {},
    {"constraint_width": "1 um"},
    {"constraint_width": "5.67 mm"},
    {"twist_pivot": "free"},
    {"crest": "free"},
)
PRESSURES = (2.5e3, 5e3, 10e3, 15e3)
SIDEWAYS = "helical_xz_fem_R5.66_l4.72.csv"
# Half angles up to which bending about z is compared: beyond them rigid sections would have to cross.
FAR = 0.21
SIDEWAYS_BARS = {"z_15_kpa": 3.0, "z_10_kpa": 5.0, "x_15_kpa": 10.0, "x_10_kpa": 10.0}
# Smaller moments about x carry the noise of the published post-processing.
LEAST_X_N_M = 0.002


def family(**parameters: Any) -> BellowHelical:
    """Build the published design with some parameters changed."""
    return BellowHelical(BellowHelicalConfig.model_validate({**HELIX_MODULE, **parameters}))


def half_module(variant: dict[str, Any]) -> ModuleProblem:
    """Return the half module of a variant; `trough: free`, not in the family, is free in the plane but at one node."""
    parameters = {"constraint_stiffness": INEXTENSIBLE, **variant}
    free_trough = parameters.pop("trough", None) == "free"
    problem = family(**parameters).problem(axes=("y",))
    return replace(problem, fixed={**problem.fixed, "end": (0,), "pin": (2,)}) if free_trough else problem


def scored(table: Table, data: Published) -> dict[str, Any]:
    """Return errors with the modulus of the free curve, and with that of the free curve and the 15 kPa moments."""
    found = {}
    for by in ("free", "both"):
        mu_pa = fitted_modulus(table, data, by)
        found[by] = {"shear_modulus_pa": mu_pa, **relative_errors(table, data, mu_pa)}
    return found


def printed(name: str, found: dict[str, Any]) -> None:
    """Print one line for each fit."""
    for by, e in found.items():
        print(
            f"    {name if by == 'free' else '':62s} {by:5s} {e['shear_modulus_pa'] / 1e3:6.1f} {e['free']:7.2%}"
            f" {e['module_15_kpa']:7.2%} {e['half_15_kpa']:7.2%} | {e['module_predicted']:7.2%}"
            f" {e['half_predicted']:7.2%} | "
            + " ".join(f"{e[f'module_{p}_kpa']:6.2%}" for p in ("5", "7.5", "10", "12.5")),
            flush=True,
        )


def variants_table(data: Published) -> list[dict[str, Any]]:
    """Return table (a): variants of the module."""
    print(
        "(a) variant; modulus by; μ kPa; free; 15 kPa |u| ≤ .3, |u/2| ≤ .3; predicted likewise; by pressure"
    )
    rows = []
    for variant in VARIANTS:
        found = scored(solve_table(half_module(variant)), data)
        name = ", ".join(f"{k} {v}" for k, v in variant.items())
        printed(name, found)
        rows.append({"variant": variant, **found})
    return rows


def spatial_table(mu_pa: float, secants: bool) -> list[dict[str, Any]]:
    """Return table (c): rotations about all axes."""
    print("(c) variant; axis; pressure; main axis; mN·m/rad at M = 0, secants at 3 and 6 mN·m")
    rows = []
    for parameters in SPATIAL:
        name = ", ".join(f"{k} {v}" for k, v in parameters.items()) or "defaults"
        solver = make_solver(family(**parameters).problem(), mu_pa)
        for state in free_states(solver, PRESSURES):
            if state.actuation not in (5e3, 15e3):
                continue
            found = stiffness_rows(solver, state, secants=secants and not parameters)
            for row in found:
                values = " ".join(f"{1e3 * k:7.2f}" for k in (row.tangent, *row.secants))
                print(
                    f"    {name:28s} {row.axis} {row.pressure_pa / 1e3:4.0f} kPa {row.held:5s} {values}",
                    flush=True,
                )
            at = {"pressure_pa": state.actuation, "free_u_rad": state.deformation.tolist()}
            stiffness = {"stiffness_n_m": (-state.dtau_du).tolist(), "asymmetry": asymmetry(state)}
            rows.append({"variant": parameters, **at, **stiffness, "rows": [asdict(row) for row in found]})
    return rows


def turned_by(solver: ModuleSolver, free: FemState, axis: str, moments: Array) -> Array:
    """Return (n,) half angles under growing moments about an axis, all others free; NaN beyond reach."""
    place, state = AXES.index(axis), free
    found = np.full(len(moments), np.nan)
    for k, moment in enumerate(moments.tolist()):
        for _ in range(MOST_STEPS):
            missing = moment + float(state.tau[place])
            if abs(missing) < CLOSE * moment:
                break
            slope = condensed(-state.dtau_du, (place,))[0, 0]
            try:
                u = float(state.deformation[place]) + missing / slope
                state = solver.constrained(free.actuation, {axis: u}, state)
            except NotReachedError:
                return found
        found[k] = state.deformation[place] / 2
    return found


def sideways_table(mu_pa: float) -> dict[str, Any]:
    """Return table (d): relative RMS of the half angles about z and x by pressure, near and all."""
    path = REFERENCE / SIDEWAYS
    if not path.is_file():
        return {}
    with path.open(encoding="utf-8") as file:
        rows = [(row.pop("axis"), *map(float, row.values())) for row in csv.DictReader(file)]
    print("(d) axis; pressure; half angle / published, RMS: near, all")
    solver = make_solver(family().problem(), mu_pa, pressure_max_pa=20e3, self_contact="pass")
    found: dict[str, Any] = {}
    for state in free_states(solver, PRESSURES):
        for axis in ("z", "x"):
            least = LEAST_X_N_M if axis == "x" else 0.0
            mine = [row[2:] for row in rows if row[:2] == (axis, state.actuation) and row[2] >= least]
            if not mine:
                continue
            moments, seen = np.array(mine).T
            model = turned_by(solver, state, axis, moments)
            near, there = (seen <= FAR) & np.isfinite(model), np.isfinite(model)
            of = f"{axis}_{state.actuation / 1e3:g}_kpa"
            found[of] = {
                "half_angle_rad": model.tolist(),
                "near": relative_rms(model[near], seen[near]),
                "all": relative_rms(model[there], seen[there]),
                "not_reached": int((~there).sum()),
            }
            print(
                f"    {axis} {state.actuation / 1e3:4.0f} kPa {found[of]['near']:6.2%} {found[of]['all']:6.2%}",
                flush=True,
            )
    return found


def energy_check(mu_pa: float) -> dict[str, float]:
    """Check the whole module about all axes at 5 kPa: work against energy, and symmetry of the couplings."""
    solver = make_solver(family().problem(), mu_pa)
    free = free_states(solver, (2.5e3, 5e3))[-1]
    turned = solver.constrained(5e3, {"x": 0.06, "y": 0.2, "z": 0.08}, free)
    error = energy_error(solver, turned, {"x": 0.02, "y": -0.02, "z": 0.03})
    K = -turned.dtau_du
    couplings = {f"k_{a}{b}_n_m": float(K[i, j]) for i, a in enumerate("xyz") for j, b in enumerate("xyz")}
    return {"work_against_energy": error, "asymmetry": asymmetry(turned), **couplings}


def main() -> None:
    quick = make_parser(__doc__, "without the variants of (a) and the secants of (c)").parse_args().quick
    data = published()
    if data is None:
        sys.exit(f"family_helical: the reference data are absent: {CURVE.resolve()}")
    begun = time.perf_counter()
    variants = [] if quick else variants_table(data)
    print("(b) the family's defaults")
    table = solve_table(family().problem(axes=("y",)))
    defaults = scored(table, data)
    printed("defaults", defaults)
    mu_pa = defaults["free"]["shear_modulus_pa"]
    straight = [float(table.moment(mu_pa, np.array([p]), np.zeros(1))[0] / p) for p in (5e3, 10e3, 15e3)]
    print("    moment/pressure at zero angle, mm³: " + ", ".join(f"{1e9 * r:.1f}" for r in straight))
    spatial = spatial_table(mu_pa, not quick)
    sideways = sideways_table(mu_pa)
    energy = energy_check(mu_pa)
    print("    " + ", ".join(f"{k} {v:.3g}" for k, v in energy.items()))
    fit = defaults["free"]
    bars = [
        Bar("free curve, relative RMS", 100 * fit["free"], 1.0, "%", True),
        Bar("moments at 5 to 12.5 kPa, |u| ≤ 0.3 rad", 100 * fit["module_predicted"], 5.0, "%", True),
        Bar("the same, half angle −0.15 to 0.3 rad", 100 * fit["half_predicted"], 5.0, "%", True),
    ]
    for of, limit in SIDEWAYS_BARS.items() if sideways else ():
        near, whole = (100 * sideways[of][part] for part in ("near", "all"))
        words = of.replace("_", " ")
        bars += [
            Bar(f"{words}, half angle ≤ {FAR} rad", near, limit, "%"),
            Bar(f"{words}, all", whole, limit, "%"),
        ]
    results = {"table_modulus_pa": MU, "variants": variants, "defaults": defaults, "energy": energy}
    results |= {
        "moment_over_pressure_m3": straight,
        "spatial": spatial,
        "sideways": sideways,
        "wall_s": time.perf_counter() - begun,
    }
    write("family_helical", results, bars)


if __name__ == "__main__":
    main()
