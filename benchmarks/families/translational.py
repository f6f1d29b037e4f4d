"""The translational bellow against the published solver: python -m benchmarks.families.translational

One shear modulus is fitted to the published free curve of one module with closed ends, once with the family's end
sections, which stay plane and are free to breathe as in the middle of a long bellow, and once with end sections that
are held in their plane. With it everything else is predicted: the states pushed back, energy and volume, the free
curve with open ends, and what a further module adds to a long chain. Then our own figures: meshes and moduli.
Writes benchmarks/out/family_translational.json.

Source: the public repository of Yao, Howard, Maiolino (2026), yaoyao199709/soft-robot-task-driven-design at b1af917,
surrogate/matlab/translation/model_analysis/translation_stiffness.m (COMSOL; material and boundary conditions are not
stated). Every second pressure of the free curves, six of thirty forces at three of fifteen pressures, and three of
forty-one states of each chain are typed in here.

Closed: pressure pushes on both inner ends; open: on the wall alone. Extensions in mm, energies in mJ, volumes in mm³.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
from benchmarks.families.published_y import free_curve, make_solver, relative_rms
from benchmarks.output import Bar, write
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleProblem
from pliant_plugins.families.bellow_translational.family import BellowTranslational, BellowTranslationalConfig
from pliant_plugins.families.reference import EXTENDING
from pliant_plugins.fem.skfem.backend import SkfemSolver

# What was published, r 5, R 8, t 1.5, l 10 mm.
KPA = np.arange(16.0)
CLOSED_MM = (
    0.0, 0.67454, 1.2052, 1.6406, 2.0091, 2.3284, 2.6103, 2.8627,
    3.0918, 3.3019, 3.4963, 3.6778, 3.8485, 4.0101, 4.1641, 4.3117,
)  # fmt: skip
CLOSED_MJ = (
    0.0, 0.064691, 0.22434, 0.44862, 0.7225, 1.0382, 1.392, 1.7822,
    2.2086, 2.6718, 3.1733, 3.7151, 4.2994, 4.9291, 5.6075, 6.3383,
)  # fmt: skip
OPEN_MM = (
    0.0, 0.46432, 0.84448, 1.1647, 1.4403, 1.6819, 1.8967, 2.0900,
    2.2657, 2.4270, 2.5762, 2.7152, 2.8457, 2.9689, 3.0859, 3.1976,
)  # fmt: skip
OPEN_MJ = (
    0.0, 0.036224, 0.13122, 0.27204, 0.45174, 0.66665, 0.91495, 1.196,
    1.51, 1.8577, 2.24, 2.6585, 3.115, 3.6113, 4.1499, 4.7333,
)  # fmt: skip
OPEN_MM3 = (
    1584.4, 1685.4, 1770.8, 1845.5, 1912.6, 1974.1, 2031.5, 2085.7,
    2137.5, 2187.6, 2236.3, 2284.1, 2331.2, 2377.9, 2424.4, 2471.0,
)  # fmt: skip
# Closed, pushed back by a force (N) at a constant pressure (Pa): extension in mm.
FORCES_N = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5)
PUSHED_MM = {
    5e3: (1.7606, 1.117, 0.37158, -0.51763, -1.6209, -3.0577),
    10e3: (3.1081, 2.6930, 2.2460, 1.7601, 1.2262, 0.63177),
    15e3: (4.0025, 3.6803, 3.3432, 2.9890, 2.6153, 2.2188),
}
# Chains, by number of modules, solved as one body at 10 kPa, pushed back by a force (N): extension of the chain in mm.
MODULES = np.arange(2, 11)
CHAIN_PA = 10e3
CHAINS_MM = {
    0.0: (5.9711, 9.3726, 12.771, 16.172, 19.493, 22.866, 26.239, 29.676, 32.924),
    0.5: (3.9353, 6.3161, 8.6949, 11.075, 13.381, 15.737, 18.090, 20.494, 22.730),
    1.0: (1.4706, 2.5740, 3.6771, 4.7800, 5.8342, 6.9295, 8.0022, 9.1068, 10.101),
}
# The end's area as the script states it, to take its thrust off: a circle of 4.00 mm.
STATED_END_MM2 = 50.263
# Solved cases.
PRESSURES = (2e3, 4e3, 7.5e3, 10e3, 12.5e3, 15e3)
MODULI = (240e3, 240.5e3, 249e3)
FITTED_AT = 240e3
FIT_PRESSURES = (250.0, 500.0, 1e3, 2e3, 4e3, 6e3, 8e3, 11e3, 14e3, 17e3, 20e3, 24e3)
INSIDE = ("end sections free to breathe", "end sections held")


def end_area_mm2() -> Array:
    """Return the end area (15,) without pressure on open ends, by energy: ∫ p dV − U = A ∫ p dx."""
    pressure_mpa, x, volume = 1e-3 * KPA, np.array(OPEN_MM), np.array(OPEN_MM3)
    by_volume = CubicSpline(volume, pressure_mpa).antiderivative()
    by_extension = CubicSpline(x, pressure_mpa).antiderivative()
    missing = by_volume(volume) - by_volume(volume[0]) - np.array(OPEN_MJ)
    return np.asarray(missing[1:] / by_extension(x)[1:])


def chain_slopes() -> dict[float, tuple[float, float]]:
    """Return, by force, the least-squares extension per module and the loss at the chain's two ends (mm)."""
    found = {force: np.polyfit(MODULES, chain, 1) for force, chain in CHAINS_MM.items()}
    return {force: (float(slope), float(-offset)) for force, (slope, offset) in found.items()}


