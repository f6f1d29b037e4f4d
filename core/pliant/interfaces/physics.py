"""PhysicsBackend: an engine that simulates a chain."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import ClassVar, Self

import numpy as np

from pliant.errors import ContractError
from pliant.interfaces.base import ComponentConfig, Configured
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import Followed, History
from pliant.records.law import JointKind
from pliant.records.mount import Carrier, Mount
from pliant.records.rollout import Equilibrium, Inputs, OutsideDomain, Response, Rollout, Sensitivity
from pliant.records.scene import Contact, Scene, SceneState
from pliant.records.shape import Shape

# Half-width of central differences, as a share of an input.
DIFFERENCE = 1e-3


class PhysicsConfig(ComponentConfig):
    """Base of an engine's config."""


@dataclass(frozen=True)
class Capabilities:
    """What an engine can do; the pipeline asks before it builds.

    Attributes:
        joints: kinds of joints it simulates.
        dynamic: `step` advances inertia and damping; otherwise each step is an equilibrium.
        internal_states: law terms that need time or memory are followed, and `follow` is there.
        gradients: `Simulation.sensitivity` is there.
        batch: `settle_batch` or `rollout_batch` uses all cores, not one case after another.
        contacts: `build_scene` is there.
        threads: `follow` may be called by several threads at once, and leaves Python's lock meanwhile.
        arms_touch: fingers of a scene may touch each other.
        mounts: a chain may stand on somebody else's arm (`ChainModel.mount`).
        export: the format that `export` writes ("mjcf", "urdf"), empty where there is none.
    """

    joints: tuple[JointKind, ...]
    dynamic: bool
    internal_states: bool = False
    gradients: bool = False
    batch: bool = False
    contacts: bool = False
    threads: bool = False
    arms_touch: bool = False
    mounts: bool = False
    export: str = ""


@dataclass(frozen=True, eq=False)
class SimulationState:
    """Snapshot: time, joint coordinates (n, a), their rates (n, a), memory of law terms (n, a, states).

    `carrier`: the engine's own numbers of what the chain is mounted on.
    """

    time_s: float
    position: Array
    velocity: Array
    memory: Array | None = None
    carrier: Array | None = None


