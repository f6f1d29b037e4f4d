"""The shipped scikit-fem backend as the good one, and wrappers that falsify its states one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pliant.interfaces.fem import Held, ModuleSolver, StateNotConvergedError
from pliant.interfaces.material import Material
from pliant.records.design import Array
from pliant.records.fem import FemState, ModuleFields, ModuleProblem
from pliant_plugins.fem.skfem.backend import Skfem
from pliant_plugins.manifest import pliant_components
from spoiled import Spoils

MAIN_AXIS = {"moment_n_m": "tau", "dmoment_dp": "dtau_dp", "dmoment_du": "dtau_du"}


def altered(state: FemState, **changes: float) -> FemState:
    """The state with some of its main axis's values changed."""
    arrays = {
        MAIN_AXIS[name]: np.full_like(getattr(state, MAIN_AXIS[name]), v) for name, v in changes.items()
    }
    return replace(state, **arrays)


spoils = Spoils(next(c for c in pliant_components() if c.interface == "fem" and c.kind == "skfem"))


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


class Spoiled(Skfem):
    """A backend whose solvers are wrapped."""

    wrapper: type[Wrapped] = Wrapped

    def solver(self, problem: ModuleProblem, material: Material) -> ModuleSolver:
        return self.wrapper(super().solver(problem, material), problem)


class EnergyConstant(Wrapped):
    def seen(self, state: FemState) -> FemState:
        return replace(state, energy_j=state.energy_j + 1e-3)


@spoils.by("rest_state_is_zero", "energy_j of the rest state is not zero")
class RestHasEnergy(Spoiled):
    """An energy with a constant."""

    wrapper = EnergyConstant


class HalfStiffness(Wrapped):
    def seen(self, state: FemState) -> FemState:
        return altered(state, dmoment_du=state.dmoment_du / 2)


@spoils.by("small_bends_follow_beam_theory", "not −E I / l")
class PieceStiffness(Spoiled):
    """The stiffness of the half module."""

    wrapper = HalfStiffness


class NoThrust(Wrapped):
    def seen(self, state: FemState) -> FemState:
        return altered(state, dmoment_dp=0.6 * state.dmoment_dp)


@spoils.by("small_pressures_follow_beam_theory", "thrust on the end sections is missing")
class ForgetsTheCaps(Spoiled):
    """Too little actuation."""

    wrapper = NoThrust


class PieceMoment(Wrapped):
    def seen(self, state: FemState) -> FemState:
        return altered(state, moment_n_m=state.moment_n_m * 4.0 / self.problem.energy_scale)


@spoils.by("scales_with_the_module", "does not give twice the moment_n_m")
class IgnoresEnergyScale(Spoiled):
    """Right for quarters of a module only."""

    wrapper = PieceMoment


class EarlyFree(Wrapped):
    def free(self, actuation: float, start: FemState) -> FemState:
        return altered(super().free(actuation, start), moment_n_m=1e-4)


@spoils.by("free_state_has_no_moment", "free state's moment .* is not zero")
class StopsEarly(Spoiled):
    """A free branch that is not free."""

    wrapper = EarlyFree


class HalfAngle(Wrapped):
    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        return self.inner.constrained(actuation, held / self.problem.deformation_scale, start)


@spoils.by("constrained_state_holds_the_angle", "angle .* is not the one asked for")
class HoldsTheta(Spoiled):
    """Takes the module's angle for the piece's."""

    wrapper = HalfAngle


class OffsetMoment(Wrapped):
    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        state = super().constrained(actuation, held, start)
        return altered(state, moment_n_m=state.moment_n_m + 1e-9 * actuation)


@spoils.by("branches_agree", "the branches solve different equations")
class TwoEquations(Spoiled):
    """A constrained branch with a little more pressure."""

    wrapper = OffsetMoment


class Reversed(Wrapped):
    def seen(self, state: FemState) -> FemState:
        return altered(state, moment_n_m=-state.moment_n_m)


