"""Fibre-reinforced bending against the published model: python -m benchmarks.families.fibre_reinforced

Published: P. Polygerinos et al., IEEE Trans. Robot. 31 (2015) 778–789: a half-round tube wound with threads over a
sheet that does not stretch. Its closed form of pressure against angle takes the section as rigid, the stretch around
the tube as 1 and rubber as incompressible and neo-Hookean. Dimensions and modulus as two public scripts give them,
which agree: MahboubehKeyvanara/Fiber-Reinforced-Soft-Actuator at 6378fb1 (a course) and a calibration by M. Li (2018):
length 160 mm, radius 8 mm, wall 2 mm, bottom 2 mm, μ 314 kPa (Elastosil M4601).

Printed: the closed form and our FEM of that half-round section, and the same three assumptions applied to a round
section and the family's FEM, for several stiffnesses of sheet and threads, which no script states. Writes
benchmarks/out/family_fibre_reinforced.json.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from benchmarks.families.published_y import free_curve
from benchmarks.output import write
from scipy.integrate import dblquad, quad

from pliant.meshing.grids import grid_cells, grid_faces, grid_lines, module_sets, numbered
from pliant.meshing.hexahedra import boundary_faces
from pliant.records.design import Array
from pliant.records.fem import Fibres, ModuleMesh, ModuleProblem
from pliant_plugins.families.fibre_reinforced.family import FibreReinforced, FibreReinforcedConfig
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.skfem.backend import Skfem
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig

LENGTH_M, RADIUS_M, WALL_M, BOTTOM_M, MU_PA = 160e-3, 8e-3, 2e-3, 2e-3, 314e3
# Not in the scripts, assumed.
SLEEVE_M, SPACING_M, POISSON = 0.2e-3, 3e-3, 0.4995
# Shear modulus of the sheet (Pa), EA of a thread (N), refinement of the mesh.
ASSUMED = ((30e6, 500.0, 1), (300e6, 500.0, 1), (300e6, 500.0, 2), (300e6, 2000.0, 1), (1200e6, 500.0, 1))
MODULE_M = 10e-3
ANGLES_DEG = (45, 90, 135, 180, 225, 270)
PRESSURES_PA = (5e3, 10e3, 20e3, 35e3, 50e3, 70e3, 90e3, 110e3, 130e3, 150e3)
SHEET_DEG = 25.0  # of the round section, each side


def stress(stretch: float) -> float:
    """Return the nominal axial stress (Pa) of neo-Hookean rubber without hoop stretch: μ (λ − 1/λ³)."""
    return float(MU_PA * (stretch - stretch**-3))


def half_round_pa(angle: float) -> float:
    """Return the published pressure at a bending angle (rad) of the whole length."""
    a, t, b, curved = RADIUS_M, WALL_M, BOTTOM_M, angle / LENGTH_M

    def arch(tau: float, phi: float) -> float:
        height = b + (a + tau) * np.sin(phi)
        return stress(1 + curved * height) * height * (a + tau)

    bottom = 2 * (a + t) * quad(lambda z: stress(1 + curved * z) * z, 0, b)[0]
    moment = bottom + 2 * dblquad(arch, 0, np.pi / 2, 0, t)[0]
    return float(6 * moment / (4 * a**3 + 3 * np.pi * a**2 * b))


def round_pa(angle: float) -> float:
    """Solve the balance for a round section of the same radius and wall over a sheet at its bottom."""
    a, t, curved = RADIUS_M, WALL_M, angle / LENGTH_M

    def ring(rho: float, phi: float) -> float:
        height = a + t - rho * np.cos(phi)
        return stress(1 + curved * height) * height * rho

    moment = 2 * dblquad(ring, 0, np.pi, a, a + t)[0]
    return float(moment / (np.pi * a**2 * (a + t)))


def half_round(thread_n: float, refinement: int) -> ModuleProblem:
    """Return half a module of the half-round tube, half its section; the sheet is outside its flat bottom."""
    mesh, tangents, sleeve = half_round_mesh(refinement)
    around = 2 * (RADIUS_M + WALL_M) + 2 * BOTTOM_M + np.pi * (RADIUS_M + WALL_M)
    angle = np.arctan2(around, SPACING_M)
    along = np.broadcast_to(np.array([1.0, 0.0, 0.0]), tangents.shape)
    spread = thread_n / (SPACING_M * SLEEVE_M)
    fibres = tuple(
        Fibres(sleeve, np.cos(angle) * along + sign * np.sin(angle) * tangents, spread)
        for sign in (1.0, -1.0)
    )
    return ModuleProblem(
        mesh=mesh,
        span_m=MODULE_M / 2,
        reference_z_m=0.0,
        deformation_scale=2.0,
        energy_scale=4.0,
        fixed={"start": (0,), "end": (0,), "symmetry": (1,), "pin": (2,)},
        fibres=fibres,
    )


def half_round_mesh(refinement: int) -> tuple[ModuleMesh, Array, Array]:
    """Build the slice x ∈ [0, l/2], y ≥ 0; return tangents (k, 27, 3) in the sleeve's cells, and their numbers."""
    place, tangent, corners, counts = outline()
    lines = [grid_lines(ends, refinement * n) for ends, n in zip(corners, counts, strict=True)]
    s = np.concatenate([lines[0], *(line[1:] for line in lines[1:])])
    share = SLEEVE_M / WALL_M
    depth = np.append(
        grid_lines((0.0, 1.0 - share), 2 * refinement)[:-1], grid_lines((1.0 - share, 1.0), refinement)
    )
    x = grid_lines((0.0, MODULE_M / 2), 1)
    inner, outer = (np.array([place(one, side) for one in s]) for side in (0.0, 1.0))
    section = (1 - depth)[None, :, None] * inner[:, None] + depth[None, :, None] * outer[:, None]
    X, _, _ = np.meshgrid(x, s, depth, indexing="ij")
    places = np.concatenate([X[..., None], np.broadcast_to(section, (len(x), *section.shape))], axis=-1)
    nodes, ids = numbered(places)
    cells = grid_cells(ids[:, ::-1])
    skin, _ = boundary_faces(cells)
    per_node = np.broadcast_to(np.array([tangent(one) for one in s])[None, :, None], places.shape).reshape(
        -1, 3
    )
    layer, along = (np.broadcast_to(v, X.shape).reshape(-1)[cells[:, 26]] for v in (depth, s[None, :, None]))
    sleeve = np.flatnonzero(layer > 1 - share)
    sheet = np.intersect1d(sleeve, np.flatnonzero(along < corners[0][1]))
    sets = module_sets(nodes, MODULE_M / 2, (0.0, 0.0, 0.0))
    mesh = ModuleMesh(nodes, cells, grid_faces(ids[:, :, 0]), skin, sets, {"sheet": sheet})
    return mesh, per_node[cells[sleeve]], sleeve


