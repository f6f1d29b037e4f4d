"""Stage 1: a design and a material become FEM data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.interfaces.fem import FEMBackend, FemConfig, ModuleSolver
from pliant.interfaces.material import Material, MaterialConfig
from pliant.pipeline.rows import module_rows
from pliant.pipeline.sampling import FULL, MAIN, Piece, Sampled, Sampling, sample
from pliant.pipeline.sampling.study import loads_of
from pliant.pipeline.workbench import Workbench, content
from pliant.records.design import Array
from pliant.records.fem import FemState, IntArray, ModuleData, ModuleProblem, ModuleShape
from pliant.store.store import Artifact


def fem_stage(bench: Workbench, family: FamilyConfig, material: MaterialConfig, fem: FemConfig) -> Artifact:
    """The FEM data of one design; the artifact's value is a `ModuleData`."""
    built: ActuatorFamily = bench.build("family", family)
    backend: FEMBackend = bench.build("fem", fem)
    substance: Material = bench.build("material", material)
    for remark in substance.remarks():
        bench.progress.note(remark)

    def compute(partial: Path) -> ModuleData:
        problems = module_problems(built, fem.refinement)
        main = problems[MAIN]
        pieces = [
            piece_of(name, problem, backend.solver(problem, substance)) for name, problem in problems.items()
        ]
        loads = loads_of(fem, problems.get(FULL, main)) if fem.sampling == "study" else {}
        limit = fem.actuation_max(main.actuation)
        return as_data(built, problems, pieces, sample(pieces, fem, limit, partial, bench.progress, loads))

    return bench.make(
        "fem",
        compute,
        components=[
            bench.component("family", family),
            bench.component("material", material),
            bench.component("fem", fem),
        ],
        modules=["pliant.pipeline.dataset"],
        config={
            "family": content(family),
            "material": content(material),
            "fem": content(fem),
        },
        inputs={},
    )


def piece_of(name: str, problem: ModuleProblem, solver: ModuleSolver) -> Piece:
    """A problem with its solver, ready to be sampled."""
    limits = problem.contact_range or (-np.inf, np.inf)
    return Piece(name, solver, problem.axes, problem.main_axis, limits, problem.closing)


def module_problems(family: ActuatorFamily, refinement: int) -> dict[str, ModuleProblem]:
    """The pieces to solve: the main axis alone, where there are others the module with all of them too."""
    if len(family.axes) == 1:
        return {MAIN: family.problem(refinement)}
    return {
        MAIN: family.problem(refinement, axes=(family.main_axis,)),
        FULL: family.problem(refinement),
    }


def as_data(
    family: ActuatorFamily,
    problems: Mapping[str, ModuleProblem],
    pieces: Sequence[Piece],
    sampling: Sampling,
) -> ModuleData:
    """Collect solved states as a table, with deformed shapes of the main piece's free branch for pictures."""
    whole = problems.get(FULL, problems[MAIN])
    rows = module_rows(sampling, whole.axes, whole.main_axis)
    solver = next(piece.solver for piece in pieces if piece.name == MAIN)
    return ModuleData(
        design=family.design,
        joint=whole.joint,
        axes=whole.axes,
        main_axis=whole.main_axis,
        actuation_name=whole.actuation,
        failed=sampling.failed,
        shapes=_shapes(problems[MAIN], solver, sampling.solved),
        sampling={**sampling.summary, "n_solved": len(sampling.solved), "pieces": _sizes(problems)},
        **rows,
    )


def _sizes(problems: Mapping[str, ModuleProblem]) -> dict[str, dict[str, int]]:
    """How large each piece's mesh is."""
    meshes = {name: problem.mesh for name, problem in problems.items()}
    return {name: {"n_cells": len(m.cells), "n_nodes": len(m.nodes_m)} for name, m in meshes.items()}


def _shapes(
    problem: ModuleProblem, solver: ModuleSolver, solved: tuple[Sampled, ...]
) -> tuple[ModuleShape, ...]:
    """The skin at rest and on the free branch, in ascending actuation; the last one with its stress."""
    free = [s.state for s in solved if s.target.branch == "free" and s.target.piece == MAIN]
    nodes, faces = np.unique(problem.mesh.skin, return_inverse=True)
    skin: IntArray = faces.reshape(problem.mesh.skin.shape).astype(np.int64)
    mirrors = mirror_planes(problem)

    def shape(state: FemState, stress: Array | None = None) -> ModuleShape:
        points = solver.deformed_nodes(state)[nodes]
        return ModuleShape(state.actuation, state.angle_rad, points, skin, stress, mirrors)

    return (*(shape(state) for state in free[:-1]), *(shape(s, _stress(solver, s, nodes)) for s in free[-1:]))


def _stress(solver: ModuleSolver, state: FemState, nodes: IntArray) -> Array | None:
    """Von Mises stress at some nodes, or None where the backend gives no fields."""
    try:
        return np.asarray(solver.fields(state).point_data["von_mises_pa"][nodes], dtype=float)
    except (UserError, KeyError):
        return None


def mirror_planes(problem: ModuleProblem) -> tuple[str, ...]:
    """The planes x, y, z = 0 in which mirror images of the solved piece make the module, by their normals.

    x where the piece is half the module; y and z where a whole plane of nodes is held in it.
    """
    found = ["x"] if problem.deformation_scale == 2.0 else []
    nodes = problem.mesh.nodes_m
    near = 1e-9 * float(np.ptp(nodes, axis=0).max())
    for c, name in ((1, "y"), (2, "z")):
        for held, components in problem.fixed.items():
            place = nodes[problem.mesh.node_sets[held]]
            in_plane = bool(np.all(np.abs(place[:, c]) <= near))
            if c in components and in_plane and np.all(np.ptp(np.delete(place, c, axis=1), axis=0) > near):
                found.append(name)
                break
    return tuple(found)
