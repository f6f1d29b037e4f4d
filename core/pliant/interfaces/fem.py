"""FEMBackend: a finite-element code that solves modules."""

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
from pliant.records.actuation import Levels, actuation_kind, split_actuation_names
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleFields, ModuleProblem
from pliant.records.structure import StructureProblem, StructureState
from pliant.units import Angle, Force, Pressure, Ratio

# The prescribed u of a constrained state: of the main axis, or by axis.
Held = float | Mapping[str, float]
# Iteration for u under a prescribed effort: steps, and tolerance of u relative to the largest u of the iteration.
MOST_STEPS = 12
# Fields that bound an actuation, each with an example.
LIMITS = {"pressure_max_pa": "pressure_max: 15 kPa", "tendon_force_max_n": "tendon_force_max: 8 N"}
CLOSE = 1e-9
# Numbers of states of a module of several axes that are not configurable; the others are fields of `FemConfig`.
LATERAL_FREE_LEVELS = 3  # of the free branch on the piece that moves about all axes, including rest
LATERAL_CHECKS = 2  # largest number of `check_states` about each lateral axis, on the side that is not fitted


class FemConfig(ComponentConfig):
    """Base of an FEM backend's config: mesh refinement and which states to solve.

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
        default=2e-4, gt=0, lt=1, description="adaptive: required error of the effort / its range in the data"
    )
    max_states: int = Field(
        default=60,
        ge=8,
        le=512,
        description="adaptive: largest number of states to fit on the main axis; of a module of several actuations, "
        "largest number of held states to fit in all",
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
        description="several axes: largest number of states to fit about each of them, twice as many if its two "
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
        """Keep the earlier name in the config, which keys stored results, so that they are found."""
        return "stop" if value == "end" else value

    @model_validator(mode="before")
    @classmethod
    def _grid_if_levels(cls, values: Any) -> Any:
        """Select the grid for a block with levels and no strategy."""
        if isinstance(values, Mapping) and "sampling" not in values and {"pressures", "angles"} & set(values):
            return {**values, "sampling": "grid"}
        return values

    def canonical(self) -> dict[str, Any]:
        """Return the config without limits that are not given, as in the keys of earlier data sets."""
        return {name: value for name, value in super().canonical().items() if name != "limits" or value}

    def actuation_max(self, actuation: str) -> Levels:
        """Return the largest actuation of a module driven by `actuation`, SI; (m,) for several.

        Raises `UserError` for a missing limit, and for a limit of an input that the module does not have.
        """
        names = split_actuation_names(actuation)
        kinds = [actuation_kind(name) for name in names]
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
    """Error of Newton's method that does not reach equilibrium at a state; the pipeline records it and continues."""


class ModuleSolver(ABC):
    """Solver for states of one `ModuleProblem`, each from a neighbouring state.

    The sampling stage calls `rest` once, then `free` and `constrained` in an order in which each start is
    close to its target; the solver subdivides a step that does not converge. States are self-contained: a
    solver must be able to start from a state that another process saved.
    """

    @abstractmethod
    def rest(self) -> FemState:
        """Return the undeformed state: no actuation, angle 0 (slopes included)."""

    @abstractmethod
    def free(self, actuation: Levels, start: FemState) -> FemState:
        """Return the equilibrium without external moment. Raises `StateNotConvergedError`."""

    @abstractmethod
    def constrained(self, actuation: Levels, held: Held, start: FemState) -> FemState:
        """Return the equilibrium with some of the joint's coordinates prescribed, rad (m for a prismatic joint).

        Args:
            actuation: Pa or N, (m,) for several.
            held: prescribed u by axis; axes that are not named are free, τ = 0. A number is that of the main axis.
            start: a neighbouring state.

        Raises `StateNotConvergedError`, and `UserError` for an axis that the problem does not have.
        """

    def learn(self, state: FemState) -> None:
        """Use a state that a sampling keeps, solved or loaded; called in the order of the sampling.

        A solver may use these states to predict the next ones. Its results must depend on nothing else, so that an
        interrupted sampling gives the same bits as an uninterrupted one.
        """
        del state

    def loaded(
        self, actuation: Levels, effort: Held, start: FemState, axes: Sequence[str] = ("y",)
    ) -> FemState:
        """Return the equilibrium under a dead external effort about one axis, N·m (N for a prismatic joint).

        The default is Newton's method on u with the exact slopes of `constrained`; a backend may override it.

        Args:
            actuation: Pa or N.
            effort: M by axis, positive if it opposes actuation; τ = M there and 0 on all other axes. A number
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
        """Return (n, 3) positions of the mesh's nodes in the module frame; the start section stays at rest."""

    def fields(self, state: FemState) -> ModuleFields:
        """Return displacement and stress at the mesh's nodes. Raises `UserError` if the backend provides no fields."""
        raise UserError(f"{type(self).__name__} gives no fields; solve with fem.kind 'skfem' to see them.")