class EngineHandle:
    """What frees an engine's resources when a `with` block ends."""

    def close(self) -> None:
        """Free the engine's resources."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Simulation(EngineHandle, ABC):
    """One chain in one engine. Tasks drive it: `apply`, then `settle` or `step`, then read `markers`.

    The pressure or load given to `apply` holds until the next `apply`. Everything outside is SI and in the
    conventions of docs/conventions.md; scaling and quaternion order stay inside.
    """

    chain: ChainModel

    @abstractmethod
    def apply(self, inputs: Inputs) -> None:
        """Set actuation and loads from now on."""

    @abstractmethod
    def settle(self) -> Equilibrium:
        """Static equilibrium under the present inputs, reached from the present state.

        Never raises for lack of convergence: `converged` is False and `residual` tells how far it is.
        """

    @abstractmethod
    def step(self, duration_s: float) -> None:
        """Advance by `duration_s`, in as many internal steps as the engine needs."""

    def advance(self, duration_s: float) -> bool:
        """`step`, or `settle` where the duration is infinite.

        Returns:
            whether the simulation can answer for where it is; True where an engine cannot tell.
        """
        if math.isinf(duration_s):
            return self.settle().converged
        self.step(duration_s)
        return True

    @abstractmethod
    def snapshot(self) -> SimulationState:
        """The present state; `restore` brings it back exactly."""

    @abstractmethod
    def restore(self, state: SimulationState) -> None:
        """Return to a snapshot."""

    @abstractmethod
    def markers(self) -> Array:
        """(n + 2, 3) base, joints 1…n and tip in the world, as the engine itself has them.

        A joint's marker is the origin of the body that it carries: on a prismatic joint it moves with q.
        """

    def carrier(self) -> Carrier | None:
        """What the chain stands on, as it stands now; None where its base is fixed in the world."""
        return None

    def sensitivity(self) -> Sensitivity:
        """Derivatives of the equilibrium that the last `settle` ended in.

        Raises:
            UserError: the last `settle` did not converge, or ended where the stiffness is singular.
        """
        raise ContractError(f"{type(self).__name__} has no gradients (Capabilities.gradients is False)")

    def respond(self, inputs: Inputs, start: Array | None = None) -> Response:
        """The equilibrium under these inputs with its slopes by the actuations.

        By `settle` and `sensitivity`, or differences of settled states where an engine has no gradients.

        Args:
            inputs: actuation and loads.
            start: (n, a) joint coordinates to begin at, where the engine can use them.
        """
        self.apply(inputs)
        found, names = self.settle(), self.chain.inputs
        if not found.converged:
            return self._response(found, np.zeros((len(names), *found.markers_m.shape)), None)
        try:
            slopes = self.sensitivity()
        except ContractError:
            return self._differences(inputs, found)
        by_input = np.array([slopes.markers_m[name] for name in names])
        turned = np.array([slopes.joint_angles[name] for name in names])
        return self._response(found, by_input, turned)

    def _differences(self, inputs: Inputs, found: Equilibrium) -> Response:
        """The response by central differences of settled states."""
        by_input, turned = [], []
        for name in self.chain.inputs:
            step = DIFFERENCE * max(abs(inputs.actuation[name]), 1.0)
            sides = []
            for way in (step, -step):
                self.apply(
                    replace(inputs, actuation={**inputs.actuation, name: inputs.actuation[name] + way})
                )
                sides.append(self.settle())
            by_input.append((sides[0].markers_m - sides[1].markers_m) / (2 * step))
            turned.append((sides[0].joint_angles - sides[1].joint_angles) / (2 * step))
        return self._response(found, np.array(by_input), np.array(turned))

    def _response(self, found: Equilibrium, by_input: Array, turned: Array | None) -> Response:
        pose = ChainGeometry.of(self.chain).forward(found.joint_angles)
        spin = np.zeros((len(by_input), 3))
        geometry = ChainGeometry.of(self.chain)
        if turned is not None and geometry.turns:
            spin = np.einsum(
                "nia,kna->ki", pose.directions[:, :, : geometry.slide], turned[..., : geometry.slide]
            )
        parts = (found.joint_angles, found.markers_m, by_input, pose.rotations[-1], spin)
        return Response(*parts, turned is not None, not found.outside_domain)


class SceneSimulation(EngineHandle, ABC):
    """A scene in one engine. Tasks drive it: `apply`, `carry`, `step`, then read markers, contacts and state.

    What is given to `apply`, `carry` and `push` holds until the next call of the same. SI and docs/conventions.md
    outside; scaling, quaternion order and the engine's own friction rule stay inside.
    """

    scene: Scene

    @abstractmethod
    def apply(self, inputs: Sequence[Inputs]) -> None:
        """Actuation and loads of each arm from now on."""

    @abstractmethod
    def carry(self, velocity_m_s: Array) -> None:
        """Move the carriage, and all arms' bases with it, at this velocity (3,), whatever the contacts."""

    @abstractmethod
    def push(self, index: int, force_n: Array, moment_n_m: Array | None = None) -> None:
        """A dead wrench (world) on object `index` at its centre of mass from now on."""

    @abstractmethod
    def step(self, duration_s: float) -> None:
        """Advance by `duration_s`, in as many internal steps as the engine needs.

        Raises:
            UserError: the motion has become unbounded; the message says what to change.
        """

    @abstractmethod
    def snapshot(self) -> SceneState:
        """The present state; `restore` brings it back exactly, and the same steps then give the same motion."""

    @abstractmethod
    def restore(self, state: SceneState) -> None:
        """Return to a snapshot."""

    @abstractmethod
    def markers(self, arm: int) -> Array:
        """(n + 2, 3) base, joints and tip of an arm in the world."""

    @abstractmethod
    def contacts(self) -> tuple[Contact, ...]:
        """What touches at the end of the last step, with the forces of that step."""

    @abstractmethod
    def outside_domain(self) -> tuple[OutsideDomain, ...]:
        """Where laws are used outside their domain now; joints are numbered through all arms in a row."""

    def pose(self, arm: int) -> Equilibrium:
        """An arm as it stands now, for `TaskResult.final`; contact holds it, so its residual is not a number."""
        return Equilibrium(
            joint_angles=self.snapshot().coordinates[arm],
            markers_m=self.markers(arm),
            residual=float("nan"),
            converged=True,
            stable=None,
            iterations=0,
            wall_s=0.0,
            outside_domain=self.outside_domain(),
        )


@dataclass(frozen=True, eq=False)
class Case:
    """One chain under one set of loads, for `settle_batch`."""

    chain: ChainModel
    inputs: Inputs


@dataclass(frozen=True, eq=False)
class Run:
    """One chain through one history, for `rollout_batch`; the history has times."""

    chain: ChainModel
    history: History


