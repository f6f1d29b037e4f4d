"""The shipped scikit-fem backend as the good one, and wrappers that falsify its states one by one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from broken import Variants
from pliant.interfaces.fem import Held, ModuleSolver, StateNotConvergedError
from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleFields, ModuleProblem
from pliant_plugins.fem.skfem.backend import Skfem
from pliant_plugins.manifest import pliant_components

MAIN_AXIS = {"moment_n_m": "tau", "dmoment_dp": "dtau_dp", "dmoment_du": "dtau_du"}


def altered(state: FemState, **changes: float) -> FemState:
    """The state with some of its main axis's values changed."""
    arrays = {
        MAIN_AXIS[name]: np.full_like(getattr(state, MAIN_AXIS[name]), v) for name, v in changes.items()
    }
    return replace(state, **arrays)


variants = Variants(next(c for c in pliant_components() if c.interface == "fem" and c.kind == "skfem"))


class Wrapped(ModuleSolver):
    """Passes everything on; `seen` may change each state."""

    def __init__(self, inner: ModuleSolver, problem: ModuleProblem) -> None:
        self.inner, self.problem = inner, problem

    def seen(self, state: FemState) -> FemState:
        return state

    def rest(self) -> FemState:
        return self.seen(self.inner.rest())

    def free(self, actuation: float, start: FemState) -> FemState:
        return self.seen(self.inner.free(actuation, start))

    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        return self.seen(self.inner.constrained(actuation, held, start))

    def deformed_nodes(self, state: FemState) -> Array:
        return self.inner.deformed_nodes(state)


class Falsified(Skfem):
    """A backend whose solvers are wrapped."""

    wrapper: type[Wrapped] = Wrapped

    def solver(self, problem: ModuleProblem, material: Material) -> ModuleSolver:
        return self.wrapper(super().solver(problem, material), problem)


broken_by = variants.by_part(Falsified, "wrapper")


@broken_by("rest_state_is_zero", "energy_j of the rest state is not zero")
class EnergyConstant(Wrapped):
    """An energy with a constant."""

    def seen(self, state: FemState) -> FemState:
        return replace(state, energy_j=state.energy_j + 1e-3)


@broken_by("small_bends_follow_beam_theory", "not −E I / l")
class HalfStiffness(Wrapped):
    """The stiffness of the half module."""

    def seen(self, state: FemState) -> FemState:
        return altered(state, dmoment_du=state.dmoment_du / 2)


@broken_by("small_pressures_follow_beam_theory", "thrust on the end sections is missing")
class NoThrust(Wrapped):
    """Too little actuation."""

    def seen(self, state: FemState) -> FemState:
        return altered(state, dmoment_dp=0.6 * state.dmoment_dp)


@broken_by("scales_with_the_module", "does not give twice the moment_n_m")
class PieceMoment(Wrapped):
    """Right for quarters of a module only."""

    def seen(self, state: FemState) -> FemState:
        return altered(state, moment_n_m=state.moment_n_m * 4.0 / self.problem.energy_scale)


@broken_by("free_state_has_no_moment", "free state's moment .* is not zero")
class EarlyFree(Wrapped):
    """A free branch that is not free."""

    def free(self, actuation: float, start: FemState) -> FemState:
        return altered(super().free(actuation, start), moment_n_m=1e-4)


@broken_by("constrained_state_holds_the_angle", "angle .* is not the one asked for")
class HalfAngle(Wrapped):
    """Takes the module's angle for the piece's."""

    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        return self.inner.constrained(actuation, held / self.problem.deformation_scale, start)


@broken_by("branches_agree", "the branches solve different equations")
class OffsetMoment(Wrapped):
    """A constrained branch with a little more pressure."""

    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        state = super().constrained(actuation, held, start)
        return altered(state, moment_n_m=state.moment_n_m + 1e-9 * actuation)


@broken_by("moment_has_the_right_sign", "blocked at u = 0 under pressure, the moment is -")
class Reversed(Wrapped):
    """The reaction for the action."""

    def seen(self, state: FemState) -> FemState:
        return altered(state, moment_n_m=-state.moment_n_m)


@broken_by("slope_in_pressure_is_exact", "dmoment_dp .* differs from the finite difference")
class FrozenPressureSlope(Wrapped):
    """∂τ/∂p of the rest state everywhere."""

    def seen(self, state: FemState) -> FemState:
        return altered(state, dmoment_dp=self.inner.rest().dmoment_dp)


@broken_by("slope_in_angle_is_exact", "dmoment_du .* differs from the finite difference")
class FrozenAngleSlope(Wrapped):
    """∂τ/∂u of the rest state everywhere."""

    def seen(self, state: FemState) -> FemState:
        return altered(state, dmoment_du=self.inner.rest().dmoment_du)


@broken_by("energy_is_the_work_done", "energy and moment belong to different pieces")
class PieceEnergy(Wrapped):
    """The energy of the solved quarter."""

    def seen(self, state: FemState) -> FemState:
        return replace(state, energy_j=state.energy_j / 4)


