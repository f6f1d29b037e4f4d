"""The stand-in engine as the correct one, and engines with one wrong convention each."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from tests.conformance.broken import Variants

from pliant.interfaces.physics import Capabilities, roll_each
from pliant.interfaces.simulation import SimulationState
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.rotations import left_jacobian
from pliant.records.chain import ChainModel, default_base_rotation
from pliant.records.design import Array
from pliant.records.history import Followed, History
from pliant.records.rollout import Equilibrium, Inputs, PointForce, Sensitivity
from pliant.registry.component import Component
from pliant.testing.stand_ins import StandIn, StandInConfig, StandInSimulation
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig

QUASISTATIC = Quasistatic(QuasistaticConfig())


class EngineConfig(StandInConfig):
    """The config of an engine without settings."""

    kind: Literal["small"] = "small"  # type: ignore[assignment]


class Engine(StandIn):
    """The stand-in engine; `simulation` is the class that it builds, from the chain that `seen` returns."""

    simulation: type[StandInSimulation] = StandInSimulation

    def build(self, chain: ChainModel) -> StandInSimulation:
        return self.simulation(self.seen(chain))

    def seen(self, chain: ChainModel) -> ChainModel:
        return chain


class Follower(Engine):
    """An engine that follows histories as the quasi-static engine does."""

    capabilities = Capabilities(("revolute",), dynamic=False)

    def follow(self, chain, histories, towards=()):
        return QUASISTATIC.follow(chain, histories, towards)


class Batcher(Engine):
    """An engine with the batches of the quasi-static engine."""

    capabilities = Capabilities(("revolute",), dynamic=False, gradients=True)

    def settle_batch(self, cases):
        return QUASISTATIC.settle_batch(cases)

    def rollout_batch(self, runs):
        return roll_each(self, runs)


class Exporter(Engine):
    """An engine that writes one file."""

    export_format = "mjcf"

    def export(self, chain, path, looks=None):
        path.write_text("<mujoco/>")
        return (path,)


class Threaded(Follower):
    """An engine that follows histories in threads, as the quasi-static engine does."""

    capabilities = replace(Follower.capabilities, threads=True)


variants = Variants(
    Component("physics", "small", f"{__name__}:EngineConfig", f"{__name__}:Engine", "plain Newton")
)
broken, simulated = variants.row_adder(Engine), variants.row_adder(Engine, "simulation")
followed, batched, threaded = (
    variants.row_adder(Follower),
    variants.row_adder(Batcher),
    variants.row_adder(Threaded),
)
JOINTS = StandIn.capabilities.joints


def chained(check: str, change: Any) -> None:
    """Add a row: the engine sees another chain."""
    broken(check, seen=lambda up, self, chain: change(chain))


def applied(check: str, change: Any) -> None:
    """Add a row: the simulation gets other inputs, or interprets them differently if the function takes it too."""
    simulated(check, apply=lambda up, self, inputs: up(change(self, inputs)))


def settled(check: str, change: Any) -> None:
    """Add a row: fields of the settled answer are changed."""
    simulated(check, settle=lambda up, self: replace(good := up(), **change(good)))


def told(check: str, **changes: Any) -> None:
    """Add a row: all histories are followed with changed fields, given by functions of the history."""
    followed(
        check,
        follow=lambda up, self, chain, histories, towards=(): up(
            chain, [h.with_(**{k: v(h) for k, v in changes.items()}) for h in histories], towards
        ),
    )


def _creeping(up: Any, self: Any, duration_s: float) -> None:
    before = self.snapshot()
    up(duration_s)
    after = self.snapshot()
    self.restore(replace(after, position=before.position + 0.3 * (after.position - before.position)))


def _stopping_early(up: Any, self: Any) -> Equilibrium:
    good: Equilibrium = up()
    self.q = 0.99 * self.q
    return replace(good, joint_angles=self.q.copy(), markers_m=self.markers())


def _with_old_markers(up: Any, self: Any) -> Equilibrium:
    before = self.markers()
    return replace(up(), markers_m=before)


def _in_place(up: Any, self: Any) -> Equilibrium:
    kept = self.q
    good: Equilibrium = up()
    kept[:], self.q = self.q, kept
    return good


LAST: dict[str, Array] = {}


def _last_markers(up: Any, self: Any) -> Array:
    q = LAST.get("q", self.q)
    return np.asarray(self.statics.geometry.markers(np.resize(q, self.q.shape)))


def _kept_as_the_last(up: Any, self: Any) -> Equilibrium:
    good: Equilibrium = up()
    LAST["q"] = self.q
    return good


def _through_a_shared_chain(
    up: Any, self: Engine, chain: ChainModel, histories: Any, towards: Any = ()
) -> Any:
    """Store the chain in the engine, where other threads replace it."""
    self.last = chain  # type: ignore[attr-defined]
    time.sleep(0.01)
    return up(self.last, histories, towards)  # type: ignore[attr-defined]


def _closing_once(up: Any, self: Any) -> None:
    if "closed" in self.__dict__:
        raise RuntimeError("not connected")
    self.closed = True


def _scaling_masses(chain: ChainModel) -> ChainModel:
    for body in chain.bodies:
        body.inertia_kg_m2[:] *= 1e4
    return chain


def _by_naive_torques(up: Any, self: Any) -> Equilibrium:
    """Balance τ directly, as a torque in the joint's rest frame, against the loads' moments Jᵀ⁻¹ Q."""
    good: Equilibrium = up()
    if self.chain.laws[0].joint != "spherical":
        return good
    for _ in range(400):
        tau = self.statics.effort(self.q, self.loads)
        loads = self.statics.residual(self.q, self.loads) - tau
        transposed = left_jacobian(self.q).transpose(0, 2, 1)
        self.q = self.q + 4.0 * (tau + np.linalg.solve(transposed, loads[..., None])[..., 0])
    return replace(good, joint_angles=self.q.copy(), markers_m=self.markers())


def _slides_doubled(up: Any, self: Any) -> Equilibrium:
    good: Equilibrium = up()
    return replace(
        good, joint_angles=good.joint_angles * (1e3 if self.chain.laws[0].joint == "prismatic" else 1.0)
    )


def _grown_before_it_turned(up: Any, self: Any) -> Equilibrium:
    """Move joint 1 along its parent's axis."""
    good: Equilibrium = up()
    if self.chain.laws[0].joint != "extensible":
        return good
    turned = ChainGeometry.from_chain(self.chain).forward(good.joint_angles).rotations
    moved = good.markers_m.copy()
    moved[2:] += good.joint_angles[0, -1] * (turned[0, :, 0] - turned[1, :, 0])
    return replace(good, markers_m=moved)


