"""Byte code and machine code that many tests run, compiled before they start: else each of their workers compiles it.

    python -m tests.compile_first

Two processes share the work. What is compiled already is not compiled again.
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
from pliant.testing.samples import coupled_law, module_table_of, sample_chain, softening_law, table_of

ROOT = Path(__file__).parents[1]
PRESSURES = {"pressure_pa": np.array([1e3, 2e3])}


def built(interface: str, kind: str, **settings: Any) -> Any:
    component = discover().get(interface, kind)
    return component.build(component.config_model()(kind=kind, **settings))


def bent_chain() -> ChainModel:
    """With the law that most studies have."""
    return sample_chain(built("surrogate", "polynomial").fit(table_of(softening_law())).law, modules=2)


def settled() -> None:
    """Equilibria of chains, and the law of coupled axes."""
    engine: PhysicsBackend = built("physics", "quasistatic")
    with engine.build(bent_chain()) as simulation:
        simulation.settle()
    data = module_table_of(coupled_law())
    built("surrogate", "polynomial").fit_module(data).law.evaluate(data.actuation, data.deformation)


def followed() -> None:
    """Paths of hinges in the quasi-static engine."""
    built("physics", "quasistatic").follow(bent_chain(), [History.of(PRESSURES)])


def followed_in_space() -> None:
    """Paths of all other joints."""
    law = built("surrogate", "polynomial").fit_module(module_table_of(coupled_law())).law
    built("physics", "quasistatic").follow(sample_chain(law, modules=2), [History.of(PRESSURES)])


def moved() -> None:
    """MuJoCo driven by a law, where it is installed."""
    if discover().get("physics", "mujoco").missing() is None:
        built("physics", "mujoco").follow(bent_chain(), [History.of(PRESSURES, np.array([0.0, 0.01]))])


def solved() -> None:
    """A state of the FEM's small box, where scikit-fem is installed."""
    if discover().get("fem", "skfem").missing() is None:
        rubber = {"kind": "neo_hookean", "shear_modulus_pa": 1e5, "poisson_ratio": 0.49}
        solver = built("fem", "skfem", pressure_max_pa=1e3).solver(box_problem(), built("material", **rubber))
        solver.free(1e3, solver.rest())


def byte_code() -> None:
    """Modules outside the tests, which pytest compiles in its own way."""
    for folder in ("core", "plugins", "benchmarks"):
        compileall.compile_dir(ROOT / folder, quiet=1)


if __name__ == "__main__":
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        for done in [
            pool.submit(job) for job in (solved, byte_code, settled, followed, followed_in_space, moved)
        ]:
            done.result()