@dataclass(frozen=True, eq=False)
class Variation:
    """A chain and the histories that reach it, a small step away from another."""

    chain: ChainModel
    histories: tuple[History, ...]


class PhysicsBackend(Configured[PhysicsConfig]):
    """An engine. The simulate stage calls `build` once per chain; one backend may build many."""

    capabilities: ClassVar[Capabilities]

    @abstractmethod
    def build(self, chain: ChainModel) -> Simulation:
        """A simulation at rest: joint coordinates 0, no actuation, no velocity."""

    def build_scene(self, scene: Scene) -> SceneSimulation:
        """A scene at rest: straight arms without actuation, objects where the scene puts them.

        Raises:
            UserError: a kind of joint or shape that the engine does not have.
        """
        raise ContractError(f"{type(self).__name__} has no scenes (Capabilities.contacts is False)")

    def export(self, chain: ChainModel, path: Path, looks: ChainModel | None = None) -> tuple[Path, ...]:
        """Write a chain as a file for other programs, meshes beside it; the law's function is not in it.

        Args:
            chain: bodies, joints, and shapes that collide.
            path: the file; its folder exists.
            looks: the same chain with what is to be seen for shapes.

        Returns:
            all files that were written, `path` first.
        """
        raise ContractError(f"{type(self).__name__} writes no files (Capabilities.export is empty)")

    def export_scene(self, scene: Scene, path: Path) -> tuple[Path, ...]:
        """Write a scene at rest as `export` does a chain; returns all files that were written, `path` first."""
        raise ContractError(f"{type(self).__name__} writes no scenes")

    def check_mount(self, mount: Mount) -> None:
        """Look whether the arm is there and can carry a chain, before anything is solved.

        Raises:
            UserError: a file that cannot be read, a name that it does not have.
        """
        raise ContractError(f"{type(self).__name__} has no mounts (Capabilities.mounts is False)")

    def mount_shapes(self, mount: Mount) -> tuple[tuple[Shape, ...], ...]:
        """What is to be seen of the arm, per body, in the order of `Carrier.bodies_m`."""
        raise ContractError(f"{type(self).__name__} has no mounts (Capabilities.mounts is False)")

    def settle_batch(self, cases: Sequence[Case]) -> tuple[Equilibrium, ...]:
        """Equilibria of many chains, each from its straight state; one case after another by default."""
        found = []
        for case in cases:
            with self.build(case.chain) as simulation:
                simulation.apply(case.inputs)
                found.append(simulation.settle())
        return tuple(found)

    def rollout_batch(self, runs: Sequence[Run]) -> tuple[Rollout, ...]:
        """Many chains through their histories, from rest at the first sample; one after another by default."""
        return tuple(self._roll(run) for run in runs)

    def _roll(self, run: Run) -> Rollout:
        history = run.history
        if history.time_s is None:
            raise ContractError(f"run '{history.run}' has no times")
        positions, markers = [], []
        with self.build(run.chain) as simulation:
            for k in range(len(history)):
                simulation.apply(history.at(k))
                simulation.step(float(history.time_s[k] - history.time_s[k - 1]) if k else 0.0)
                positions.append(simulation.snapshot().position)
                markers.append(simulation.markers())
        actuation = np.stack([history.actuation[name] for name in history.actuation], axis=1)
        return Rollout(history.time_s, actuation, np.array(positions), np.array(markers))

    def preparing(self, chain: ChainModel, histories: bool = True) -> str | None:
        """A sentence for the user before the first `follow` of this chain (or `settle`, without `histories`): that it
        will take long, once, or what is simulated otherwise than the config may suggest; else None.
        """
        return None

    def follow(
        self, chain: ChainModel, histories: Sequence[History], towards: Sequence[Variation] = ()
    ) -> tuple[tuple[Followed, ...], tuple[tuple[Followed, ...], ...]]:
        """The chain through whole runs, internal states advanced in time, with derivatives.

        Histories of one specimen follow each other: damage done in one is there in the next.

        Args:
            chain: the chain with its law terms.
            histories: what reaches the chain in each run, effects' input maps done.
            towards: the same chain and histories slightly changed, one entry per parameter.

        Returns:
            one `Followed` per history, and for each variation the change that it makes to them to first order
            (`joint_angles` are then small differences; `converged` is that of the chain itself).

        Raises:
            UserError: a kind of joint that the engine cannot follow.
        """
        raise ContractError(f"{type(self).__name__} has no histories (Capabilities.internal_states is False)")
