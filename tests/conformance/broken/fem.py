"""The shipped scikit-fem backend as the correct one, and wrappers that falsify its states one at a time."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import replace
from inspect import signature
from typing import Any

import numpy as np
from tests.conformance.broken import Variants

from pliant.interfaces.fem import Held, ModuleSolver, StateNotConvergedError
from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleFields, ModuleProblem
from pliant_plugins.fem.skfem.backend import Skfem
from pliant_plugins.manifest import pliant_components

MAIN_AXIS = {"moment_n_m": "tau", "dmoment_dp": "dtau_dp", "dmoment_du": "dtau_du"}


def altered(state: FemState, **changes: float) -> FemState:
    """Return the state with some values of its main axis changed."""
    arrays = {
        MAIN_AXIS[name]: np.full_like(getattr(state, MAIN_AXIS[name]), v) for name, v in changes.items()
    }
    return replace(state, **arrays)


KNOWN: dict[Any, Any] = {}


def known(problem: ModuleProblem, what: tuple[Any, ...], make: Callable[[], Any]) -> Any:
    """Return the correct backend's result for a problem of the suite, solved once for all broken backends."""
    key = (problem.energy_scale, *problem.requirements, problem.axes, problem.joint, problem.actuation, *what)
    if key not in KNOWN:
        KNOWN[key] = make()
    return KNOWN[key]


class Wrapped(ModuleSolver):
    """A solver that forwards all calls; `seen` may change each state."""

    def __init__(self, inner: ModuleSolver, problem: ModuleProblem) -> None:
        self.inner, self.problem = inner, problem

    def seen(self, state: FemState) -> FemState:
        return state

    def rest(self) -> FemState:
        return self.seen(known(self.problem, ("rest",), self.inner.rest))

    def free(self, actuation: float, start: FemState) -> FemState:
        return self.seen(self.inner.free(actuation, start))

    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        from_where = (actuation, str(held), start.actuation, start.deformation.tobytes())
        make = functools.partial(self.inner.constrained, actuation, held, start)
        return self.seen(known(self.problem, from_where, make))

    def deformed_nodes(self, state: FemState) -> Array:
        return self.inner.deformed_nodes(state)


class Falsified(Skfem):
    """A backend whose solvers are wrapped."""

    wrapper: type[Wrapped] = Wrapped

    def solver(self, problem: ModuleProblem, material: Material) -> ModuleSolver:
        make = functools.partial(super().solver, problem, material)
        return self.wrapper(known(problem, ("solver", problem.frame), make), problem)


variants = Variants(next(c for c in pliant_components() if c.interface == "fem" and c.kind == "skfem"))
broken = variants.row_adder(Falsified, "wrapper")


def seen(check: str, change: Any) -> None:
    """Add a row: every state is returned with these values; the function also gets the solver if it accepts it."""
    wants = len(signature(change).parameters)
    broken(check, seen=lambda up, self, state: change(*(self, state)[-wants:]))


def held(check: str, change: Any) -> None:
    """Add a row: a correct constrained state is changed, given actuation and start."""
    broken(
        check,
        constrained=lambda up, self, actuation, held, start: change(
            up(actuation, held, start), actuation, start
        ),
    )


def _known_only(up: Any, self: Any, actuation: float, held: Held, start: FemState) -> FemState:
    state: FemState = up(actuation, held, self.__dict__.setdefault("known", {})[start.wall_s])
    return state


def _remembered(up: Any, self: Any, state: FemState) -> FemState:
    self.__dict__.setdefault("known", {})[state.wall_s] = state
    return state


def _unturned(up: Any, self: Any, state: FemState) -> Array:
    nodes = self.problem.mesh.nodes_m
    return np.asarray(nodes + np.array([0.0, 0.0, -0.1]) * nodes[:, :1] * state.angle_rad)


def _undisplaced(up: Any, self: Any, state: FemState) -> ModuleFields:
    still = self.inner.fields(self.inner.rest()).displacement_m
    return replace(self.inner.fields(state), displacement_m=still)


def _careless(up: Any, self: Any, actuation: float, start: FemState) -> FemState:
    try:
        return up(actuation, start)  # type: ignore[no-any-return]
    except StateNotConvergedError:
        return start


def _stiff_in_twist(up: Any, self: Any) -> FemState:
    slope = up().dtau_du.copy()
    if len(slope) == 3:
        slope[0, 0] *= 1.5
    return replace(up(), dtau_du=slope)