def outline() -> tuple[Callable[[float, float], Array], Callable[[float], Array], Any, tuple[int, ...]]:
    """Return (y, z) by s and side (0 inner, 1 outer), tangent by s, ends in s of the parts, and elements of each.

    Three parts: the flat bottom, its corner (inside a first piece of the arc, outside the wall's foot), the arc.
    """
    a, outer, b, first = RADIUS_M, RADIUS_M + WALL_M, BOTTOM_M, np.radians(12.0)

    def place(s: float, side: float) -> Array:
        if s <= 1:
            return np.array([(outer if side else a) * s, 0.0 if side else b])
        if s <= 2:
            turn = (s - 1) * first
            return (
                np.array([outer, (s - 1) * b]) if side else np.array([a * np.cos(turn), b + a * np.sin(turn)])
            )
        low = 0.0 if side else first
        turn, radius = low + (s - 2) * (np.pi / 2 - low), outer if side else a
        return np.array([radius * np.cos(turn), b + radius * np.sin(turn)])

    def tangent(s: float) -> Array:
        turn = 0.0 if s < 1 else np.pi / 2 * (1 + max(s - 2, 0.0))
        return np.array([0.0, np.cos(turn), np.sin(turn)])

    return place, tangent, ((0.0, 1.0), (1.0, 2.0), (2.0, 3.0)), (3, 1, 4)


def round_tube(thread_n: float, refinement: int) -> ModuleProblem:
    """Return the family's tube with the same radius, wall, threads and sheet."""
    millimetres = {
        "module_length": MODULE_M, "radius": RADIUS_M, "wall": WALL_M, "sleeve": SLEEVE_M, "thread_spacing": SPACING_M,
    }  # fmt: skip
    around = 2 * np.pi * (RADIUS_M + WALL_M)
    config = {name: f"{1e3 * value} mm" for name, value in millimetres.items()}
    config |= {
        "thread_angle": f"{np.degrees(np.arctan2(around, SPACING_M))} deg",
        "sheet_angle": f"{SHEET_DEG} deg",
    }
    config |= {"thread_stiffness": f"{thread_n} N"}
    return FibreReinforced(FibreReinforcedConfig.model_validate(config)).problem(refinement)


def pressures(problem: ModuleProblem, sheet_pa: float) -> list[float]:
    """Return the pressure (Pa) of our FEM at angles of the whole length; NaN beyond the largest solved one."""

    def rubber(mu: float) -> NeoHookean:
        return NeoHookean(NeoHookeanConfig(shear_modulus_pa=mu, poisson_ratio=POISSON))

    body = rubber(MU_PA).with_regions({"sheet": rubber(sheet_pa)})
    model = Skfem(SkfemConfig(pressure_max_pa=PRESSURES_PA[-1])).solver(problem, body)
    states = [model.rest()]
    for pressure in PRESSURES_PA:
        states.append(model.free(pressure, states[-1]))
    curve = free_curve(states)
    fine = np.linspace(0, PRESSURES_PA[-1], 2001)
    per_module = np.radians(ANGLES_DEG) * MODULE_M / LENGTH_M
    return np.interp(per_module, curve(fine), fine, right=np.nan).tolist()


def main() -> None:
    begun = time.perf_counter()
    rows: dict[str, list[float]] = {}
    for words, theory, tube in (("half round", half_round_pa, half_round), ("round", round_pa, round_tube)):
        rows[f"{words}: closed form"] = [theory(np.radians(angle)) for angle in ANGLES_DEG]
        for sheet_pa, thread_n, refinement in ASSUMED:
            what = f"sheet {sheet_pa / 1e6:g} MPa, EA {thread_n:g} N, mesh × {refinement}"
            rows[f"{words}: {what}"] = pressures(tube(thread_n, refinement), sheet_pa)
    print(
        "pressure in kPa at a bending angle of            " + "".join(f"{angle:8d}°" for angle in ANGLES_DEG)
    )
    for words, row in rows.items():
        print(f"    {words:52s}" + "".join(f"{value / 1e3:8.1f} " for value in row))
    found = {"angles_deg": ANGLES_DEG, "pressures_pa": rows}
    write("family_fibre_reinforced", {**found, "wall_s": time.perf_counter() - begun})


if __name__ == "__main__":
    main()
