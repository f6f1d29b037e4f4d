"""FEMBackend: solves modules."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping

from pydantic import Field

from pliant.errors import NotReachedError, UserError
from pliant.interfaces.base import ComponentConfig
from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleFields, ModuleProblem
from pliant.records.structure import StructureProblem, StructureState
from pliant.units import Force, Pressure, Ratio

# What a constrained state holds: u of the main axis, or u by axis.
Held = float | Mapping[str, float]


class FemConfig(ComponentConfig):
    """What every FEM backend's config holds: mesh refinement and which states to solve.

    The free branch is solved up to `pressure_max_pa`, or `tendon_force_max_n` for a family with a tendon; the
    constrained states cover angles from `angle_low` to `angle_high` times the largest free angle at every
    actuation, zero included.
    """

    pressure_max_pa: Pressure | None = Field(
        default=None, gt=0, description="largest pressure of the data set"
    )
    tendon_force_max_n: Force | None = Field(
        default=None, gt=0, description="largest tendon force of the data set"
    )
    pressures: int = Field(default=6, ge=2, le=64, description="pressure levels, 0 included")
    angles: int = Field(default=7, ge=3, le=64, description="angles at each pressure level")
    check_states: int = Field(default=8, ge=0, le=512, description="extra states that are never fitted")
    angle_low: Ratio = Field(default=-0.5, le=0, description="smallest angle / largest free angle")
    angle_high: Ratio = Field(default=1.2, ge=1, description="largest angle / largest free angle")
    refinement: int = Field(default=1, ge=1, le=4, description="multiplies the elements along each edge")
    seed: int = Field(default=0, ge=0, description="places the check states")

    def actuation_max(self, actuation: str) -> float:
        """Largest actuation of a module driven by `actuation`, SI. Raises `UserError` where only the other is given."""
        limits = {"pressure_pa": self.pressure_max_pa, "tendon_force_n": self.tendon_force_max_n}
        keys = {"pressure_pa": "pressure_max: 15 kPa", "tendon_force_n": "tendon_force_max: 8 N"}
        limit = limits[actuation]
        if limit is None:
            raise UserError(
                f"fem: this family is driven by {actuation}; give the data's largest, '{keys[actuation]}'."
            )
        return limit


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
    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        """Equilibrium with some of the joint's coordinates held, rad (m for a prismatic joint).

        Args:
            actuation: Pa or N.
            held: u by axis; axes that are not named are free, τ = 0. A number holds the main axis.
            start: a neighbouring state.

        Raises `StateNotConvergedError`, and `UserError` for an axis that the problem does not have.
        """

    @abstractmethod
    def deformed_nodes(self, state: FemState) -> Array:
        """(n, 3) positions of the mesh's nodes in the module frame; the start section stays at rest."""

    def fields(self, state: FemState) -> ModuleFields:
        """Displacement and stress at the mesh's nodes. Raises `UserError` where the backend has none to give."""
        raise UserError(f"{type(self).__name__} gives no fields; solve with fem.kind 'skfem' to see them.")


class StructureSolver(ABC):
    """Equilibria of a whole body, each from a neighbouring one; the clamped body at rest comes first."""

    @abstractmethod
    def rest(self) -> StructureState:
        """No pressure, no force."""

    @abstractmethod
    def equilibrium(self, pressure_pa: float, tip_force_n: Array, start: StructureState) -> StructureState:
        """Under pressure and a dead force (3,) at the tip, in the body's frame. Raises `StateNotConvergedError`."""

    @abstractmethod
    def deformed_nodes(self, state: StructureState) -> Array:
        """(n, 3) positions of the mesh's nodes."""


class FEMBackend(ABC):
    """A finite-element code. The FEM stage calls `solver` once per design."""

    def __init__(self, config: FemConfig) -> None:
        self.config = config

    @abstractmethod
    def solver(self, problem: ModuleProblem, material: Material) -> ModuleSolver:
        """A solver for this module; raises `UserError` for a problem it does not support."""

    def structure(self, problem: StructureProblem, material: Material) -> StructureSolver:
        """A solver for a whole body; raises `UserError` where the backend solves modules only."""
        raise UserError(
            f"fem '{self.config.kind}' solves single modules only, no bodies of several; use fem.kind 'skfem'."
        )
