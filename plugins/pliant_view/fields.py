"""Fields of a data set's states, which are solved again because the data set does not store fields."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.interfaces.fem import FEMBackend, FemConfig
from pliant.interfaces.material import Material, MaterialConfig
from pliant.pipeline.dataset import build_piece, module_problems
from pliant.pipeline.sampling.walk import FULL, MAIN, SamplingRun, StateCache, StateTarget
from pliant.pipeline.workbench import RunContext
from pliant.records.fem import FemState, ModuleData, ModuleFields

Which = Literal["extremes", "free", "all"]
SAME = 1e-9  # of the largest actuation


@dataclass(frozen=True, eq=False)
class SolvedFields:
    """A state and its fields; `held` names what was prescribed, by axis, and is empty on the free branch."""

    state: FemState
    fields: ModuleFields
    held: Mapping[str, float]
    axes: tuple[str, ...]


def field_targets(data: ModuleData, which: Which) -> list[StateTarget]:
    """Return the states to solve again, in an order in which each is close to one before it.

    "free": the main axis' free branch. "extremes": also, for each axis, the prescribed states with the smallest and
    largest u at zero and at the largest actuation. "all": every state with prescribed angles that is no symmetric copy.
    """
    free = sorted(
        {float(p) for p in data.actuation[(data.explored == data.main_axis) & (data.branch == "free")]}
    )
    targets = [StateTarget("free", p, explored=data.main_axis) for p in free if p > 0]
    if which != "free":
        for axis in data.explored_axes():
            targets += _held(data, axis, which)
    if which == "all":
        for row in np.flatnonzero(data.explored == "coupling"):
            held = {axis: float(u) for axis, u in zip(data.axes, data.deformation[row], strict=True)}
            targets.append(StateTarget("constrained", float(data.actuation[row]), held, piece=FULL))
    return targets


def solve_fields(
    context: RunContext,
    family: FamilyConfig,
    material: MaterialConfig,
    fem: FemConfig,
    targets: list[StateTarget],
) -> Iterator[SolvedFields]:
    """Yield the rest state and the targets with their fields, immediately after each solution.

    States that are not reached are reported and omitted. Raises `UserError` if the backend provides no fields.
    """
    built: ActuatorFamily = context.build("family", family)
    backend: FEMBackend = context.build("fem", fem)
    substance: Material = context.build("material", material)
    problems = module_problems(built, fem.refinement)
    needed = [name for name in problems if name == MAIN or any(t.piece == name for t in targets)]
    pieces = {
        name: build_piece(name, p, backend.checked_solver(p, substance))
        for name, p in problems.items()
        if name in needed
    }
    bar = context.progress.begin("fields", len(targets) + len(pieces))
    with tempfile.TemporaryDirectory() as folder:
        walk = SamplingRun(pieces, StateCache(Path(folder), context.progress.note), bar)
        try:
            for name, piece in pieces.items():
                state = walk.rest(name)
                if name == MAIN:
                    yield SolvedFields(state, piece.solver.fields(state), {}, piece.axes)
            for target in targets:
                found = walk.solve(target)
                piece = pieces[target.piece]
                if found is not None:
                    yield SolvedFields(found, piece.solver.fields(found), dict(target.held), piece.axes)
                else:
                    context.progress.note(f"no fields of a state: {walk.failed[-1]['cause']}")
        finally:
            bar.finish()


def _held(data: ModuleData, axis: str, which: Which) -> list[StateTarget]:
    """Return the prescribed states of one axis, nearest to the free state first."""
    k = data.axes.index(axis)
    rows = np.flatnonzero((data.explored == axis) & (data.branch == "constrained"))
    rows = rows[(data.wall_s[rows] > 0) | (data.iterations[rows] > 0)]  # without symmetric copies
    if which == "extremes" and len(rows):
        p, u = data.actuation[rows], data.deformation[rows, k]
        corners = set()
        for level in (p.min(), p.max()):
            there = np.flatnonzero(np.abs(p - level) <= SAME * max(float(p.max()), 1.0))
            corners |= {int(there[np.argmin(u[there])]), int(there[np.argmax(u[there])])}
        rows = rows[sorted(corners)]
    order = rows[np.argsort(np.abs(data.tau[rows, k]), kind="stable")]
    piece = MAIN if axis == data.main_axis else FULL
    places = [(float(data.actuation[row]), {axis: float(data.deformation[row, k])}) for row in order]
    return [StateTarget("constrained", p, held, explored=axis, piece=piece) for p, held in places]
