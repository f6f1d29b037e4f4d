"""FEMBackend: solves modules."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, field_serializer, field_validator, model_validator

from pliant.errors import NotReachedError, UserError
from pliant.interfaces.base import ComponentConfig, Configured
from pliant.interfaces.input_levels import InputLevels
from pliant.interfaces.material import Material, require_regions
from pliant.interfaces.study_loads import StudyLoads
from pliant.records.actuation import Levels, kind_of, names_of
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleFields, ModuleProblem
from pliant.records.structure import StructureProblem, StructureState
from pliant.units import Angle, Force, Pressure, Ratio

# What a constrained state holds: u of the main axis, or u by axis.
Held = float | Mapping[str, float]
# Of the iteration for u under a prescribed effort: steps, and the last change of u as a share of the largest u met.
MOST_STEPS = 12
# Fields that bound an actuation, each with an example.
LIMITS = {"pressure_max_pa": "pressure_max: 15 kPa", "tendon_force_max_n": "tendon_force_max: 8 N"}
CLOSE = 1e-9
# States of a module of several axes that no study changes; how many more there are, the fields of `FemConfig` say.
LATERAL_FREE_LEVELS = 3  # of the free branch on the piece that moves about all axes, rest included
LATERAL_CHECKS = (
    2  # at most so many of `check_states` about each lateral axis, on the side that is not fitted
)


class FemConfig(ComponentConfig):
    """What every FEM backend's config holds: mesh refinement and which states to solve.

    The free branch is solved up to `pressure_max_pa`, or `tendon_force_max_n` for a family with a tendon; the
    constrained states cover angles from `angle_low` to `angle_high` times the largest free angle at every
    actuation, zero included. `sampling: adaptive` adds them one by one where a Gaussian process of all states
    and slopes is least certain, until the error that it states, and its last predictions, are below `error`;
    `grid` solves `angles` Chebyshev levels at each of `pressures` levels; `study` applies dead loads as the
    published study did. A module of several axes is then held at angles up to `lateral_angle` about each of
    the others, the main one following freely, and in `coupling_states` about all at once.
    """

    pressure_max_pa: Pressure | None = Field(
        default=None, gt=0, description="largest pressure of the data set, of every chamber"
    )
    tendon_force_max_n: Force | None = Field(
        default=None, gt=0, description="largest tendon force of the data set"
    )
    limits: InputLevels = Field(
        default_factory=dict,
        description="largest value of each input that has one of its own, e.g. {pressure_2_pa: 8 kPa}",
    )
    sampling: Literal["adaptive", "grid", "study"] = Field(
        default="adaptive",
        description="how the states are chosen; grid where `pressures` or `angles` are given and this is not",
    )
    error: Ratio = Field(
        default=2e-4, gt=0, lt=1, description="adaptive: wanted error of the effort / its range in the data"
    )
    max_states: int = Field(
        default=60,
        ge=8,
        le=512,
        description="adaptive: at most so many states to fit on the main axis; of a module of several actuations, "
        "at most so many held states to fit in all",
    )
    pressures: int = Field(default=6, ge=2, le=64, description="grid: pressure levels, 0 included")
    angles: int = Field(default=7, ge=3, le=64, description="grid: angles at each pressure level")
    study_loads: dict[str, StudyLoads] = Field(
        default_factory=dict, description="study: loads by axis where they are not the published ones"
    )
    lateral_angle_rad: Angle = Field(
        default=0.3,
        gt=0,
        le=1.5,
        description="several axes: largest angle about those that are not the main one",
    )
    lateral_states: int = Field(
        default=6,
        ge=2,
        le=128,
        description="several axes: at most so many states to fit about each of them, twice as many where its two "
        "sides are no mirror images",
    )
    coupling_states: int = Field(
        default=8, ge=0, le=512, description="several axes: states that hold all of them"
    )
    check_states: int = Field(default=8, ge=0, le=512, description="extra states that are never fitted")
    self_contact: Literal["solve", "end", "pass"] = Field(
        default="end",
        description="end: data and law end where convolutions touch; solve: walls that touch hold each other, without "
        "friction, and states beyond are data; pass: they go through each other, as in the published solver's data",
    )
    angle_low: Ratio = Field(default=-0.5, le=0, description="smallest angle / largest free angle")
    angle_high: Ratio = Field(default=1.2, ge=1, description="largest angle / largest free angle")
    refinement: int = Field(default=1, ge=1, le=4, description="multiplies the elements along each edge")
    seed: int = Field(default=0, ge=0, description="places the check states")

    @field_validator("self_contact", mode="before")
    @classmethod
    def _earlier_name(cls, value: Any) -> Any:
        return "end" if value == "stop" else value

    @field_serializer("self_contact")
    def _kept_name(self, value: str) -> str:
        """Stores name results by the config: what was solved under the earlier name is found."""
        return "stop" if value == "end" else value

    @model_validator(mode="before")
    @classmethod
    def _grid_if_levels(cls, values: Any) -> Any:
        """A block that gives levels and no strategy means the grid."""
        if isinstance(values, Mapping) and "sampling" not in values and {"pressures", "angles"} & set(values):
            return {**values, "sampling": "grid"}
        return values

    def canonical(self) -> dict[str, Any]:
        """Without limits where none are given, as keys of earlier data sets are."""
        return {name: value for name, value in super().canonical().items() if name != "limits" or value}

    def actuation_max(self, actuation: str) -> Levels:
        """Largest actuation of a module driven by `actuation`, SI; (m,) of several.

        Raises `UserError` where one is missing, and for a limit of what does not drive the module.
        """
        names = names_of(actuation)
        kinds = [kind_of(name) for name in names]
        found = []
        for name, kind in zip(names, kinds, strict=True):
            limit = self.limits.get(name, getattr(self, kind.limit) if kind.limit else None)
            if limit is None or limit <= 0:
                example = LIMITS.get(kind.limit, f"limits: {{{name}: ...}}")
                raise UserError(
                    f"fem: this family is driven by {actuation}; give the data's largest, '{example}'."
                )
            found.append(float(limit))
        for name in self.limits:
            if name not in names:
                raise UserError(
                    f"fem: 'limits' names {name}, and this family is driven by {actuation}: name one of these."
                )
        for field, example in LIMITS.items():
            if getattr(self, field) is not None and all(kind.limit != field for kind in kinds):
                key = example.split(":")[0]
                raise UserError(
                    f"fem: '{key}' has no effect, since this family is driven by {actuation}; remove it."
                )
        return found[0] if len(found) == 1 else np.array(found)


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
    def free(self, actuation: Levels, start: FemState) -> FemState:
        """Equilibrium without external moment. Raises `StateNotConvergedError`."""

    @abstractmethod
    def constrained(self, actuation: Levels, held: Held, start: FemState) -> FemState:
        """Equilibrium with some of the joint's coordinates held, rad (m for a prismatic joint).

        Args:
            actuation: Pa or N, (m,) where several drive the module.
            held: u by axis; axes that are not named are free, τ = 0. A number holds the main axis.
            start: a neighbouring state.

        Raises `StateNotConvergedError`, and `UserError` for an axis that the problem does not have.
        """

    def learn(self, state: FemState) -> None:
        """Told of each state that a sampling keeps, solved or found again, in the order of the sampling.

        A solver may use them to foretell the next ones. What it ends at must depend on nothing else: a sampling that
        was interrupted gives the same bits as one that was not.
        """
        del state

    def loaded(
        self, actuation: Levels, effort: Held, start: FemState, axes: Sequence[str] = ("y",)
    ) -> FemState:
        """Equilibrium under a dead external effort about one axis, N·m (N for a prismatic joint).

        By Newton's method on u with the exact slopes of `constrained`; a backend may know a shorter way.

        Args:
            actuation: Pa or N.
            effort: M by axis, positive where it opposes actuation; τ = M there and 0 on all other axes. A number
                acts on the main axis.
            start: a neighbouring state.
            axes: names of the joint's coordinates in their order.

        Raises `StateNotConvergedError`, and `UserError` for more than one axis.
        """
        named = effort if isinstance(effort, Mapping) else {axes[start.main]: effort}
        (axis, moment), *more = named.items()
        if more:
            raise UserError(f"one axis is loaded at a time, not {', '.join(named)}.")
        found = loaded_state(self.constrained, actuation, axis, moment, start, axes)
        if found is None:
            raise StateNotConvergedError(
                f"no equilibrium at {_named(actuation)} under {moment:.4g} about {axis} from the state at "
                f"{_named(start.actuation)}, {start.angle_rad:.4g}: the iteration for the angle did not converge."
            )
        return found

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


class FEMBackend(Configured[FemConfig]):
    """A finite-element code. The FEM stage calls `solver` once per piece of a design, after `check`.

    `knows` are the requirements (`ModuleProblem.requirements`) that it can solve; what it does not name is refused.
    "contact" is required by `fem.self_contact: solve`: states in which walls hold each other have the status
    "touching".
    """

    knows: ClassVar[frozenset[str]] = frozenset()

    def check(self, problem: ModuleProblem, material: Material) -> None:
        """Raise `UserError` for a requirement, contact too, that this backend lacks, or a region without a material."""
        unknown = sorted(problem.requirements - self.knows)
        if unknown:
            named = ", ".join(f"'{name}'" for name in unknown)
            known = ", ".join(sorted(self.knows)) or "none"
            raise UserError(
                f"fem '{self.config.kind}' does not know {named}, which this family's module requires; "
                f"it knows {known}."
            )
        if self.config.self_contact == "solve" and "contact" not in self.knows:
            raise UserError(
                f"fem '{self.config.kind}' does not solve contact, which 'self_contact: solve' asks for; use fem.kind "
                "'skfem', or 'self_contact: end'."
            )
        require_regions(problem.mesh.regions, material.regions)

    def checked_solver(self, problem: ModuleProblem, material: Material) -> ModuleSolver:
        """`solver`, where the backend knows all that the problem requires. Raises as `check` does."""
        self.check(problem, material)
        return self.solver(problem, material)

    @abstractmethod
    def solver(self, problem: ModuleProblem, material: Material) -> ModuleSolver:
        """A solver for this module; raises `UserError` for a problem it does not support."""

    def structure(self, problem: StructureProblem, material: Material) -> StructureSolver:
        """A solver for a whole body; raises `UserError` where the backend solves modules only."""
        raise UserError(
            f"fem '{self.config.kind}' solves single modules only, no bodies of several; use fem.kind 'skfem'."
        )


def loaded_state(
    constrained: Callable[[Levels, Mapping[str, float], FemState], FemState],
    actuation: Levels,
    axis: str,
    effort: float,
    start: FemState,
    axes: Sequence[str],
) -> FemState | None:
    """Newton's method on u of `axis`, all others free; None where it does not converge.

    Whatever `constrained` raises passes through. A step after one that made the residual larger is halved.
    """
    k = list(axes).index(axis)
    efforts = np.zeros(len(axes))
    efforts[k] = effort
    u = float(start.deformation[k] + _tangent(start, actuation, efforts)[k])
    state, size, before = start, abs(u), np.inf
    for _ in range(MOST_STEPS):
        state = constrained(actuation, {axis: u}, state)
        residual = effort - float(state.tau[k])
        step = float(_tangent(state, actuation, efforts)[k])
        size = max(size, abs(u), abs(step))
        if abs(step) <= CLOSE * size:
            return state
        if abs(residual) > before:
            step /= 2
        before = abs(residual)
        u += step
    return None


def _tangent(state: FemState, actuation: Levels, efforts: Array) -> Array:
    """(k,) change of u that the slopes ask for: τ + ∂τ/∂p Δp + ∂τ/∂u Δu = M, Δp (m,) of several."""
    rise = np.asarray(actuation) - state.actuation
    moved = state.dtau_dp * rise if rise.ndim == 0 else state.dtau_dp @ rise
    missing = efforts - state.tau - moved
    return np.asarray(np.linalg.solve(state.dtau_du, missing))


def _named(actuation: Levels) -> str:
    return ", ".join(f"{value:.6g}" for value in np.atleast_1d(actuation).tolist())
