"""The stand-in engine as the good one, and engines with one wrong convention each."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from broken import Variants
from pliant.interfaces.physics import Capabilities, SimulationState
from pliant.mechanics.rotations import left_jacobian
from pliant.records.chain import ChainModel, default_base_rotation
from pliant.records.design import Array
from pliant.records.history import Followed, History
from pliant.records.rollout import Equilibrium, Inputs
from pliant.registry.component import Component
from pliant.testing.stand_ins import StandIn, StandInConfig, StandInSimulation
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig


class EngineConfig(StandInConfig):
    """No settings."""

    kind: Literal["small"] = "small"  # type: ignore[assignment]


class Engine(StandIn):
    """The stand-in; `simulation` is what it builds, from the chain that `seen` gives."""

    simulation: type[StandInSimulation] = StandInSimulation

    def build(self, chain: ChainModel) -> StandInSimulation:
        return self.simulation(self.seen(chain))

    def seen(self, chain: ChainModel) -> ChainModel:
        return chain


variants = Variants(
    Component("physics", "small", "broken.physics:EngineConfig", "broken.physics:Engine", "plain Newton")
)
broken_by = variants.by_part(Engine, "simulation")


@variants.by("declares_its_capabilities", "joints")
class UnknownJoint(Engine):
    """A joint that Pliant does not have."""

    capabilities = Capabilities(joints=("universal",), dynamic=False)  # type: ignore[arg-type]


@variants.by("dynamic_is_what_it_says", "dynamic is True.* no inertia holds it back")
class NoInertia(Engine):
    """Steps from equilibrium to equilibrium, and says that it advances inertia."""

    capabilities = Capabilities(joints=StandIn.capabilities.joints, dynamic=True)


@broken_by("dynamic_is_what_it_says", "dynamic is False")
class Creeping(StandInSimulation):
    """Approaches its equilibria by and by, and says that each step is one."""

    def step(self, duration_s: float) -> None:
        before = self.snapshot()
        super().step(duration_s)
        after = self.snapshot()
        self.restore(replace(after, position=before.position + 0.3 * (after.position - before.position)))


@broken_by("starts_straight", "markers .* of the straight chain")
class Millimetres(StandInSimulation):
    """Its own length unit comes out."""

    def markers(self) -> Array:
        return 1e3 * super().markers()


@broken_by("stays_at_rest_without_loads", "without any load")
class Preloaded(StandInSimulation):
    """A joint that keeps a little angle."""

    def settle(self) -> Equilibrium:
        good = super().settle()
        return replace(good, joint_angles=good.joint_angles + 1e-4)


@broken_by("gives_the_worked_number", "joint angles")
class WeakPressure(StandInSimulation):
    """One per cent less pressure."""

    def apply(self, inputs: Inputs) -> None:
        super().apply(replace(inputs, actuation={k: 0.99 * v for k, v in inputs.actuation.items()}))


@variants.by("balances_a_weight", "under the module's own weight")
class Weightless(Engine):
    """Forgets the last body's weight."""

    def seen(self, chain: ChainModel) -> ChainModel:
        return chain.with_(bodies=(*chain.bodies[:-1], replace(chain.bodies[-1], mass_kg=0.0)))


@broken_by("settles_in_equilibrium", "the unbalanced effort is")
class Sloppy(StandInSimulation):
    """Stops one per cent before equilibrium and says that it converged."""

    def settle(self) -> Equilibrium:
        good = super().settle()
        self.q = 0.99 * self.q
        return replace(good, joint_angles=self.q.copy(), markers_m=self.markers())


@broken_by("markers_follow_the_kinematics", "do not belong to joint_angles")
class OldMarkers(StandInSimulation):
    """Reads positions before the engine updated them."""

    def settle(self) -> Equilibrium:
        before = self.markers()
        return replace(super().settle(), markers_m=before)


@variants.by("turns_with_its_base", "markers .* of the moved chain")
class FixedBase(Engine):
    """Always hangs from the default base."""

    def seen(self, chain: ChainModel) -> ChainModel:
        return chain.with_(base_rotation=default_base_rotation())


@variants.by("payload_is_a_weight_at_the_tip", "payload does not move the tip")
class NoPayload(Engine):
    """Ignores the payload."""

    def seen(self, chain: ChainModel) -> ChainModel:
        return chain.with_(payload_kg=0.0)


@broken_by("moment_opposes_actuation", "under an opposing moment")
class HelpingMoment(StandInSimulation):
    """The moment acts along the actuation."""

    def apply(self, inputs: Inputs) -> None:
        super().apply(replace(inputs, moment_n_m=-inputs.moment_n_m))


@variants.by("opposed_actuators_cancel", "equal opposed pressures")
class Unsigned(Engine):
    """Takes every chamber for the first."""

    def seen(self, chain: ChainModel) -> ChainModel:
        return chain.with_(actuators=tuple(replace(a, sign=1.0) for a in chain.actuators))


@broken_by("refuses_missing_inputs", "without a value for it")
class Defaulting(StandInSimulation):
    """A missing pressure is 0."""

    def apply(self, inputs: Inputs) -> None:
        zero = {a.input: 0.0 for a in self.chain.actuators}
        super().apply(replace(inputs, actuation={**zero, **inputs.actuation}))