def _lopsided(state: FemState) -> FemState:
    upper = np.triu(np.ones_like(state.dtau_du), 1)
    return replace(state, dtau_du=state.dtau_du + 1e-3 * np.abs(state.dtau_du).max() * upper)


def _coupled(state: FemState) -> FemState:
    k = len(state.tau)
    return replace(state, dtau_du=state.dtau_du - 5e-4 * (np.ones((k, k)) - np.eye(k)))


def _holding_all(up: Any, self: Any, actuation: float, held: Any, start: FemState) -> Any:
    here = dict(zip(self.problem.axes, start.deformation.tolist(), strict=True))
    return up(actuation, {**here, **held} if isinstance(held, Mapping) else held, start)


def _tolerant(up: Any, self: Any, actuation: float, held: Any, start: FemState) -> Any:
    if isinstance(held, Mapping):
        held = {axis: u for axis, u in held.items() if axis in self.problem.axes}
    return up(actuation, held, start)


def _plain(problem: ModuleProblem) -> ModuleProblem:
    return replace(problem, mesh=replace(problem.mesh, regions={}))


def _as_strain(solver: Wrapped, state: FemState) -> FemState:
    length = solver.problem.span_m if solver.problem.joint == "prismatic" else 1.0
    return replace(state, tau=state.tau * length, dtau_du=state.dtau_du * length**2)


seen("rest_state_is_zero", lambda s: replace(s, energy_j=s.energy_j + 1e-3))
seen("small_bends_follow_beam_theory", lambda s: altered(s, dmoment_du=s.dmoment_du / 2))
seen("small_pressures_follow_beam_theory", lambda s: altered(s, dmoment_dp=0.6 * s.dmoment_dp))
seen(
    "scales_with_the_module",
    lambda self, s: altered(s, moment_n_m=s.moment_n_m * 4.0 / self.problem.energy_scale),
)
broken(
    "free_state_has_no_moment",
    free=lambda up, self, actuation, start: altered(up(actuation, start), moment_n_m=1e-4),
)
broken(
    "constrained_state_holds_the_angle",
    constrained=lambda up, self, actuation, held, start: up(
        actuation, held / self.problem.deformation_scale, start
    ),
)
held(
    "branches_agree",
    lambda state, actuation, start: altered(state, moment_n_m=state.moment_n_m + 1e-9 * actuation),
)
seen("slope_in_angle_is_exact", lambda s: altered(s, moment_n_m=-s.moment_n_m))
for slope, check in (("dmoment_dp", "slope_in_pressure_is_exact"), ("dmoment_du", "slope_in_angle_is_exact")):
    seen(
        check,
        lambda self, s, slope=slope: altered(s, **{slope: getattr(self.inner.rest(), slope)}),
    )
seen("energy_is_the_work_done", lambda s: replace(s, energy_j=s.energy_j / 4))
broken("continues_from_a_saved_state", constrained=_known_only, seen=_remembered)
held(
    "path_does_not_matter",
    lambda state, actuation, start: altered(state, moment_n_m=state.moment_n_m + 1e-4 * start.moment_n_m),
)
broken("deformed_nodes_follow_the_bend", deformed_nodes=_unturned)
broken("fields_stand_at_the_nodes", fields=_undisplaced)
broken("says_when_it_does_not_converge", free=_careless)
variants.row_adder(Falsified)(
    "refuses_unknown_problems",
    solver=lambda up, self, problem, material: up(replace(problem, frame="rod"), material),
)
variants.row_adder(Falsified)(
    "refuses_unknown_problems",
    solver=lambda up, self, problem, material: up(replace(problem, requires=frozenset()), material),
)
variants.row_adder(Falsified)(
    "regions_have_their_own_material",
    solver=lambda up, self, problem, material: up(_plain(problem), material.with_regions({})),
)
seen("states_have_all_axes", lambda s: replace(s, tau=s.tau[[s.main]]))
broken("small_bends_about_all_axes_follow_beam_theory", rest=_stiff_in_twist)
seen("slopes_in_all_axes_are_exact", _lopsided)
seen("axes_decouple_by_symmetry", _coupled)
broken("axes_that_are_not_held_are_free", constrained=_holding_all)
broken("refuses_unknown_axes", constrained=_tolerant)
seen("small_extensions_follow_rod_theory", _as_strain)
seen("tendon_works_on_its_travel", lambda s: replace(s, travel=s.travel / 2))
