"""PhysicsBackend: an engine that simulates a chain."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import ClassVar

from pliant.errors import ContractError
from pliant.interfaces.base import ComponentConfig
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import Followed, History
from pliant.records.law import JointKind
from pliant.records.rollout import Equilibrium, Inputs


class PhysicsConfig(ComponentConfig):
    """Base of an engine's config."""


@dataclass(frozen=True)
class Capabilities:
    """What an engine can do; the pipeline asks before it builds.

    Attributes:
        joints: kinds of joints it simulates.
        dynamic: `step` advances inertia and damping; otherwise each step is an equilibrium.
        internal_states: law terms that need time or memory are followed, and `follow` is there.
    """

    joints: tuple[JointKind, ...]
    dynamic: bool
    internal_states: bool = False


@dataclass(frozen=True, eq=False)
class SimulationState:
    """Snapshot: time, joint coordinates (n, a), their rates (n, a), memory of law terms (n, a, states)."""

    time_s: float
    position: Array
    velocity: Array
    memory: Array | None = None


class Simulation(ABC):
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

    def close(self) -> None:  # noqa: B027 - an engine without resources has nothing to free
        """Free the engine's resources."""

    def __enter__(self) -> Simulation:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


@dataclass(frozen=True, eq=False)
class Variation:
    """A chain and the histories that reach it, a small step away from another."""

    chain: ChainModel
    histories: tuple[History, ...]


class PhysicsBackend(ABC):
    """An engine. The simulate stage calls `build` once per chain; one backend may build many."""

    capabilities: ClassVar[Capabilities]

    def __init__(self, config: PhysicsConfig) -> None:
        self.config = config

    @abstractmethod
    def build(self, chain: ChainModel) -> Simulation:
        """A simulation at rest: joint coordinates 0, no actuation, no velocity."""

    def preparing(self, chain: ChainModel) -> str | None:
        """A sentence for the user where the first `follow` of this chain will take long, once; else None."""
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
