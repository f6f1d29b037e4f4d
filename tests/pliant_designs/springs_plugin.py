"""A family and a finite-element code that cost nothing, as a plugin file: studies name it under `plugins`.

One joint with τ(p, u) = k p − c u − d u², k and c by the design's radius and length. Each solved state adds a line
to the file that the variable SPRINGS_LOG names. `defect` makes a design misbehave.
"""

import os
import signal
import time
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from pliant.errors import InvalidDesignError
from pliant.interfaces.family import ActuatorFamily, FamilyConfig
from pliant.interfaces.fem import FEMBackend, FemConfig, ModuleSolver, StateNotConvergedError
from pliant.records.design import MassProperties, ModuleMass
from pliant.records.fem import FemState, ModuleMesh, ModuleProblem
from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl
from pliant.units import Length

CONTRACT = 3

LOG = "SPRINGS_LOG"
Defect = Literal["none", "stuck", "some_states", "raises", "dies", "dies_once", "exits"]


class SpringsConfig(FamilyConfig):
    """Two lengths, and the defect of the design."""

    kind: Literal["springs"] = "springs"
    radius_m: Length = Field(gt=0, description="stiffness grows with it")
    length_m: Length = Field(gt=0, description="of the module")
    folds: int = Field(default=1, ge=1, description="softer with more")
    defect: Defect = Field(default="none", description="how it misbehaves")


class Springs(ActuatorFamily):
    """A cube of one cell, which is never meshed more finely."""

    config: SpringsConfig

    def __init__(self, config: SpringsConfig) -> None:
        super().__init__(config)
        short = config.radius_m - config.length_m
        if short > 0:
            raise InvalidDesignError(f"springs needs length ≥ radius, short by {1e3 * short:g} mm.")

    @property
    def module_length_m(self) -> float:
        return self.config.length_m

    def problem(self, refinement: int = 1, axes: tuple[str, ...] | None = None) -> ModuleProblem:
        line = np.array([0.0, 0.5, 1.0]) * self.config.length_m
        z, y, x = np.meshgrid(line, line, line, indexing="ij")
        nodes = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
        face = np.arange(9, dtype=np.int64)[None]
        ends = {"start": np.arange(0, 27, 3), "end": np.arange(2, 27, 3)}
        mesh = ModuleMesh(nodes, np.arange(27, dtype=np.int64)[None], face, face, ends)
        return SpringsProblem(
            mesh, self.config.length_m, 0.0, 1.0, 1.0, fixed={"start": (0,)}, config=self.config
        )

    def mass(self, density_kg_m3: float) -> ModuleMass:
        return ModuleMass(MassProperties.none(), MassProperties.none())


class SpringsProblem(ModuleProblem):
    """A problem that stores its design."""

    def __init__(self, *args, config: SpringsConfig, **kwargs) -> None:
        super().__init__(*args, **kwargs)
        object.__setattr__(self, "config", config)


class SpringsFemConfig(FemConfig):
    """The duration of a state."""

    kind: Literal["springs_fem"] = "springs_fem"
    delay_s: float = Field(default=0.0, ge=0, description="time of one state")


class SpringsFem(FEMBackend):
    """A backend that evaluates the formula."""

    def solver(self, problem: ModuleProblem, material) -> ModuleSolver:
        return SpringsSolver(problem, material, self.config.delay_s)


class SpringsSolver(ModuleSolver):
    """A solver of τ = k p − c u − d u²."""

    def __init__(self, problem, material, delay_s: float) -> None:
        self.problem, self.delay_s = problem, delay_s
        c = problem.config
        self.k = 2e-6 * (c.radius_m / 5e-3) ** 2
        self.c = 0.05 * (c.radius_m / 5e-3) ** 3 / c.folds * material.config.shear_modulus_pa / 240e3
        self.d = 0.02 * c.length_m / 0.01

    def rest(self) -> FemState:
        return self._state("rest", 0.0, 0.0, "free")

    def free(self, actuation: float, start: FemState) -> FemState:
        u = (-self.c + np.sqrt(self.c**2 + 4 * self.d * self.k * actuation)) / (2 * self.d)
        return self._state("free", actuation, float(u), "free")

    def constrained(self, actuation, held, start: FemState) -> FemState:
        u = held if isinstance(held, int | float) else held["y"]
        return self._state("held", actuation, float(u), "constrained")

    def deformed_nodes(self, state: FemState) -> np.ndarray:
        return np.asarray(self.problem.mesh.nodes_m)

    def _state(self, what: str, p: float, u: float, branch: str) -> FemState:
        name = self._name(what, p, u)
        log(f"begin {name}")
        time.sleep(self.delay_s)
        self._misbehave(p, branch)
        held = ("y",) if branch == "constrained" else ()
        state = FemState.from_one_axis(
            p,
            u,
            self.k * p - self.c * u - self.d * u * u if held else 0.0,
            self.k,
            -self.c - 2 * self.d * u,
            energy_j=self.c * u * u / 2 + self.d * u**3 / 3,
            travel=self.k * u,
            axial_strain=0.0,
            branch=branch,
            status="ok",
            iterations=1,
            wall_s=0.0,
            held=held,
            solution=np.array([p, u]),
        )
        log(f"end {name}")
        return state

    def _name(self, what: str, p: float, u: float) -> str:
        c = self.problem.config
        return f"{os.getpid()} {c.radius_m!r}/{c.length_m!r}/{c.folds}/{c.defect} {what}:{p!r}:{u!r}"

    def _misbehave(self, p: float, branch: str) -> None:
        defect = self.problem.config.defect
        if branch == "free" and p == 0:
            return
        if defect == "stuck":
            raise StateNotConvergedError("Newton stopped")
        if defect == "some_states" and branch == "constrained" and p > 5e3:
            raise StateNotConvergedError("Newton stopped")
        if defect == "raises":
            raise ZeroDivisionError("division by zero")
        if defect == "exits":
            raise SystemExit(7)
        if defect == "dies":
            os.kill(os.getpid(), signal.SIGKILL)
        marker = Path(os.environ.get(LOG, "/nonexistent") + ".died")
        if defect == "dies_once" and not marker.exists():
            marker.touch()
            os.kill(os.getpid(), signal.SIGKILL)


def log(line: str) -> None:
    """Append one whole line."""
    path = os.environ.get(LOG)
    if path:
        handle = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        os.write(handle, (line + "\n").encode())
        os.close(handle)


@hookimpl
def pliant_components() -> list[Component]:
    def component(interface: str, kind: str, config: str, implementation: str, example: dict) -> Component:
        return Component(
            interface, kind, f"{__name__}:{config}", f"{__name__}:{implementation}", "a toy", example
        )

    return [
        component("family", "springs", "SpringsConfig", "Springs", {"radius": "5 mm", "length": "9 mm"}),
        component("fem", "springs_fem", "SpringsFemConfig", "SpringsFem", {"pressure_max": "15 kPa"}),
    ]
