"""Stage 1: FEM data of a design and a material."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import NotReachedError, UserError
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.interfaces.fem import FEMBackend, FemConfig, ModuleSolver
from pliant.interfaces.material import Material, MaterialConfig
from pliant.meshing.cells import HEXAHEDRON, SquareSkin
from pliant.meshing.soundness import found_wrong
from pliant.pipeline.answer_checks import answer_checks
from pliant.pipeline.sampling.plan import Sampling, sample
from pliant.pipeline.sampling.strategies import axis_loads
from pliant.pipeline.sampling.walk import FULL, MAIN, Sampled, Subproblem
from pliant.pipeline.workbench import RunContext, content
from pliant.records.actuation import split_actuation_names
from pliant.records.design import Array
from pliant.records.fem import COUPLING, TRUSTED, FemState, ModuleData, ModuleMesh, ModuleProblem, ModuleShape
from pliant.store.store import Artifact

OF_STATES = (
    *("actuation", "energy_j", "travel", "wall_s", "deformation", "tau", "dtau_dp", "dtau_du"),
    *("iterations", "branch", "status"),
)
AGREEMENT = 1e-6  # of a column's largest value; Newton ends at 1e-9 and less


def module_rows(sampling: Sampling, axes: Sequence[str], main_axis: str) -> dict[str, Any]:
    """Return the columns of `ModuleData`.

    For a module with several axes, a state of the piece that moves only about the main axis has zero in the other
    entries of u, τ and ∂τ/∂p, by symmetry, and NaN in the unknown slopes. A free state of the full piece is a row of
    each lateral axis. A state of an axis about which the module is symmetric has a copy at −u, with zero iterations
    and time. Under several actuations there is one piece, and every state covers all axes.
    """
    rows: list[tuple[FemState, str, str]] = []  # with its role and the axis whose law it explores
    if sampling.solved and np.ndim(sampling.solved[0].state.actuation):
        explored = main_axis if len(axes) == 1 else COUPLING
        rows = [(one.state, one.target.role, explored) for one in sampling.solved]
        return _columns(rows)
    lateral = [axis for axis in axes if axis != main_axis]
    for one in sampling.solved:
        state, role = one.state, one.target.role
        if one.target.piece != FULL:
            rows.append((_embedded(state, axes, main_axis), role, main_axis))
        elif one.target.branch == "free":
            copies = (state, *[replace(state, iterations=0, wall_s=0.0)] * (len(lateral) - 1))
            rows += [(copy, role, axis) for copy, axis in zip(copies, lateral, strict=True)]
        else:
            explored = one.target.explored or COUPLING
            rows.append((state, role, explored))
            if explored in sampling.mirrored and role == "fit":
                rows.append((_mirrored(state, axes.index(main_axis)), role, explored))
    return _columns(rows)


def _columns(rows: Sequence[tuple[FemState, str, str]]) -> dict[str, Any]:
    """Return the arrays of states with their roles and the axes that they explore."""
    columns: dict[str, Any] = {name: np.array([getattr(s, name) for s, _, _ in rows]) for name in OF_STATES}
    return columns | {
        "role": np.array([row[1] for row in rows]),
        "explored": np.array([row[2] for row in rows]),
    }


def _embedded(state: FemState, axes: Sequence[str], main_axis: str) -> FemState:
    """Return a state of the main axis with the entries of all axes."""
    k, m = len(axes), axes.index(main_axis)
    if k == 1:
        return state
    vectors = {name: np.zeros(k) for name in ("deformation", "tau", "dtau_dp")}
    slopes = np.full((k, k), np.nan)
    for name, vector in vectors.items():
        vector[m] = getattr(state, name)[state.main]
    slopes[m, m] = state.dmoment_du
    return replace(state, **vectors, dtau_du=slopes, main=m)  # type: ignore[arg-type]


def _mirrored(state: FemState, main: int) -> FemState:
    """Return the mirror image of a state: all lateral angles change their sign."""
    sign = -np.ones(len(state.deformation))
    sign[main] = 1.0
    return replace(
        state,
        iterations=0,
        wall_s=0.0,
        deformation=sign * state.deformation,
        tau=sign * state.tau,
        dtau_dp=sign * state.dtau_dp,
        dtau_du=np.outer(sign, sign) * state.dtau_du,
    )


def fem_stage(
    context: RunContext, family: FamilyConfig, material: MaterialConfig, fem: FemConfig
) -> Artifact:
    """Return the FEM data of one design; the artifact's value is a `ModuleData`."""
    built: ActuatorFamily = context.build("family", family)
    backend: FEMBackend = context.build("fem", fem)
    substance: Material = context.build("material", material)
    for remark in (*built.remarks(), *substance.remarks()):
        context.progress.note(remark)

    def build_pieces(problems: Mapping[str, ModuleProblem]) -> list[Subproblem]:
        for one in problems.values():
            require_sound(one, family.kind)
        return [
            build_piece(name, one, backend.checked_solver(one, substance)) for name, one in problems.items()
        ]

    def compute(partial: Path) -> ModuleData:
        problems = module_problems(built, fem.refinement)
        main = problems[MAIN]
        pieces = build_pieces(problems)
        loads = axis_loads(fem, problems.get(FULL, main)) if fem.sampling == "study" else {}
        limit = fem.actuation_max(main.actuation)
        sampling = sample(pieces, fem, limit, partial, context.progress, loads)
        return checked_data(as_data(built, problems, pieces, sampling), main, substance, pieces, sampling)

    configs = {"family": family, "material": material, "fem": fem}
    return context.make(
        "fem",
        compute,
        components=[
            *(context.component(name, config) for name, config in configs.items()),
            *(context.component("material", own) for own in material.region_materials().values()),
        ],
        modules=["pliant.pipeline.dataset"],
        config={name: content(config) for name, config in configs.items()},
        inputs={},
        agrees=lambda data: same_physics(data, build_pieces(module_problems(built, fem.refinement))),
    )


