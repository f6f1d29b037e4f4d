"""Compile the byte code and machine code that many tests run before they start; otherwise every worker compiles it.

    python -m tests.compile_first

Two processes share the work. Code that is already compiled is not compiled again.
"""

from __future__ import annotations

import compileall
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from pliant.interfaces.physics import PhysicsBackend
from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.registry.discovery import discover
from pliant.testing.box import box_problem
from pliant.testing.samples import coupled_law, sample_chain, sample_module_table, sample_table, softening_law

ROOT = Path(__file__).parents[1]
PRESSURES = {"pressure_pa": np.array([1e3, 2e3])}


def built(interface: str, kind: str, **settings: Any) -> Any:
    component = discover().get(interface, kind)
    return component.build(component.config_model()(kind=kind, **settings))


def bent_chain() -> ChainModel:
    """Return a chain with the law that most studies have."""
    return sample_chain(built("surrogate", "polynomial").fit(sample_table(softening_law())).law, modules=2)


def settled() -> None:
    """Compile equilibria of chains and the law of coupled axes."""
    engine: PhysicsBackend = built("physics", "quasistatic")
    with engine.build(bent_chain()) as simulation:
        simulation.settle()
    data = sample_module_table(coupled_law())
    built("surrogate", "polynomial").fit_module(data).law.evaluate(data.actuation, data.deformation)


def followed() -> None:
    """Compile paths of hinges in the quasi-static engine."""
    built("physics", "quasistatic").follow(bent_chain(), [History.from_arrays(PRESSURES)])


def followed_in_space() -> None:
    """Compile paths of all other joints."""
    law = built("surrogate", "polynomial").fit_module(sample_module_table(coupled_law())).law
    built("physics", "quasistatic").follow(sample_chain(law, modules=2), [History.from_arrays(PRESSURES)])


def moved() -> None:
    """Compile MuJoCo driven by a law, where it is installed."""
    if discover().get("physics", "mujoco").missing() is None:
        built("physics", "mujoco").follow(
            bent_chain(), [History.from_arrays(PRESSURES, np.array([0.0, 0.01]))]
        )


def solved() -> None:
    """Compile a state of the FEM's small box, where scikit-fem is installed."""
    if discover().get("fem", "skfem").missing() is None:
        rubber = {"kind": "neo_hookean", "shear_modulus_pa": 1e5, "poisson_ratio": 0.49}
        solver = built("fem", "skfem", pressure_max_pa=1e3).solver(box_problem(), built("material", **rubber))
        solver.free(1e3, solver.rest())


def byte_code() -> None:
    """Compile modules outside the tests, which pytest compiles in a different way."""
    for folder in ("core", "plugins", "benchmarks"):
        compileall.compile_dir(ROOT / folder, quiet=1)


if __name__ == "__main__":
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        for done in [
            pool.submit(job) for job in (solved, byte_code, settled, followed, followed_in_space, moved)
        ]:
            done.result()
