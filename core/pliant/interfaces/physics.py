"""PhysicsBackend: an engine that simulates a chain, and the capabilities that an engine may have besides.

An engine has a capability if it has its methods: callers ask `isinstance(backend, HistoryBackend)`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np

from pliant.errors import ContractError
from pliant.interfaces.base import ComponentConfig, Configured
from pliant.interfaces.simulation import SceneSimulation, Simulation
from pliant.records.chain import ChainModel
from pliant.records.history import Followed, History
from pliant.records.law import JointKind
from pliant.records.mount import Mount
from pliant.records.rollout import Equilibrium, Inputs, Rollout
from pliant.records.scene import Scene
from pliant.records.shape import Shape


class PhysicsConfig(ComponentConfig):
    """Base of an engine's config."""


@dataclass(frozen=True)
class Capabilities:
    """Properties of an engine that no method shows, which the pipeline checks before it builds.

    Attributes:
        joints: joint types that it simulates.
        dynamic: `step` advances inertia and damping; otherwise each step is an equilibrium.
        gradients: `Simulation.sensitivity` is implemented.
        threads: `HistoryBackend.follow` may be called by several threads at once, and releases Python's lock.
        arms_touch: fingers of a scene may touch each other.
        free_bases: free objects of a scene may carry arms (`Arm.base_object`).
    """

    joints: tuple[JointKind, ...]
    dynamic: bool
    gradients: bool = False
    threads: bool = False
    arms_touch: bool = False
    free_bases: bool = False


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
    """A chain and its input histories, slightly perturbed from another pair."""

    chain: ChainModel
    histories: tuple[History, ...]


class PhysicsBackend(Configured[PhysicsConfig]):
    """A physics engine. The simulate stage calls `build` once per chain; one backend may build many.

    A minimal engine of equilibria has three methods: `build`, and `apply` and `settle` of its `StaticSimulation`.
    """

    capabilities: ClassVar[Capabilities]

    @abstractmethod
    def build(self, chain: ChainModel) -> Simulation:
        """Return a simulation at rest: joint coordinates 0, no actuation, no velocity."""

    def effort_tolerance(self) -> float | None:
        """Return the largest unbalanced effort of a settled chain, N·m (N on prismatic joints); None if unknown."""
        return None

    def added_damping(self) -> str:
        """Return a description of the damping that the engine adds to all motion; "" without added damping."""
        return ""

    def preparing(self, chain: ChainModel, histories: bool = True) -> str | None:
        """Return a notice before the first `follow` of this chain (or `settle`, without `histories`), or None.

        The notice states that it will take long, once, or that the simulation differs from what the config suggests.
        """
        return None


@runtime_checkable
class HistoryBackend(Protocol):
    """An engine that follows histories, with law terms that need time or memory."""

    def follow(
        self, chain: ChainModel, histories: Sequence[History], towards: Sequence[Variation] = ()
    ) -> tuple[tuple[Followed, ...], tuple[tuple[Followed, ...], ...]]:
        """Simulate the chain through whole runs, with internal states advanced in time, and with derivatives.

        Histories of one specimen are consecutive: damage of one persists in the next.

        Args:
            chain: the chain with its law terms.
            histories: inputs that reach the chain in each run, after the effects' input maps.
            towards: the same chain and histories slightly perturbed, one entry per parameter.

        Returns:
            one `Followed` per history, and for each variation its first-order change of them (`joint_angles` are then
            small differences; `converged` is that of the chain itself).

        Raises:
            UserError: a joint type that the engine does not support.
        """
        ...


@runtime_checkable
class SceneBackend(Protocol):
    """An engine of scenes with contact."""

    def build_scene(self, scene: Scene) -> SceneSimulation:
        """Return a scene at rest: straight arms without actuation, objects where the scene puts them.

        Raises:
            UserError: a joint type or shape that the engine does not support.
        """
        ...


@runtime_checkable
class StaticSceneBackend(Protocol):
    """An engine of equilibria for scenes whose only other bodies are fixed (`SceneTask.settles`)."""

    def build_static_scene(self, scene: Scene) -> SceneSimulation:
        """Return a scene at rest, each of whose steps ends in equilibrium.

        Raises:
            UserError: free objects, friction or a shape that the engine does not support.
        """
        ...


@runtime_checkable
class ExportBackend(Protocol):
    """An engine that writes files for other programs.

    Attributes:
        export_format: their format ("mjcf", "urdf").
    """

    export_format: ClassVar[str]

    def export(self, chain: ChainModel, path: Path, looks: ChainModel | None = None) -> tuple[Path, ...]:
        """Write a chain as a file for other programs, with meshes in the same folder, without the law's function.

        Args:
            chain: bodies, joints and collision shapes.
            path: the file; its folder exists.
            looks: the same chain with visible shapes.

        Returns:
            all written files, `path` first.
        """
        ...


@runtime_checkable
class SceneExportBackend(ExportBackend, Protocol):
    """An engine that also writes scenes in its format."""

    def export_scene(self, scene: Scene, path: Path) -> tuple[Path, ...]:
        """Write a scene at rest as `export` writes a chain; return all written files, `path` first."""
        ...


@runtime_checkable
class MountBackend(Protocol):
    """An engine that simulates a chain on an imported arm (`ChainModel.mount`)."""

    def check_mount(self, mount: Mount) -> None:
        """Check before any solution that the arm exists and can carry a chain.

        Raises:
            UserError: a file that cannot be read, or a name that it does not contain.
        """
        ...

    def mount_shapes(self, mount: Mount) -> tuple[tuple[Shape, ...], ...]:
        """Return the visible shapes of the arm, per body, in the order of `Carrier.bodies_m`."""
        ...


@runtime_checkable
class BatchBackend(Protocol):
    """An engine that simulates many chains at once; `settle_each` and `roll_each` are the sequential ways."""

    def settle_batch(self, cases: Sequence[Case]) -> tuple[Equilibrium, ...]:
        """Return the equilibria of many chains, each from its straight state."""
        ...

    def rollout_batch(self, runs: Sequence[Run]) -> tuple[Rollout, ...]:
        """Simulate many chains through their histories, from rest at the first sample."""
        ...


def settle_each(backend: PhysicsBackend, cases: Sequence[Case]) -> tuple[Equilibrium, ...]:
    """Return the equilibria of many chains, each from its straight state, one after another."""
    found = []
    for case in cases:
        with backend.build(case.chain) as simulation:
            simulation.apply(case.inputs)
            found.append(simulation.settle())
    return tuple(found)


def roll_each(backend: PhysicsBackend, runs: Sequence[Run]) -> tuple[Rollout, ...]:
    """Simulate many chains through their histories, from rest at the first sample, one after another."""
    return tuple(_roll(backend, run) for run in runs)


def _roll(backend: PhysicsBackend, run: Run) -> Rollout:
    history = run.history
    if history.time_s is None:
        raise ContractError(f"run '{history.run}' has no times")
    positions, markers = [], []
    with backend.build(run.chain) as simulation:
        for k in range(len(history)):
            simulation.apply(history.at(k))
            simulation.step(float(history.time_s[k] - history.time_s[k - 1]) if k else 0.0)
            positions.append(simulation.snapshot().position)
            markers.append(simulation.markers())
    actuation = np.stack([history.actuation[name] for name in history.actuation], axis=1)
    return Rollout(history.time_s, actuation, np.array(positions), np.array(markers))
