"""The translational bellow against the published solver: python -m benchmarks.families.translational

One shear modulus is fitted to the published free curve of one module with closed ends, once with the family's end
sections, which stay plane and are free to breathe as in the middle of a long bellow, and once with end sections that
are held in their plane. With it everything else is predicted: the states pushed back, energy and volume, the free
curve with open ends, and what a further module adds to a long chain. Then our own figures: meshes and moduli.
Writes benchmarks/out/family_translational.json.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
from benchmarks.families import published_translation as data
from benchmarks.families.published_y import free_curve, relative_rms, solver_of
from benchmarks.output import Bar, write
from scipy.optimize import minimize_scalar

from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleProblem
from pliant_plugins.families.bellow_translational.family import BellowTranslational, BellowTranslationalConfig
from pliant_plugins.families.reference import EXTENDING
from pliant_plugins.fem.skfem.backend import SkfemSolver

PRESSURES = (2e3, 4e3, 7.5e3, 10e3, 12.5e3, 15e3)
MODULI = (240e3, 240.5e3, 249e3)
FITTED_AT = 240e3
FIT_PRESSURES = (250.0, 500.0, 1e3, 2e3, 4e3, 6e3, 8e3, 11e3, 14e3, 17e3, 20e3, 24e3)
INSIDE = ("end sections free to breathe", "end sections held")


def module() -> BellowTranslational:
    """The published design, r 5, R 8, t 1.5, l 10 mm."""
    return BellowTranslational(BellowTranslationalConfig.model_validate(EXTENDING))


def problem(held: bool, refinement: int = 1) -> ModuleProblem:
    """One module; `held`: nothing of an end section moves in its plane."""
    found = module().problem(refinement)
    return replace(found, fixed={**found.fixed, "end": (0, 1, 2)}) if held else found


def fitted(held: bool, refinement: int = 1) -> dict[str, Any]:
    """The modulus (Pa) that fits the published closed free curve, and the error (RMS, mm) that it leaves."""
    model = solver_of(problem(held, refinement), FITTED_AT, pressure_max_pa=25e3)
    states = [model.rest()]
    for pressure in FIT_PRESSURES:
        states.append(model.free(pressure, states[-1]))
    curve, pressures = free_curve(states, FITTED_AT), 1e3 * data.KPA

    def error(mu_pa: float) -> float:
        missed = 1e3 * curve(pressures / mu_pa) - data.CLOSED_MM
        return float(np.sqrt(np.mean(missed**2)))

    best = minimize_scalar(error, bounds=(150e3, 320e3), method="bounded")
    return {
        "held": held,
        "refinement": refinement,
        "shear_modulus_pa": float(best.x),
        "rms_mm": float(best.fun),
    }


def predicted(held: bool, mu_pa: float) -> dict[str, Any]:
    """States that nothing was fitted to, ours beside the published ones."""
    model = solver_of(problem(held), mu_pa, pressure_max_pa=16e3)
    rest, end_m2 = model.rest(), 1e-6 * float(np.median(data.end_area_mm2()))
    forces = {
        pressure: _forces(model, pressure, extensions) for pressure, extensions in data.PUSHED_MM.items()
    }
    closed = model.free(15e3, rest)
    opened = _under(model, 15e3, 15e3 * end_m2, closed)
    return {
        "held": held,
        "shear_modulus_pa": mu_pa,
        "stiffness_n_m": -rest.dmoment_du,
        "thrust_mm2": 1e6 * rest.dmoment_dp,
        "forces_n": {f"{pressure:g}": row.tolist() for pressure, row in forces.items()},
        "forces_rms": {f"{p:g}": relative_rms(row, np.array(data.FORCES_N)) for p, row in forces.items()},
        "closed_15_kpa_mm": 1e3 * closed.angle_rad,
        "closed_15_kpa_mj": 1e3 * closed.energy_j,
        "open_15_kpa_mm": 1e3 * opened.angle_rad,
        "open_15_kpa_mj": 1e3 * opened.energy_j,
        "open_15_kpa_grown_mm3": 1e9 * opened.travel,
        "chain_mm": _in_a_chain(model, end_m2),
    }


def _forces(model: SkfemSolver, pressure: float, extensions_mm: tuple[float, ...]) -> Array:
    """Force (n,) that holds each published extension."""
    state, found = model.free(pressure, model.rest()), []
    for extension in extensions_mm:
        state = model.constrained(pressure, 1e-3 * extension, state)
        found.append(state.moment_n_m)
    return np.array(found)


def _in_a_chain(model: SkfemSolver, end_m2: float) -> dict[str, float]:
    """Extension (mm) of one module with open ends at the chains' pressure, by force."""
    state, found = model.free(data.CHAIN_PA, model.rest()), {}
    for force in data.CHAINS_MM:
        state = _under(model, data.CHAIN_PA, data.CHAIN_PA * end_m2 + force, state)
        found[f"{force:g}"] = 1e3 * state.angle_rad
    return found