@broken_by("continues_from_a_saved_state", "KeyError")
class Remembers(Wrapped):
    """Only starts from states that it made itself."""

    def __init__(self, inner: ModuleSolver, problem: ModuleProblem) -> None:
        super().__init__(inner, problem)
        self.known: dict[float, FemState] = {}

    def seen(self, state: FemState) -> FemState:
        self.known[state.wall_s] = state
        return state

    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        return super().constrained(actuation, held, self.known[start.wall_s])


@broken_by("path_does_not_matter", "depends on the start")
class Lagging(Wrapped):
    """Keeps a trace of where it came from."""

    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        state = super().constrained(actuation, held, start)
        return altered(state, moment_n_m=state.moment_n_m + 1e-4 * start.moment_n_m)


@broken_by("deformed_nodes_follow_the_bend", "end section is not a plane turned by")
class Unturned(Wrapped):
    """Pictures without rotation."""

    def deformed_nodes(self, state: FemState) -> Array:
        nodes = self.problem.mesh.nodes_m
        return nodes + np.array([0.0, 0.0, -0.1]) * nodes[:, :1] * state.angle_rad


@broken_by("fields_stand_at_the_nodes", "is not that of `deformed_nodes`")
class Undisplaced(Wrapped):
    """Fields without the displacement."""

    def fields(self, state: FemState) -> ModuleFields:
        fields = self.inner.fields(state)
        return replace(fields, displacement_m=self.inner.fields(self.inner.rest()).displacement_m)


@broken_by("says_when_it_does_not_converge", "far beyond any equilibrium gave a state")
class Careless(Wrapped):
    """Hides that Newton failed."""

    def free(self, actuation: float, start: FemState) -> FemState:
        try:
            return super().free(actuation, start)
        except StateNotConvergedError:
            return start


@variants.by("refuses_unknown_problems", "was accepted")
class TakesAnything(Falsified):
    """Never looks at the frame."""

    def solver(self, problem: ModuleProblem, material: Material) -> ModuleSolver:
        return super().solver(replace(problem, frame="rod"), material)


# -- backends whose states of several axes, extensions or tendons are falsified one by one


@broken_by("states_have_all_axes", "tau has shape \\(1,\\)")
class MainAxisOnly(Wrapped):
    """Reports the main axis's effort alone."""

    def seen(self, state: FemState) -> FemState:
        return replace(state, tau=state.tau[[state.main]])


@broken_by("small_bends_about_all_axes_follow_beam_theory", "stiffness in twist")
class PolarMoment(Wrapped):
    """A tube twice as stiff in twist as any warping allows."""

    def rest(self) -> FemState:
        state = self.inner.rest()
        slope = state.dtau_du.copy()
        if len(slope) == 3:
            slope[0, 0] *= 1.5
        return replace(state, dtau_du=slope)


@broken_by("slopes_in_all_axes_are_exact", "is not symmetric under pressure")
class Lopsided(Wrapped):
    """Moments that are not conjugate to the rotation vector."""

    def seen(self, state: FemState) -> FemState:
        upper = np.triu(np.ones_like(state.dtau_du), 1)
        return replace(state, dtau_du=state.dtau_du + 1e-3 * np.abs(state.dtau_du).max() * upper)


@broken_by("axes_decouple_by_symmetry", "couples axes that symmetry separates")
class Coupled(Wrapped):
    """What plane end sections of a whole module would do."""

    def seen(self, state: FemState) -> FemState:
        k = len(state.tau)
        return replace(state, dtau_du=state.dtau_du - 5e-4 * (np.ones((k, k)) - np.eye(k)))


@broken_by("axes_that_are_not_held_are_free", "not zero along the axis that is free")
class HoldsAll(Wrapped):
    """Leaves free axes where they were."""

    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        if isinstance(held, Mapping):
            here = dict(zip(self.problem.axes, start.deformation.tolist(), strict=True))
            held = {**here, **held}
        return super().constrained(actuation, held, start)


@broken_by("refuses_unknown_axes", "the axis 'w' was held")
class Tolerant(Wrapped):
    """Leaves out what it does not know."""

    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        if isinstance(held, Mapping):
            held = {axis: u for axis, u in held.items() if axis in self.problem.axes}
        return super().constrained(actuation, held, start)


@broken_by("small_extensions_follow_rod_theory", "is not −E A / l")
class Strain(Wrapped):
    """The strain as a prismatic joint's coordinate."""

    def seen(self, state: FemState) -> FemState:
        if self.problem.joint != "prismatic":
            return state
        length = self.problem.span_m
        return replace(state, tau=state.tau * length, dtau_du=state.dtau_du * length**2)


@broken_by("tendon_works_on_its_travel", "belong to different pieces")
class HalfTravel(Wrapped):
    """The tendon drawn out of one half."""

    def seen(self, state: FemState) -> FemState:
        return replace(state, travel=state.travel / 2)