class StructureSolver(ABC):
    """Solver for equilibria of a whole body, each from a neighbouring one, starting with the clamped body at rest."""

    @abstractmethod
    def rest(self) -> StructureState:
        """Return the state without pressure and force."""

    @abstractmethod
    def equilibrium(self, pressure_pa: float, tip_force_n: Array, start: StructureState) -> StructureState:
        """Return the state under pressure and a dead tip force (3,), body frame. Raises `StateNotConvergedError`."""

    @abstractmethod
    def deformed_nodes(self, state: StructureState) -> Array:
        """Return (n, 3) positions of the mesh's nodes."""


class FEMBackend(Configured[FemConfig]):
    """A finite-element code. The FEM stage calls `solver` once per piece of a design, after `check`.

    `knows` are the requirements (`ModuleProblem.requirements`) that it supports; others are refused. "contact" is
    required by `fem.self_contact: solve`: states in which walls are in contact have the status "touching". A backend
    for a special class of problems names it as `problem_class`; others are refused.
    """

    knows: ClassVar[frozenset[str]] = frozenset()
    problem_class: ClassVar[type[ModuleProblem]] = ModuleProblem

    def check(self, problem: ModuleProblem, material: Material) -> None:
        """Raise `UserError` for a requirement (also contact) that this backend lacks, or a region without material."""
        if not isinstance(problem, self.problem_class):
            raise UserError(
                f"fem '{self.config.kind}' solves problems of class {self.problem_class.__name__} alone, and this "
                f"family's is a {type(problem).__name__}."
            )
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
                f"fem '{self.config.kind}' does not solve contact, which 'self_contact: solve' requires; use fem.kind "
                "'skfem', or 'self_contact: end'."
            )
        require_regions(problem.mesh.regions, material.regions)

    def checked_solver(self, problem: ModuleProblem, material: Material) -> ModuleSolver:
        """Return `solver` after `check`, with the same errors."""
        self.check(problem, material)
        return self.solver(problem, material)

    @abstractmethod
    def solver(self, problem: ModuleProblem, material: Material) -> ModuleSolver:
        """Return a solver for this module; raise `UserError` for a problem that is not supported."""

    def structure(self, problem: StructureProblem, material: Material) -> StructureSolver:
        """Return a solver for a whole body; raise `UserError` if the backend solves only modules."""
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
    """Solve for u of `axis` by Newton's method, all others free; return None if it does not converge.

    Exceptions of `constrained` are not caught. After an increase of the residual the step is halved.
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
    """Return (k,) Newton step of u: τ + ∂τ/∂p Δp + ∂τ/∂u Δu = M, Δp (m,) for several."""
    rise = np.asarray(actuation) - state.actuation
    moved = state.dtau_dp * rise if rise.ndim == 0 else state.dtau_dp @ rise
    missing = efforts - state.tau - moved
    return np.asarray(np.linalg.solve(state.dtau_du, missing))


def _named(actuation: Levels) -> str:
    return ", ".join(f"{value:.6g}" for value in np.atleast_1d(actuation).tolist())