@spoils.by("moment_has_the_right_sign", "blocked at u = 0 under pressure, the moment is -")
class Reaction(Spoiled):
    """The reaction for the action."""

    wrapper = Reversed


class FrozenPressureSlope(Wrapped):
    def seen(self, state: FemState) -> FemState:
        return altered(state, dmoment_dp=self.inner.rest().dmoment_dp)


@spoils.by("slope_in_pressure_is_exact", "dmoment_dp .* differs from the finite difference")
class OldGain(Spoiled):
    """∂τ/∂p of the rest state everywhere."""

    wrapper = FrozenPressureSlope


class FrozenAngleSlope(Wrapped):
    def seen(self, state: FemState) -> FemState:
        return altered(state, dmoment_du=self.inner.rest().dmoment_du)


@spoils.by("slope_in_angle_is_exact", "dmoment_du .* differs from the finite difference")
class OldStiffness(Spoiled):
    """∂τ/∂u of the rest state everywhere."""

    wrapper = FrozenAngleSlope


class PieceEnergy(Wrapped):
    def seen(self, state: FemState) -> FemState:
        return replace(state, energy_j=state.energy_j / 4)


@spoils.by("energy_is_the_work_done", "energy and moment belong to different pieces")
class QuarterEnergy(Spoiled):
    """The energy of the solved quarter."""

    wrapper = PieceEnergy


class Remembers(Wrapped):
    def __init__(self, inner: ModuleSolver, problem: ModuleProblem) -> None:
        super().__init__(inner, problem)
        self.known: dict[float, FemState] = {}

    def seen(self, state: FemState) -> FemState:
        self.known[state.wall_s] = state
        return state

    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        return super().constrained(actuation, held, self.known[start.wall_s])


@spoils.by("continues_from_a_saved_state", "KeyError")
class KeepsItsOwn(Spoiled):
    """Only starts from states that it made itself."""

    wrapper = Remembers


class Lagging(Wrapped):
    def constrained(self, actuation: float, held: Held, start: FemState) -> FemState:
        state = super().constrained(actuation, held, start)
        return altered(state, moment_n_m=state.moment_n_m + 1e-4 * start.moment_n_m)


@spoils.by("path_does_not_matter", "depends on the start")
class NotConverged(Spoiled):
    """Keeps a trace of where it came from."""

    wrapper = Lagging


class Unturned(Wrapped):
    def deformed_nodes(self, state: FemState) -> Array:
        nodes = self.problem.mesh.nodes_m
        return nodes + np.array([0.0, 0.0, -0.1]) * nodes[:, :1] * state.angle_rad


@spoils.by("deformed_nodes_follow_the_bend", "end section is not a plane turned by")
class Sheared(Spoiled):
    """Pictures without rotation."""

    wrapper = Unturned


class Undisplaced(Wrapped):
    def fields(self, state: FemState) -> ModuleFields:
        fields = self.inner.fields(state)
        return replace(fields, displacement_m=self.inner.fields(self.inner.rest()).displacement_m)


@spoils.by("fields_stand_at_the_nodes", "is not that of `deformed_nodes`")
class FieldsOfTheReference(Spoiled):
    """Fields without the displacement."""

    wrapper = Undisplaced


class Careless(Wrapped):
    def free(self, actuation: float, start: FemState) -> FemState:
        try:
            return super().free(actuation, start)
        except StateNotConvergedError:
            return start


@spoils.by("says_when_it_does_not_converge", "far beyond any equilibrium gave a state")
class GivesTheLastState(Spoiled):
    """Hides that Newton failed."""

    wrapper = Careless


@spoils.by("refuses_unknown_problems", "was accepted")
class TakesAnything(Spoiled):
    """Never looks at the frame."""

    def solver(self, problem: ModuleProblem, material: Material) -> ModuleSolver:
        return super().solver(replace(problem, frame="rod"), material)
