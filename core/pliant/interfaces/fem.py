"""FEMBackend: solves one module."""

from __future__ import annotations

from abc import ABC, abstractmethod

from pydantic import Field

from pliant.errors import NotReachedError
from pliant.interfaces.base import ComponentConfig
from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleProblem
from pliant.units import Pressure, Ratio


class FemConfig(ComponentConfig):
    """What every FEM backend's config holds: mesh refinement and which states to solve.

    The free branch is solved up to `pressure_max_pa`; the constrained states cover angles from
    `angle_low` to `angle_high` times the largest free angle at every pressure, zero included.
    """

    pressure_max_pa: Pressure = Field(gt=0, description="largest pressure of the data set")
    pressures: int = Field(default=6, ge=2, le=64, description="pressure levels, 0 included")
    angles: int = Field(default=7, ge=3, le=64, description="angles at each pressure level")
    check_states: int = Field(default=8, ge=0, le=512, description="extra states that are never fitted")
    angle_low: Ratio = Field(default=-0.5, le=0, description="smallest angle / largest free angle")
    angle_high: Ratio = Field(default=1.2, ge=1, description="largest angle / largest free angle")
    refinement: int = Field(default=1, ge=1, le=4, description="multiplies the elements along each edge")
    seed: int = Field(default=0, ge=0, description="places the check states")


class StateNotConvergedError(NotReachedError):
    """Newton did not reach equilibrium at a state; the pipeline records it and goes on."""


class ModuleSolver(ABC):
    """Solves states of one `ModuleProblem`, each from a neighbouring one.

    The sampling stage calls `rest` once, then `free` and `constrained` in an order in which each start is
    close to its target; the solver subdivides a step that does not converge. States are self-contained: a
    solver must be able to start from a state that another process saved.
    """

    @abstractmethod
    def rest(self) -> FemState:
        """The undeformed state: no actuation, angle 0 (slopes included)."""

    @abstractmethod
    def free(self, actuation: float, start: FemState) -> FemState:
        """Equilibrium without external moment. Raises `StateNotConvergedError`."""

    @abstractmethod
    def constrained(self, actuation: float, angle_rad: float, start: FemState) -> FemState:
        """Equilibrium with the module angle held; its moment is τ(p, u). Raises `StateNotConvergedError`."""

    @abstractmethod
    def deformed_nodes(self, state: FemState) -> Array:
        """(n, 3) positions of the mesh's nodes in the module frame; the start section stays at rest."""


class FEMBackend(ABC):
    """A finite-element code. The FEM stage calls `solver` once per design."""

    def __init__(self, config: FemConfig) -> None:
        self.config = config

    @abstractmethod
    def solver(self, problem: ModuleProblem, material: Material) -> ModuleSolver:
        """A solver for this module; raises `UserError` for a problem it does not support."""