def _forgetting_earlier_runs(
    up: Any, self: Any, chain: Any, histories: list[History], towards: Any = ()
) -> Any:
    paths, changes = up(chain, histories, towards)
    return paths, tuple(
        (first, *(Followed(0.9 * c.joint_angles, c.converged) for c in later)) for first, *later in changes
    )


def _with_straight_cords(up: Any, self: Any, inputs: Inputs) -> None:
    up(replace(inputs, cords=()))
    pose = self.statics.geometry.forward(0.0 * self.q)
    first = self.statics.acting(pose, replace(self.applied, cords=inputs.cords, forces=()))
    pairs = zip(inputs.cords, first, strict=True)
    dead = tuple(PointForce(cord.body, cord.point_m, acting.force_n) for cord, acting in pairs)
    self.applied = replace(self.applied, forces=(*self.applied.forces, *dead))


class PerKilopascal(StandInSimulation):
    """Derivatives of the quasi-static engine, in another unit of pressure."""

    def sensitivity(self) -> Sensitivity:
        with QUASISTATIC.build(self.chain) as inner:
            loads = self.applied
            inner.apply(Inputs(loads.actuation, loads.tip_force_n, loads.moment_n_m))
            inner.settle()
            good = inner.sensitivity()
        angles = {**good.joint_angles, "pressure_pa": 1e3 * good.joint_angles["pressure_pa"]}
        return replace(good, joint_angles=angles)