def module() -> BellowTranslational:
    """Return the published design, r 5, R 8, t 1.5, l 10 mm."""
    return BellowTranslational(BellowTranslationalConfig.model_validate(EXTENDING))


def problem(held: bool, refinement: int = 1) -> ModuleProblem:
    """Return the problem of one module; `held`: no motion of an end section in its plane."""
    found = module().problem(refinement)
    return replace(found, fixed={**found.fixed, "end": (0, 1, 2)}) if held else found


def fitted(held: bool, refinement: int = 1) -> dict[str, Any]:
    """Fit the modulus (Pa) to the published closed free curve; return it and the error (RMS, mm)."""
    model = make_solver(problem(held, refinement), FITTED_AT, pressure_max_pa=25e3)
    states = [model.rest()]
    for pressure in FIT_PRESSURES:
        states.append(model.free(pressure, states[-1]))
    curve, pressures = free_curve(states, FITTED_AT), 1e3 * KPA

    def error(mu_pa: float) -> float:
        missed = 1e3 * curve(pressures / mu_pa) - CLOSED_MM
        return float(np.sqrt(np.mean(missed**2)))

    best = minimize_scalar(error, bounds=(150e3, 320e3), method="bounded")
    return {
        "held": held,
        "refinement": refinement,
        "shear_modulus_pa": float(best.x),
        "rms_mm": float(best.fun),
    }


def predicted(held: bool, mu_pa: float) -> dict[str, Any]:
    """Return our and the published values of states that were not fitted."""
    model = make_solver(problem(held), mu_pa, pressure_max_pa=16e3)
    rest, end_m2 = model.rest(), 1e-6 * float(np.median(end_area_mm2()))
    forces = {pressure: _forces(model, pressure, extensions) for pressure, extensions in PUSHED_MM.items()}
    closed = model.free(15e3, rest)
    opened = _under(model, 15e3, 15e3 * end_m2, closed)
    return {
        "held": held,
        "shear_modulus_pa": mu_pa,
        "stiffness_n_m": -rest.dmoment_du,
        "thrust_mm2": 1e6 * rest.dmoment_dp,
        "forces_n": {f"{pressure:g}": row.tolist() for pressure, row in forces.items()},
        "forces_rms": {f"{p:g}": relative_rms(row, np.array(FORCES_N)) for p, row in forces.items()},
        "closed_15_kpa_mm": 1e3 * closed.angle_rad,
        "closed_15_kpa_mj": 1e3 * closed.energy_j,
        "open_15_kpa_mm": 1e3 * opened.angle_rad,
        "open_15_kpa_mj": 1e3 * opened.energy_j,
        "open_15_kpa_grown_mm3": 1e9 * opened.travel,
        "chain_mm": _in_a_chain(model, end_m2),
    }


def _forces(model: SkfemSolver, pressure: float, extensions_mm: tuple[float, ...]) -> Array:
    """Return the force (n,) at each published extension."""
    state, found = model.free(pressure, model.rest()), []
    for extension in extensions_mm:
        state = model.constrained(pressure, 1e-3 * extension, state)
        found.append(state.moment_n_m)
    return np.array(found)


def _in_a_chain(model: SkfemSolver, end_m2: float) -> dict[str, float]:
    """Return extension (mm) of one module with open ends at the chains' pressure, by force."""
    state, found = model.free(CHAIN_PA, model.rest()), {}
    for force in CHAINS_MM:
        state = _under(model, CHAIN_PA, CHAIN_PA * end_m2 + force, state)
        found[f"{force:g}"] = 1e3 * state.angle_rad
    return found


def _under(model: SkfemSolver, pressure: float, force: float, start: FemState) -> FemState:
    return model.loaded(pressure, {"x": force}, start, ("x",))