def _under(model: SkfemSolver, pressure: float, force: float, start: FemState) -> FemState:
    return model.loaded(pressure, {"x": force}, start, ("x",))


def extensions(mu_pa: float, refinement: int = 1) -> dict[str, Any]:
    """Free extensions (m) by pressure, status at the last, stiffness and thrust area at rest."""
    solver = solver_of(problem(False, refinement), mu_pa)
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
    """Ours beside the published figures."""
    print("read off the published figures                published      ours")
    print(f"    volume inside at rest, mm³              {data.OPEN_MM3[0]:10.1f}  {own['volume_mm3']:10.1f}")
    print(
        f"    area of an end by energy, mm²           {own['end_by_energy_mm2']:10.2f}  {own['end_mm2']:10.2f}"
    )
    print(f"    area of an end as their script says     {data.STATED_END_MM2:10.2f}")
    for fit in fits:
        print(
            f"fitted, {INSIDE[fit['held']]}, mesh × {fit['refinement']}: μ {fit['shear_modulus_pa'] / 1e3:.1f} kPa, "
            f"{1e3 * fit['rms_mm']:.1f} µm RMS of {data.CLOSED_MM[-1]:.2f} mm"
        )
    slopes = data.chain_slopes()
    for one in found:
        print(
            f"predicted, {INSIDE[one['held']]}, μ {one['shear_modulus_pa'] / 1e3:.1f} kPa:     published      ours"
        )
        for pressure, error in one["forces_rms"].items():
            print(f"    forces at {float(pressure) / 1e3:g} kPa: {100 * error:.2f} % RMS")
        for words, published, key in (
            ("closed, 15 kPa: energy, mJ", data.CLOSED_MJ[-1], "closed_15_kpa_mj"),
            ("open, 15 kPa: extension, mm", data.OPEN_MM[-1], "open_15_kpa_mm"),
            ("open, 15 kPa: energy, mJ", data.OPEN_MJ[-1], "open_15_kpa_mj"),
            (
                "open, 15 kPa: volume grown, mm³",
                data.OPEN_MM3[-1] - data.OPEN_MM3[0],
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
        "end_by_energy_mm2": float(np.median(data.end_area_mm2())),
    }
    fits = [fitted(False), fitted(True), fitted(True, refinement=2)]
    # a chain's inner modules breathe whatever its ends do: with the modulus of the fit that holds
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
    share = fits[1]["rms_mm"] / data.CLOSED_MM[-1]
    held = Bar("published free curve, ends held, RMS of its largest", share, 0.01, "%", scale=100)
    figures = {"own": own, "fits": fits, "predicted": found, "rows": rows}
    write("family_translational", {**figures, "wall_s": time.perf_counter() - begun}, [bar, held])


if __name__ == "__main__":
    main()