def checked_data(
    data: ModuleData,
    problem: ModuleProblem,
    material: Material,
    pieces: Sequence[Subproblem],
    sampling: Sampling,
) -> ModuleData:
    """Return the data with the figures of the checks on its answer; a state at rest is solved if none was sampled."""
    solved = (one.state for one in sampling.solved if one.target.piece == MAIN)
    at_rest = (state for state in solved if not np.any(state.actuation) and state.angle_rad == 0.0)
    rest = next(at_rest, None) or next(piece.solver for piece in pieces if piece.name == MAIN).rest()
    return replace(data, sampling={**data.sampling, "checks": answer_checks(data, problem, material, rest)})


def same_physics(data: ModuleData, pieces: Sequence[Subproblem]) -> bool:
    """Return whether solvers reproduce the data's states, checked for the farthest trusted state of each piece.

    Deformation, effort, both slopes and energy must agree to `AGREEMENT` of the data's largest value. A data set of
    an older layout, or a state that does not converge from rest, counts as a disagreement.
    """
    try:
        for piece in pieces:
            rows = np.flatnonzero(np.isin(data.status, TRUSTED) & (data.branch == "constrained"))
            if len(pieces) > 1:
                rows = rows[(data.explored[rows] == data.main_axis) == (piece.name == MAIN)]
            if not len(rows):
                return False
            reach = np.maximum(np.abs(data.deformation).max(axis=0), np.finfo(float).tiny)
            size = np.abs(data.deformation[rows] / reach).sum(axis=1)
            driven = data.actuation[rows]
            row = rows[np.argmax(size * (driven if driven.ndim == 1 else driven.sum(axis=1)))]
            # from rest along the free branch
            actuation, state = data.actuation[row], piece.solver.rest()
            for share in (0.5, 1.0):
                state = piece.solver.free(share * actuation, state)
            held = {axis: float(data.deformation[row, data.axes.index(axis)]) for axis in piece.axes}
            if not _agrees(data, int(row), piece.solver.constrained(actuation, held, state), piece):
                return False
    except (NotReachedError, UserError, AttributeError, ValueError, IndexError):
        return False
    return True


def _agrees(data: ModuleData, row: int, state: FemState, piece: Subproblem) -> bool:
    """Return whether a state equals the row in the coordinates of the piece."""
    places = [data.axes.index(axis) for axis in piece.axes]
    pairs: list[tuple[Array, Array | float]] = [(data.energy_j, state.energy_j)]
    for name in ("deformation", "tau", "dtau_dp"):
        pairs.append((getattr(data, name)[:, places], getattr(state, name)))
    pairs.append((data.dtau_du[:, places][:, :, places], state.dtau_du))
    return all(
        bool(np.all(np.abs(column[row] - value) <= AGREEMENT * np.nanmax(np.abs(column))))
        for column, value in pairs
    )


