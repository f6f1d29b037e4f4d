"""Stage 1: a design and a material become FEM data."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.interfaces.fem import FEMBackend, FemConfig, ModuleSolver
from pliant.interfaces.material import Material, MaterialConfig
from pliant.pipeline.sampling import Sampled, Sampling, sample
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
        problem = built.problem(fem.refinement)
        solver = backend.solver(problem, substance)
        sampling = sample(solver, fem, fem.actuation_max(problem.actuation), partial, bench.progress)
        return as_data(built, problem, solver, sampling)

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


def as_data(
    family: ActuatorFamily, problem: ModuleProblem, solver: ModuleSolver, sampling: Sampling
) -> ModuleData:
    """Collect solved states as a table, with deformed shapes of the free branch for pictures."""
    states = [s.state for s in sampling.solved]

    def column(name: str) -> Array:
        return np.array([getattr(state, name) for state in states], dtype=float)

    return ModuleData(
        design=family.design,
        joint=problem.joint,
        axes=problem.axes,
        main_axis=problem.main_axis,
        actuation_name=problem.actuation,
        actuation=column("actuation"),
        deformation=column("deformation"),
        tau=column("tau"),
        dtau_dp=column("dtau_dp"),
        dtau_du=column("dtau_du"),
        energy_j=column("energy_j"),
        travel=column("travel"),
        iterations=column("iterations"),
        wall_s=column("wall_s"),
        explored=np.array([problem.main_axis for _ in states]),
        branch=np.array([state.branch for state in states]),
        status=np.array([state.status for state in states]),
        role=np.array([s.target.role for s in sampling.solved]),
        failed=sampling.failed,
        shapes=_shapes(problem, solver, sampling.solved),
    )


def _shapes(
    problem: ModuleProblem, solver: ModuleSolver, solved: tuple[Sampled, ...]
) -> tuple[ModuleShape, ...]:
    """The skin at rest and on the free branch."""
    free = [s.state for s in solved if s.target.branch == "free"]
    nodes, faces = np.unique(problem.mesh.skin, return_inverse=True)
    skin: IntArray = faces.reshape(problem.mesh.skin.shape).astype(np.int64)

    def shape(state: FemState) -> ModuleShape:
        return ModuleShape(state.actuation, state.angle_rad, solver.deformed_nodes(state)[nodes], skin)

    return tuple(shape(state) for state in free)