@broken_by("reports_extrapolation", "reported were \\[\\]")
class Silent(StandInSimulation):
    """Never reports extrapolation."""

    def settle(self) -> Equilibrium:
        return replace(super().settle(), outside_domain=())


@broken_by("admits_that_it_did_not_converge", "called converged and stable")
class Optimist(StandInSimulation):
    """Always converged, always stable."""

    def settle(self) -> Equilibrium:
        return replace(super().settle(), converged=True, stable=True)


@broken_by("restores_a_snapshot", "copy it")
class Aliased(StandInSimulation):
    """Its snapshot is a view."""

    def snapshot(self) -> SimulationState:
        return SimulationState(self.time_s, self.q, np.zeros_like(self.q))

    def settle(self) -> Equilibrium:
        kept = self.q
        good = super().settle()
        kept[:] = self.q
        self.q = kept
        return good


@broken_by("steps_forward_in_time", "passed in two steps")
class WholeSteps(StandInSimulation):
    """Advances by whole internal steps of 50 ms only."""

    def step(self, duration_s: float) -> None:
        super().step(0.05 * round(duration_s / 0.05))


@broken_by("simulations_are_independent", "shared state")
class Shared(StandInSimulation):
    """All simulations live in one world."""

    last: ClassVar[dict[str, Array]] = {}

    def settle(self) -> Equilibrium:
        good = super().settle()
        self.last["q"] = self.q
        return good

    def markers(self) -> Array:
        q = self.last.get("q", self.q)
        return self.statics.geometry.markers(np.resize(q, self.q.shape))


@broken_by("closes_cleanly", "RuntimeError")
class ClosesOnce(StandInSimulation):
    """Raises when it is closed twice."""

    open = True

    def close(self) -> None:
        if not self.open:
            raise RuntimeError("not connected")
        self.open = False


@variants.by("leaves_the_chain_alone", "changed in place")
class ScalesMasses(Engine):
    """Converts inertias in the caller's arrays."""

    def seen(self, chain: ChainModel) -> ChainModel:
        for body in chain.bodies:
            body.inertia_kg_m2[:] *= 1e4
        return chain


@broken_by(
    "spherical_efforts_are_energy_consistent", "applied as a torque in the parent's or the child's frame"
)
class NaiveTorques(StandInSimulation):
    """Balances τ itself, as a torque in the joint's rest frame, against the loads' moments Jᵀ⁻¹ Q."""

    def settle(self) -> Equilibrium:
        good = super().settle()
        if self.chain.laws[0].joint != "spherical":
            return good
        for _ in range(400):
            tau = self.statics.effort(self.q, self.loads)
            loads = self.statics.residual(self.q, self.loads) - tau
            transposed = left_jacobian(self.q).transpose(0, 2, 1)
            unbalanced = tau + np.linalg.solve(transposed, loads[..., None])[..., 0]
            self.q = self.q + 4.0 * unbalanced
        return replace(good, joint_angles=self.q.copy(), markers_m=self.markers())


@broken_by("prismatic_joints_extend", "extension")
class Doubled(StandInSimulation):
    """Extensions in its own unit."""

    def settle(self) -> Equilibrium:
        good = super().settle()
        slides = self.chain.laws[0].joint == "prismatic"
        return replace(good, joint_angles=good.joint_angles * (1e3 if slides else 1.0))


class Follower(Engine):
    """Follows histories as the quasi-static engine does."""

    capabilities = Capabilities(("revolute",), dynamic=False, internal_states=True)

    def follow(self, chain, histories, towards=()):
        return Quasistatic(QuasistaticConfig()).follow(chain, histories, towards)


@variants.by("follows_settled_states", "of sample 1 without a clock")
class ForgetsForces(Follower):
    """No tip force in histories."""

    def follow(self, chain, histories, towards=()):
        return super().follow(chain, [h.with_(tip_force_n=0 * h.tip_force_n) for h in histories], towards)


@variants.by("follows_time", "damped joint")
class WithoutClock(Follower):
    """Every sample is reached slowly."""

    def follow(self, chain, histories, towards=()):
        return super().follow(chain, [h.with_(time_s=None) for h in histories], towards)


@variants.by("keeps_damage_in_its_specimen", "virgin specimen after another")
class OneSpecimen(Follower):
    """All runs are of one specimen."""

    def follow(self, chain, histories, towards=()):
        return super().follow(chain, [h.with_(specimen="") for h in histories], towards)


@variants.by("differentiates", "in run 2")
class ShortMemory(Follower):
    """Derivatives of later runs forget what earlier ones changed."""

    def follow(self, chain, histories: list[History], towards=()):
        paths, changes = super().follow(chain, histories, towards)
        falsified = tuple(
            (change[0], *(Followed(0.9 * c.joint_angles, c.converged) for c in change[1:]))
            for change in changes
        )
        return paths, falsified


@variants.by("names_missing_inputs_of_runs", "was followed")
class TakesZero(Follower):
    """A missing pressure is 0."""

    def follow(self, chain, histories, towards=()):
        given = [h.with_actuation(pressure_pa=np.zeros(len(h))) for h in histories]
        return super().follow(chain, given, towards)
