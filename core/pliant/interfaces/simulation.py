"""Simulations that an engine builds: of one chain, of an equilibrium only, of a scene with contact."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Self

import numpy as np

from pliant.errors import ContractError
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.mount import Carrier
from pliant.records.rollout import Equilibrium, Inputs, OutsideDomain, Response, Sensitivity
from pliant.records.scene import Contact, Scene, SceneState

# Half-width of central differences, relative to the input.
DIFFERENCE = 1e-3


@dataclass(frozen=True, eq=False)
class SimulationState:
    """Snapshot: time, joint coordinates (n, a), their rates (n, a), memory of law terms (n, a, states).

    `carrier`: the engine's internal state of the arm on which the chain is mounted.
    """

    time_s: float
    position: Array
    velocity: Array
    memory: Array | None = None
    carrier: Array | None = None


class EngineHandle:
    """Context manager that frees an engine's resources at the end of a `with` block."""

    def close(self) -> None:
        """Free the engine's resources."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Simulation(EngineHandle, ABC):
    """Simulation of one chain in one engine. Tasks drive it: `apply`, then `settle` or `step`, then read `markers`.

    The pressure or load given to `apply` is constant until the next `apply`. The interface uses SI and the
    conventions of docs/conventions.md; scaling and quaternion order are internal.
    """

    chain: ChainModel

    @abstractmethod
    def apply(self, inputs: Inputs) -> None:
        """Set actuation and loads from now on."""

    @abstractmethod
    def settle(self) -> Equilibrium:
        """Return the static equilibrium under the present inputs, reached from the present state.

        Never raises for lack of convergence: `converged` is then False and `residual` is the unbalanced effort.
        """

    @abstractmethod
    def step(self, duration_s: float) -> None:
        """Advance by `duration_s`, in as many internal steps as the engine needs."""

    def advance(self, duration_s: float) -> bool:
        """Advance by `step`, or by `settle` for an infinite duration.

        Returns:
            whether the resulting state is valid; True if the engine cannot determine it.
        """
        if math.isinf(duration_s):
            return self.settle().converged
        self.step(duration_s)
        return True

    @abstractmethod
    def snapshot(self) -> SimulationState:
        """Return the present state, which `restore` reproduces exactly."""

    @abstractmethod
    def restore(self, state: SimulationState) -> None:
        """Return to a snapshot."""

    @abstractmethod
    def markers(self) -> Array:
        """Return (n + 2, 3) positions of base, joints 1…n and tip in the world, from the engine's own state.

        A joint's marker is the origin of its child body: on a prismatic joint it moves with q.
        """

    def carrier(self) -> Carrier | None:
        """Return the present pose of the arm that carries the chain; None if its base is fixed in the world."""
        return None

    def sensitivity(self) -> Sensitivity:
        """Return the derivatives of the equilibrium of the last `settle`.

        Raises:
            UserError: the last `settle` did not converge, or ended at a singular stiffness.
        """
        raise ContractError(f"{type(self).__name__} has no gradients (Capabilities.gradients is False)")

    def respond(self, inputs: Inputs, start: Array | None = None) -> Response:
        """Return the equilibrium under these inputs with its slopes by the actuations.

        It uses `settle` and `sensitivity`, or differences of settled states if the engine has no gradients.

        Args:
            inputs: actuation and loads.
            start: (n, a) joint coordinates of the initial state, if the engine supports it.
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

    def _differences(self, inputs: Inputs, equilibrium: Equilibrium) -> Response:
        """Return the response by central differences of settled states."""
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
        return self._response(equilibrium, np.array(by_input), np.array(turned))

    def _response(self, equilibrium: Equilibrium, by_input: Array, turned: Array | None) -> Response:
        pose = ChainGeometry.from_chain(self.chain).forward(equilibrium.joint_angles)
        spin = np.zeros((len(by_input), 3))
        geometry = ChainGeometry.from_chain(self.chain)
        if turned is not None and geometry.turns:
            spin = np.einsum(
                "nia,kna->ki", pose.directions[:, :, : geometry.slide], turned[..., : geometry.slide]
            )
        parts = (equilibrium.joint_angles, equilibrium.markers_m, by_input, pose.rotations[-1], spin)
        return Response(*parts, turned is not None, not equilibrium.outside_domain)


class StaticSimulation(Simulation):
    """A simulation whose only state is its joint coordinates; an engine of equilibria implements `apply` and `settle`.

    Attributes:
        q: (n, a) present joint coordinates, which `settle` replaces.
        time_s: sum of the durations of all steps.
    """

    def __init__(self, chain: ChainModel) -> None:
        self.chain = chain
        self.q: Array = np.zeros((chain.n_joints, len(chain.axes)))
        self.time_s = 0.0

    def step(self, duration_s: float) -> None:
        self.time_s += duration_s
        self.settle()

    def snapshot(self) -> SimulationState:
        return SimulationState(self.time_s, self.q.copy(), np.zeros_like(self.q))

    def restore(self, state: SimulationState) -> None:
        self.time_s, self.q = state.time_s, state.position.copy()

    def markers(self) -> Array:
        return ChainGeometry.from_chain(self.chain).markers(self.q)


class SceneSimulation(EngineHandle, ABC):
    """Simulation of a scene in one engine. Tasks call `apply`, `carry`, `step`, then read markers, contacts, state.

    Values given to `apply`, `carry` and `push` are constant until the next call of the same method. The interface uses
    SI and docs/conventions.md; scaling, quaternion order and the engine's friction rule are internal.
    """

    scene: Scene

    @abstractmethod
    def apply(self, inputs: Sequence[Inputs]) -> None:
        """Set actuation and loads of each arm from now on."""

    @abstractmethod
    def carry(self, velocity_m_s: Array) -> None:
        """Move the carriage with all arms' bases at this velocity (3,), regardless of contacts."""

    @abstractmethod
    def push(self, index: int, force_n: Array, moment_n_m: Array | None = None) -> None:
        """Apply a dead wrench (world) to object `index` at its centre of mass from now on."""

    @abstractmethod
    def step(self, duration_s: float) -> None:
        """Advance by `duration_s`, in as many internal steps as the engine needs.

        Raises:
            UserError: the motion is unbounded; the message states what to change.
        """

    @abstractmethod
    def snapshot(self) -> SceneState:
        """Return the present state; after `restore` the same steps give exactly the same motion."""

    @abstractmethod
    def restore(self, state: SceneState) -> None:
        """Return to a snapshot."""

    @abstractmethod
    def markers(self, arm: int) -> Array:
        """Return (n + 2, 3) positions of base, joints and tip of an arm in the world."""

    @abstractmethod
    def contacts(self) -> tuple[Contact, ...]:
        """Return the contacts at the end of the last step, with the forces of that step."""

    @abstractmethod
    def outside_domain(self) -> tuple[OutsideDomain, ...]:
        """Return where laws are used outside their domain at present; joints are numbered across all arms."""

    def pose(self, arm: int) -> Equilibrium:
        """Return the present pose of an arm for `TaskResult.final`; its residual is NaN because of contact forces."""
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