broken(
    "declares_its_capabilities",
    capabilities=Capabilities(joints=("universal",), dynamic=False),  # type: ignore[arg-type]
)
broken("dynamic_is_what_it_says", capabilities=Capabilities(joints=JOINTS, dynamic=True))
simulated("dynamic_is_what_it_says", step=_creeping)
simulated("starts_straight", markers=lambda up, self: 1e3 * up())
settled("stays_at_rest_without_loads", lambda good: {"joint_angles": good.joint_angles + 1e-4})
applied(
    "gives_the_worked_number",
    lambda self, i: replace(i, actuation={k: 0.99 * v for k, v in i.actuation.items()}),
)
chained("balances_a_weight", lambda c: c.with_(bodies=(*c.bodies[:-1], replace(c.bodies[-1], mass_kg=0.0))))
simulated("settles_in_equilibrium", settle=_stopping_early)
settled("settles_in_equilibrium", lambda good: {"residual": good.residual + 1e-4})
simulated("markers_follow_the_kinematics", settle=_with_old_markers)
chained("turns_with_its_base", lambda c: c.with_(base_rotation=default_base_rotation()))
chained("settles_in_equilibrium", lambda c: c.with_(payload_kg=0.0))
applied("settles_in_equilibrium", lambda self, i: replace(i, moment_n_m=-i.moment_n_m))
chained(
    "opposed_actuators_cancel", lambda c: c.with_(actuators=tuple(replace(a, sign=1.0) for a in c.actuators))
)
applied(
    "refuses_missing_inputs",
    lambda self, i: replace(i, actuation={**{a.input: 0.0 for a in self.chain.actuators}, **i.actuation}),
)
settled("reports_extrapolation", lambda _: {"outside_domain": ()})
settled("admits_that_it_did_not_converge", lambda _: {"converged": True, "stable": True})
simulated(
    "restores_a_snapshot",
    snapshot=lambda up, self: SimulationState(self.time_s, self.q, np.zeros_like(self.q)),
    settle=_in_place,
)
simulated("steps_forward_in_time", step=lambda up, self, duration_s: up(0.05 * round(duration_s / 0.05)))
simulated("simulations_are_independent", settle=_kept_as_the_last, markers=_last_markers)
simulated("closes_cleanly", close=_closing_once)
chained("leaves_the_chain_alone", _scaling_masses)
simulated("spherical_efforts_are_energy_consistent", settle=_by_naive_torques)
simulated("prismatic_joints_extend", settle=_slides_doubled)
simulated("extensible_joints_turn_and_then_extend", settle=_grown_before_it_turned)

# -- histories, batches, derivatives, files

told("follows_settled_states", tip_force_n=lambda h: 0 * h.tip_force_n)
told("follows_time", time_s=lambda h: None)
told("keeps_damage_in_its_specimen", specimen=lambda h: "")
followed("differentiates", follow=_forgetting_earlier_runs)
threaded("follows_in_threads", follow=_through_a_shared_chain)
told("names_missing_run_inputs", actuation=lambda h: {**h.actuation, "pressure_pa": np.zeros(len(h))})
batched("batches_settle_as_one_by_one", settle_batch=lambda up, self, cases: up(cases)[::-1])
batched(
    "batches_roll_as_one_by_one",
    rollout_batch=lambda up, self, runs: tuple(
        replace(r, markers_m=np.roll(r.markers_m, 1, axis=0)) for r in up(runs)
    ),
)
batched("sensitivities_are_differences", simulation=PerKilopascal)
variants.row_adder(Exporter)("exports_a_file", export=lambda up, self, chain, path, looks=None: (path,))

# -- loads at points

applied(
    "settles_in_equilibrium",
    lambda self, i: replace(i, forces=tuple(replace(f, point_m=np.zeros(3)) for f in i.forces)),
)
simulated("settles_in_equilibrium", apply=_with_straight_cords)
applied("settles_in_equilibrium", lambda self, i: replace(i, cords=tuple(c.scaled(0.5) for c in i.cords)))
applied(
    "spherical_efforts_are_energy_consistent",
    lambda self, i: replace(i, forces=(), cords=()) if self.chain.laws[0].joint == "spherical" else i,
)