def require_sound(problem: ModuleProblem, kind: str) -> None:
    """Raise `UserError` if the mesh of a family's problem has errors that prevent a solution.

    A subclass of `ModuleProblem` is not checked, since the meaning of its mesh is known only to its backend.
    """
    found = found_wrong(problem) if type(problem) is ModuleProblem else ""
    if found:
        raise UserError(
            f"the mesh of the family '{kind}' cannot be solved as it is: {found}. "
            f"'pliant check family {kind}' checks more."
        )


def build_piece(name: str, problem: ModuleProblem, solver: ModuleSolver) -> Subproblem:
    """Return a problem with its solver, ready for sampling."""
    limits = problem.contact_range or (-np.inf, np.inf)
    return Subproblem(name, solver, problem.axes, problem.main_axis, limits, problem.closing)


def module_problems(family: ActuatorFamily, refinement: int) -> dict[str, ModuleProblem]:
    """Return the pieces to solve: that of the main axis and, if there are other axes, the module with all axes.

    Under several actuations there is no single driven axis: only the module with all axes is solved.
    """
    if len(family.axes) == 1 or len(split_actuation_names(family.actuation)) > 1:
        return {MAIN: family.problem(refinement)}
    return {
        MAIN: family.problem(refinement, axes=(family.main_axis,)),
        FULL: family.problem(refinement),
    }


def as_data(
    family: ActuatorFamily,
    problems: Mapping[str, ModuleProblem],
    pieces: Sequence[Subproblem],
    sampling: Sampling,
) -> ModuleData:
    """Collect solved states as a table, with deformed shapes of the main piece's free branch for pictures."""
    whole = problems.get(FULL, problems[MAIN])
    rows = module_rows(sampling, whole.axes, whole.main_axis)
    solver = next(piece.solver for piece in pieces if piece.name == MAIN)
    meshes = {name: problem.mesh for name, problem in problems.items()}
    sizes = {name: _size(mesh) for name, mesh in meshes.items()}
    return ModuleData(
        design=family.design,
        joint=whole.joint,
        axes=whole.axes,
        main_axis=whole.main_axis,
        actuation_name=whole.actuation,
        failed=sampling.failed,
        shapes=_shapes(problems[MAIN], solver, sampling.solved),
        sampling={**sampling.summary, "n_solved": len(sampling.solved), "pieces": sizes},
        **rows,
    )


def _shapes(
    problem: ModuleProblem, solver: ModuleSolver, solved: tuple[Sampled, ...]
) -> tuple[ModuleShape, ...]:
    """Return the skin at rest and on the free branch by ascending actuation; the last state with its stress."""
    free = [s.state for s in solved if s.target.branch == "free" and s.target.piece == MAIN]
    skin = SquareSkin.from_faces(problem.mesh.skin)
    mirrors = mirror_planes(problem)

    def shape(state: FemState, stress: Array | None = None) -> ModuleShape:
        points = skin.values(solver.deformed_nodes(state))
        return ModuleShape(
            float(np.max(state.actuation)), state.angle_rad, points, skin.faces, stress, mirrors
        )

    return (*(shape(state) for state in free[:-1]), *(shape(s, _stress(solver, s, skin)) for s in free[-1:]))


def _size(mesh: ModuleMesh) -> dict[str, int]:
    """Return the numbers of cells and nodes; the cells' own nodes if they are not hexahedra."""
    size, of_cell = {"n_cells": len(mesh.cells), "n_nodes": len(mesh.nodes_m)}, mesh.cells.shape[1]
    return size if of_cell == HEXAHEDRON.nodes else {**size, "cell_nodes": of_cell}


def _stress(solver: ModuleSolver, state: FemState, skin: SquareSkin) -> Array | None:
    """Return the von Mises stress on the skin, or None if the backend provides no fields."""
    try:
        return skin.values(np.asarray(solver.fields(state).point_data["von_mises_pa"], dtype=float))
    except (UserError, KeyError):
        return None


def mirror_planes(problem: ModuleProblem) -> tuple[str, ...]:
    """Return the planes x, y, z = 0 in which mirror images of the solved piece make the module, by their normals.

    x if the piece is half the module; y and z if a whole plane of nodes is fixed in that plane.
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
