"""Tetrahedra from a file against structured hexahedra of the same body: python -m benchmarks.fem_mesh_file

(a) the bending bellow in tetrahedra, each hexahedron cut into six, written to a file with named surfaces and read by
    `mesh_file`: torque held straight at 15 kPa, free angle at 15 kPa and slope at rest, as ratios to hexahedra of
    refinement 2
(b) the same bellow as a CAD solid (arcs, a plate, fused), meshed by Netgen: what the structured mesh leaves out
(c) seconds of a whole design of the first CAD mesh: all states that `fem: {kind: skfem, pressure_max: 15 kPa}` asks for
(d) the PneuNet of one material and of two 10 : 1, its hexahedra cut into six, as ratios to hexahedra of refinement 2;
    that of two as a CAD solid meshed by Netgen with smaller cells at its inner edges, and seconds of a design of one

Needs ngsolve, for Netgen. Prints the figures and writes them to benchmarks/out/fem_mesh_file.json.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.families.published_y import make_solver
from benchmarks.families.second_solver import cases, rubber
from benchmarks.output import make_parser, write

from pliant.interfaces.family import ActuatorFamily
from pliant.meshing.meshio_package import require_meshio
from pliant.pipeline.dataset import fem_stage
from pliant.pipeline.workbench import RunContext
from pliant.records.fem import IntArray, ModuleMesh
from pliant.registry.discovery import discover
from pliant.store.store import ArtifactStore
from pliant.testing.box import tetrahedral
from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig
from pliant_plugins.families.bellow_bending.mesh import BendingCounts
from pliant_plugins.families.mesh_file.family import MeshFile, MeshFileConfig
from pliant_plugins.families.mesh_file.netgen import mesh_cad
from pliant_plugins.families.pneunet.family import LAYER, Pneunet
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.skfem.backend import Skfem, SkfemSolver
from pliant_plugins.materials.neo_hookean import NeoHookeanConfig
from pliant_plugins.native import torch_first

MU = 240e3
PRESSURES_PA = (5e3, 10e3, 15e3)
LENGTHS_M = {"inner_radius": 2e-3, "average_radius": 6e-3, "wall": 1.5e-3, "module_length": 11e-3}
FILE = {"part": "half", "symmetry": "symmetry"}
LARGEST_MM, GRADING = 1.2, 0.7  # of the PneuNet as a CAD solid
BAR = 0.005  # of torque and free angle
SECONDS = 60.0  # of a design


def bellow() -> BellowBending:
    """Return the reference design."""
    return BellowBending(BellowBendingConfig.model_validate(LENGTHS_M))


def solved(family: ActuatorFamily, refinement: int = 1) -> dict[str, float]:
    """Return free angle, torque at zero angle, slope at rest, size, and processor seconds per state."""
    model = make_solver(family.problem(refinement), MU, pressure_max_pa=PRESSURES_PA[-1])
    return walked(model, PRESSURES_PA)


def walked(model: SkfemSolver, pressures_pa: Sequence[float]) -> dict[str, float]:
    """Return the same figures of any module, over its free branch."""
    begun = time.process_time()
    states = [model.rest()]
    for pressure in pressures_pa:
        states.append(model.free(pressure, states[-1]))
    straight = model.constrained(pressures_pa[-1], 0.0, states[-1])
    return {
        "cells": len(model.problem.mesh.cells),
        "unknowns": model.assembler.pattern.size,
        "free_angle_rad": states[-1].angle_rad,
        "torque_n_m": straight.moment_n_m,
        "slope_n_m": states[0].dmoment_du,
        "processor_s_per_state": (time.process_time() - begun) / 5,
    }


def cut(family: BellowBending, path: Path) -> Path:
    """Write the hexahedra of refinement 1, each as six tetrahedra, to a file in metres."""
    mesh, counts = family.problem().mesh, BendingCounts.from_geometry(family.geometry, 1)
    along = counts.foot_x + counts.shoulder + counts.flank + counts.trough
    wall = along * (counts.foot_y + counts.around) * counts.wall
    cells = mesh.cells.copy()
    # wall and plate number their common faces the other way round: diagonals must not cross there
    cells[:wall] = cells[:wall][:, np.arange(27).reshape(3, 3, 3)[:, ::-1].ravel()]
    tetrahedra = tetrahedral(replace(mesh, cells=cells)).cells
    edges = mesh.nodes_m[tetrahedra[:, 1:4]] - mesh.nodes_m[tetrahedra[:, :1]]
    wrong = np.linalg.det(edges) < 0
    tetrahedra[wrong] = tetrahedra[wrong][:, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]]
    return _written(mesh.nodes_m, tetrahedra, mesh, path)


def _written(nodes: np.ndarray, cells: IntArray, mesh: ModuleMesh, path: Path) -> Path:
    """Write the mesh with the surfaces as node sets of its planes and of its cavity."""
    meshio = require_meshio()
    span, near = float(mesh.nodes_m[:, 0].max()), 1e-9
    wetted = {tuple(np.round(p, 12)) for p in mesh.nodes_m[np.unique(mesh.cavity)].tolist()}
    sets = {
        "base": np.abs(nodes[:, 0]) < near,
        "tip": np.abs(nodes[:, 0] - span) < near,
        "symmetry": np.abs(nodes[:, 1]) < near,
        "cavity": np.array([tuple(np.round(p, 12)) in wetted for p in nodes.tolist()]),
    }
    data = {name: chosen.astype(int) for name, chosen in sets.items()}
    meshio.write(path, meshio.Mesh(nodes, [("tetra10", cells)], point_data=data))
    return path


def cad_solid() -> Any:
    """Return half the module, y ≥ 0, as an OCC solid with named faces, in mm: revolved wall and fused plate."""
    torch_first()
    from netgen.occ import ArcOfCircle, Axis, Box, Face, Pnt, Segment, Wire, X

    g = bellow().geometry
    r, t, a, top, half = (
        1e3 * v for v in (g.inner_radius_m, g.wall_m, g.arc_radius_m, g.crest_radius_m, g.half_length_m)
    )
    height, width = top + t, 1e3 * g.average_radius_m

    def point(x: float, radius: float) -> Any:
        return Pnt(x, 0, height - radius)

    def profile(d: float) -> list[Any]:
        s, b = np.sqrt(0.5), a - d
        crest = [point(0, top + d), point((a + d) * s, top - a + (a + d) * s), point(a + d, top - a)]
        trough = [point(a + d, r + a), point(half - b * s, r + a - b * s), point(half, r + a - b)]
        return [*crest, *trough]

    def line(q: list[Any]) -> list[Any]:
        straight = [Segment(q[2], q[3])] if g.flank_m else []
        return [ArcOfCircle(*q[:3]), *straight, ArcOfCircle(*q[3:])]

    inner, outer = profile(0.0), profile(t)
    edges = [*line(inner), Segment(inner[5], outer[5]), *line(outer[::-1]), Segment(outer[0], inner[0])]
    solid = Face(Wire(edges)).Revolve(Axis(Pnt(0, 0, height), X), 180) + Box(
        Pnt(0, 0, -t), Pnt(half, width, t)
    )
    for face in solid.faces:
        p = np.array([list(v.p) for v in face.vertices])
        rho = np.hypot(p[:, 1], p[:, 2] - height)
        off = np.where(
            rho >= top - a,
            np.hypot(p[:, 0], rho - (top - a)) - a,
            np.where(rho >= r + a, p[:, 0] - a, a - np.hypot(p[:, 0] - half, rho - (r + a))),
        )
        planes = {
            "base": p[:, 0],
            "tip": p[:, 0] - half,
            "symmetry": np.append(p[:, 1], face.center.y),
            "cavity": off,
        }
        face.name = next((name for name, away in planes.items() if np.abs(away).max() < 1e-6), "outside")
    return solid


def design_seconds(
    path: Path, folder: Path, mu_pa: float = MU, pressure_pa: float = 15e3
) -> dict[str, float]:
    """Return wall and processor time of the FEM stage of one design of one material; print them too."""
    context = RunContext(discover(), ArtifactStore(folder / "store"))
    family = from_file(path, "mm").config
    wall, processor = time.perf_counter(), time.process_time()
    made = fem_stage(
        context, family, NeoHookeanConfig(shear_modulus_pa=mu_pa), SkfemConfig(pressure_max_pa=pressure_pa)
    )
    design = {
        "processor_s": time.process_time() - processor,
        "wall_s": time.perf_counter() - wall,
        "states": len(made.value),
        "failed": len(made.value.failed),
    }
    print(
        f"    a design: {design['states']:.0f} states, {design['failed']:.0f} not reached: {design['wall_s']:.1f} s by "
        f"the clock, {design['processor_s']:.1f} s of processor time, at most {SECONDS:.0f}"
    )
    return design


def from_file(path: Path, unit: str = "m", **more: Any) -> MeshFile:
    """Return the family that reads a file of half the module, half its width."""
    return MeshFile(MeshFileConfig.model_validate({"file": path, "unit": unit, **FILE, **more}))


def row(name: str, found: dict[str, float], base: dict[str, float]) -> dict[str, Any]:
    """Print one mesh; its figures and ratios to `base`."""
    ratios = {key: found[key] / base[key] for key in ("torque_n_m", "free_angle_rad", "slope_n_m")}
    print(
        f"    {name:34s} {found['cells']:6.0f} {found['unknowns']:9.0f}  "
        + "  ".join(f"{value:8.5f}" for value in ratios.values())
        + f"  {found['processor_s_per_state']:7.2f}"
    )
    return {"mesh": name, **found, "ratios": ratios}


def chamber_solid(family: Pneunet) -> Any:
    """Return a quarter of the chamber as OCC solids `body` and `layer` that share a face, in mm."""
    torch_first()
    from netgen.occ import Box, Glue, Pnt

    x, y, z = ([1e3 * v for v in lines] for lines in _lines(family))

    def box(low: float, *high: float) -> Any:
        return Box(Pnt(0, 0, low), Pnt(*high))

    body = box(z[1], x[2], y[3], z[6]) + box(z[1], x[3], y[3], z[4])
    body = body - box(z[2], x[1], y[2], z[5]) - box(z[2], x[3], y[1], z[3])
    layer = box(z[0], x[3], y[3], z[1])
    body.mat("body")
    layer.mat(LAYER)
    return Glue([body, layer])


def chamber_surface(family: Pneunet, points: np.ndarray) -> str | None:
    """Return the name of a face of `chamber_solid` from points on it."""
    (_, _, _, end), (_, channel, side, _), (_, _, floor, _, _, top, _) = _lines(family)
    (x0, _, z0), (x1, y1, z1) = 1e-3 * points.min(axis=0), 1e-3 * points.max(axis=0)
    near, wall = 1e-9, family.geometry.x_lines[1]
    planes = {"base": x1 < near, "tip": x0 > end - near, "symmetry": y1 < near}
    within = z0 > floor - near and z1 < top + near and y1 < side + near
    planes["cavity"] = within and (x1 < wall + near or y1 < channel + near or z1 < floor + near)
    return next((name for name, here in planes.items() if here), None)


def _lines(family: Pneunet) -> tuple[tuple[float, ...], ...]:
    return family.geometry.x_lines, family.geometry.y_lines, family.geometry.z_lines


def pneunet(refinements: list[int], inner: list[float], folder: Path) -> list[dict[str, Any]]:
    """Run part (d): both, tetrahedra of the refinements, and the CAD solid with edges in mm at inner edges."""
    case, rows = cases()["pneunet"], []
    for regions in ({}, case.regions):
        material = rubber(case.modulus).with_regions({name: rubber(mu) for name, mu in regions.items()})
        backend = Skfem(SkfemConfig(pressure_max_pa=PRESSURES_PA[-1]))
        base: dict[str, float] = {}
        for refinement, tetrahedra in ((2, False), *((n, True) for n in refinements)):
            problem = case.family.problem(refinement)
            mesh = tetrahedral(problem.mesh) if tetrahedra else problem.mesh
            problem = replace(problem, mesh=mesh if regions else replace(mesh, regions={}))
            found = walked(backend.solver(problem, material), [case.actuation * n / 3 for n in (1, 2, 3)])
            base = base or found
            kind = f"{'tetrahedra' if tetrahedra else 'hexahedra'} of {refinement}"
            rows.append(row(f"{1 + bool(regions)} material(s), {kind}", found, base))
    # the last materials and base are those of two
    for size in inner:
        path = mesh_cad(
            chamber_solid(case.family),
            folder / f"chamber_{size:g}.msh",
            LARGEST_MM,
            partial(chamber_surface, case.family),
            grading=GRADING,
            inner=size,
        )
        problem = from_file(path, "mm", regions=[LAYER]).problem()
        found = walked(backend.solver(problem, material), [case.actuation * n / 3 for n in (1, 2, 3)])
        rows.append(row(f"2 materials, CAD, inner {size:g} mm", found, base))
        rows[-1] |= design_seconds(path, folder / f"{size:g}", case.modulus, case.actuation)
    return rows


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--cad", type=float, nargs="*", default=[2.0, 1.0], help="(b): largest edges in mm")
    parser.add_argument(
        "--pneunet", type=int, nargs="*", default=[1, 2], help="(d): refinements cut into tetrahedra"
    )
    parser.add_argument(
        "--inner", type=float, nargs="*", default=[1.2, 0.3, 0.2], help="(d): mm at inner edges"
    )
    parser.add_argument("--only", choices=["d"], help="(d) alone, written nowhere")
    options = parser.parse_args()
    if options.only:
        with tempfile.TemporaryDirectory() as name:
            pneunet(options.pneunet, options.inner, Path(name))
        return
    family = bellow()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print(
            "(a) mesh                                cells  unknowns   torque     free     slope    s/state"
        )
        base = solved(family, 2)
        rows = [
            row("hexahedra, refinement 2", base, base),
            row("hexahedra, refinement 1", solved(family), base),
        ]
        paths = {"hexahedra of 1, cut into six": cut(family, folder / "cut.vtu")}
        rows += [row(label, solved(from_file(path)), base) for label, path in paths.items()]
        print("(b) the CAD solid (ratios to the same hexahedra)")
        for size in options.cad:
            paths[size] = mesh_cad(cad_solid(), folder / f"cad_{size:g}.msh", size)
            rows.append(
                row(f"CAD solid, edges up to {size:g} mm", solved(from_file(paths[size], "mm")), base)
            )
        print("(c) a design of these tetrahedra")
        design = design_seconds(paths[options.cad[0]], folder)
        print("(d) the PneuNet, ratios to hexahedra of refinement 2 of the same materials")
        chambers = pneunet(options.pneunet, options.inner, folder)
    worst = max(abs(r["ratios"][key] - 1) for r in rows[2:3] for key in ("torque_n_m", "free_angle_rad"))
    print(f"    tetrahedra against hexahedra of the same body: {worst:.2%}, at most {BAR:.1%}")
    write("fem_mesh_file", {"meshes": rows, "pneunet": chambers, "design": design, "worst": worst})


if __name__ == "__main__":
    main()
