"""The printed solid, meshed by an outside mesher, against the FEM it is from: python -m benchmarks.print.round_trip

A quarter of the module's printed solid (its symmetry planes cut it) is written as STL, meshed by Netgen (LGPL) with
quadratic tetrahedra, named, read by the family `mesh_file` and solved. Compared are the free angle at three pressures,
the torque held straight and the slope at rest, with the family's own hexahedra of `refinement` 1 and 2. The bar is on
the latter, whose cells are of the tetrahedra's size; what the default mesh is off by itself is printed beside it.

Needs ngsolve, for Netgen, and manifold3d. Writes benchmarks/out/round_trip.json.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.families.published_y import make_solver
from benchmarks.output import Bar, make_parser, write
from scipy.spatial import cKDTree

from pliant.interfaces.family import ActuatorFamily
from pliant.meshing.stl import write_stl
from pliant.records.design import Array
from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig
from pliant_plugins.families.mesh_file.family import MeshFile, MeshFileConfig
from pliant_plugins.families.mesh_file.netgen import mesh_cad
from pliant_plugins.families.pneunet.family import Pneunet, PneunetConfig
from pliant_print.boolean import solid as manifold
from pliant_print.boolean import surface, united, volume_m3
from pliant_print.module_solid import divided, module_solid

BAR = 0.01
MU = 240e3
PRESSURES_PA = (5e3, 10e3, 15e3)
MM = 1e3
BELLOW = BellowBending(
    BellowBendingConfig.model_validate(
        {"inner_radius": 2e-3, "average_radius": 6e-3, "wall": 1.5e-3, "module_length": 11e-3}
    )
)
PNEUNET = Pneunet(
    PneunetConfig.model_validate(
        {
            "module_length": 10e-3, "width": 15e-3, "height": 14e-3, "wall": 1.5e-3, "shell": 2e-3, "gap": 1e-3,
            "floor": 1.5e-3, "bridge": 1.5e-3, "channel_width": 2e-3, "channel_height": 1.5e-3, "layer": 1e-3,
        }
    )
)  # fmt: skip
# Family, largest edge (mm), largest edge along sharp inner edges (mm), pressures.
CASES: Mapping[str, tuple[ActuatorFamily, float, float | None, Sequence[float]]] = {
    "bellow_bending": (BELLOW, 0.8, 0.15, PRESSURES_PA),
    "pneunet, one material": (PNEUNET, 1.5, 0.4, (3e3, 6e3, 9e3)),
}


def quarter_stl(family: ActuatorFamily, path: Path) -> float:
    """Write a quarter of the module's printed solid, x ≥ 0 and y ≥ 0, in mm, and return its volume (m³)."""
    module = module_solid(family)
    whole = united([manifold(part, name) for name, part in module.bodies.items()])
    quarter = whole.trim_by_plane((1.0, 0.0, 0.0), 0.0).trim_by_plane((0.0, 1.0, 0.0), 0.0)
    write_stl(surface(quarter), path, MM)
    return volume_m3(quarter)


def naming(family: ActuatorFamily) -> Any:
    """Return the function from points (mm) on a face to its name."""
    problem = family.problem()
    wetted = divided(problem.mesh.nodes_m, problem.mesh.cavity, 12).vertices_m
    tree, span = cKDTree(MM * wetted), MM * problem.span_m

    def name(points: Array) -> str:
        x, y, _ = points.T
        if np.ptp(x) < 1e-5 and min(abs(x[0]), abs(x[0] - span)) < 1e-5:
            return "base" if abs(x[0]) < 1e-5 else "tip"
        if np.abs(y).max() < 1e-5:
            return "symmetry"
        return "cavity" if np.median(tree.query(points)[0]) < 0.15 else "outside"

    return name


def again(family: ActuatorFamily, largest: float, inner: float | None, folder: Path) -> MeshFile:
    """Return the module as a family `mesh_file` of the outside mesher's mesh of its printed solid."""
    stl, mesh = folder / "quarter.stl", folder / "quarter.msh"
    quarter_stl(family, stl)
    mesh_cad(stl, mesh, largest, naming(family), inner=inner)
    return MeshFile(MeshFileConfig(file=mesh, unit="mm", part="half", symmetry="symmetry", line_height_m=0.0))


def figures(family: ActuatorFamily, pressures_pa: Sequence[float], refinement: int = 1) -> dict[str, Any]:
    """Return free angles, torque held straight, slope at rest, and the size of the problem; all of one material."""
    problem = family.problem(refinement)
    problem = replace(problem, mesh=replace(problem.mesh, regions={}))
    model = make_solver(problem, MU, pressure_max_pa=pressures_pa[-1])
    states = [model.rest()]
    for pressure in pressures_pa:
        states.append(model.free(pressure, states[-1]))
    straight = model.constrained(pressures_pa[-1], 0.0, states[-1])
    return {
        "cells": len(model.problem.mesh.cells),
        "free_angle_rad": [state.angle_rad for state in states[1:]],
        "torque_n_m": straight.moment_n_m,
        "slope_n_m": states[0].dmoment_du,
    }


def differences(printed: Mapping[str, Any], solved: Mapping[str, Any]) -> dict[str, float]:
    """Return relative differences: the worst free angle, torque held straight, slope at rest."""
    free = np.array(printed["free_angle_rad"]) / np.array(solved["free_angle_rad"]) - 1
    return {
        "free_angle": float(free[np.argmax(np.abs(free))]),
        "torque": printed["torque_n_m"] / solved["torque_n_m"] - 1,
        "slope": printed["slope_n_m"] / solved["slope_n_m"] - 1,
    }


def round_trip(name: str) -> dict[str, Any]:
    """Return the figures of one case, printed and solved, and their differences."""
    family, largest, inner, pressures = CASES[name]
    with tempfile.TemporaryDirectory() as folder:
        printed = figures(again(family, largest, inner, Path(folder)), pressures)
    found: dict[str, Any] = {"printed": printed}
    for refinement in (1, 2):
        solved = figures(family, pressures, refinement)
        found[f"refinement_{refinement}"] = {**solved, "differences": differences(printed, solved)}
    found["default_mesh"] = differences(found["refinement_1"], found["refinement_2"])
    return found


def main(args: Sequence[str] | None = None) -> None:
    make_parser(__doc__).parse_args(args)
    result = {name: round_trip(name) for name in CASES}
    bars = []
    for name, found in result.items():
        print(f"{name}: {found['printed']['cells']} tetrahedra")
        for refinement in (1, 2):
            one = found[f"refinement_{refinement}"]
            print(
                f"  against {one['cells']} hexahedra of refinement {refinement}: {_shown(one['differences'])}"
            )
        print(f"  the default mesh against refinement 2: {_shown(found['default_mesh'])}")
        for key, value in found["refinement_2"]["differences"].items():
            bars.append(Bar(f"{name}: {key} against refinement 2", abs(value), BAR, "%", scale=100))
    write("round_trip", result, bars)


def _shown(differences: Mapping[str, float]) -> str:
    return ", ".join(f"{key} {100 * value:+.2f} %" for key, value in differences.items())


if __name__ == "__main__":
    main()