def extensions(mu_pa: float, refinement: int = 1) -> dict[str, Any]:
    """Return free extensions (m) by pressure, status at the last, stiffness and thrust area at rest."""
    solver = make_solver(problem(False, refinement), mu_pa)
    state = rest = solver.rest()
    found = {}
    for pressure in PRESSURES:
        state = solver.free(pressure, state)
        found[pressure] = state.angle_rad
    at_rest = {"stiffness_n_m": -rest.dmoment_du, "thrust_m2": rest.dmoment_dp}
    solved = {
        "shear_modulus_pa": mu_pa,
        "refinement": refinement,
        "extension_m": found,
        "status": state.status,
    }
    return solved | at_rest


def told(fits: list[dict[str, Any]], found: list[dict[str, Any]], own: dict[str, float]) -> None:
    """Print our figures and the published ones."""
    print("read off the published figures                published      ours")
    print(f"    volume inside at rest, mm³              {OPEN_MM3[0]:10.1f}  {own['volume_mm3']:10.1f}")
    print(
        f"    area of an end by energy, mm²           {own['end_by_energy_mm2']:10.2f}  {own['end_mm2']:10.2f}"
    )
    print(f"    area of an end as their script says     {STATED_END_MM2:10.2f}")
    for fit in fits:
        print(
            f"fitted, {INSIDE[fit['held']]}, mesh × {fit['refinement']}: μ {fit['shear_modulus_pa'] / 1e3:.1f} kPa, "
            f"{1e3 * fit['rms_mm']:.1f} µm RMS of {CLOSED_MM[-1]:.2f} mm"
        )
    slopes = chain_slopes()
    for one in found:
        print(
            f"predicted, {INSIDE[one['held']]}, μ {one['shear_modulus_pa'] / 1e3:.1f} kPa:     published      ours"
        )
        for pressure, error in one["forces_rms"].items():
            print(f"    forces at {float(pressure) / 1e3:g} kPa: {100 * error:.2f} % RMS")
        for words, published, key in (
            ("closed, 15 kPa: energy, mJ", CLOSED_MJ[-1], "closed_15_kpa_mj"),
            ("open, 15 kPa: extension, mm", OPEN_MM[-1], "open_15_kpa_mm"),
            ("open, 15 kPa: energy, mJ", OPEN_MJ[-1], "open_15_kpa_mj"),
            (
                "open, 15 kPa: volume grown, mm³",
                OPEN_MM3[-1] - OPEN_MM3[0],
                "open_15_kpa_grown_mm3",
            ),
        ):
            print(f"    {words:48s} {published:10.4f}  {one[key]:10.4f}")
        for force, (slope, ends) in slopes.items():
            ours = one["chain_mm"][f"{force:g}"]
            words = f"a further module, 10 kPa, {force:g} N, mm (ends take {ends:.2f})"
            print(f"    {words:48s} {slope:10.4f}  {ours:10.4f}")


def main() -> None:
    begun = time.perf_counter()
    profile = module().geometry
    own = {
        "volume_mm3": 1e9 * profile.enclosed_volume(-profile.wall_m / 2),
        "end_mm2": 1e6 * np.pi * (profile.inner_radius_m - profile.wall_m / 2) ** 2,
        "end_by_energy_mm2": float(np.median(end_area_mm2())),
    }
    fits = [fitted(False), fitted(True), fitted(True, refinement=2)]
    # a chain's inner modules move radially whatever its ends do: with the modulus of the fit with held ends
    mu_pa = fits[1]["shear_modulus_pa"]
    found = [predicted(False, fits[0]["shear_modulus_pa"]), predicted(True, mu_pa), predicted(False, mu_pa)]
    told(fits, found, own)
    print("    μ kPa  mesh  7.5 kPa  15 kPa (mm)  N/mm at rest  mm² at rest")
    rows = [extensions(mu) for mu in MODULI] + [extensions(MODULI[0], refinement=2)]
    for row in rows:
        at = row["extension_m"]
        print(
            f"    {row['shear_modulus_pa'] / 1e3:5.1f}  × {row['refinement']}   {1e3 * at[7.5e3]:7.4f}  "
            f"{1e3 * at[15e3]:7.4f}      {row['stiffness_n_m'] / 1e3:8.5f}     {1e6 * row['thrust_m2']:7.2f}   "
            f"{row['status']}"
        )
    coarse, fine = rows[0]["extension_m"][15e3], rows[-1]["extension_m"][15e3]
    bar = Bar("default mesh against twice as fine, 15 kPa", 100 * abs(coarse / fine - 1), 1.0, "%", True)
    share = fits[1]["rms_mm"] / CLOSED_MM[-1]
    held = Bar("published free curve, ends held, RMS of its largest", share, 0.01, "%", scale=100)
    figures = {"own": own, "fits": fits, "predicted": found, "rows": rows}
    write("family_translational", {**figures, "wall_s": time.perf_counter() - begun}, [bar, held])


if __name__ == "__main__":
    main()
