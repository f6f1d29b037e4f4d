"""The record of a task in a scene: states, contacts and markers at each frame, and laws outside their data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pliant.interfaces.simulation import SceneSimulation
from pliant.mechanics.stills import still
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, Inputs, OutsideDomain
from pliant.records.scene import Contact, Scene, SceneFrames, SceneState, SceneStill


@dataclass(eq=False)
class SceneRecord:
    """What was seen of one scene: per frame its state, its contacts and each arm's markers (n + 2, 3).

    The arms' poses and the laws' domains are looked at in every `every`-th frame.
    """

    scene: Scene
    every: int = 1
    states: list[SceneState] = field(default_factory=list)
    contacts: list[tuple[Contact, ...]] = field(default_factory=list)
    markers_m: list[list[Array]] = field(default_factory=list)
    outside: dict[tuple[int, str], OutsideDomain] = field(default_factory=dict)
    final: Equilibrium | None = None
    settled: bool = True

    def see(self, simulation: SceneSimulation) -> None:
        """Record the present instant."""
        arms = range(len(self.scene.arms))
        self.states.append(simulation.snapshot())
        self.contacts.append(simulation.contacts())
        self.markers_m.append([simulation.markers(k) for k in arms])
        if len(self.states) % self.every == 0:
            self.look(simulation)

    def look(self, simulation: SceneSimulation) -> None:
        """Record the arms' poses, and where laws are used outside their domains at present."""
        for entry in simulation.outside_domain():
            key = (entry.module, entry.variable)
            if key not in self.outside or abs(entry.excess) > abs(self.outside[key].excess):
                self.outside[key] = entry
        poses = [simulation.pose(k) for k in range(len(self.scene.arms))]
        self.final, self.settled = poses[0], all(pose.converged for pose in poses)

    def drive(
        self,
        simulation: SceneSimulation,
        inputs: Sequence[Mapping[str, float]],
        before: Sequence[Mapping[str, float]] | None,
        duration_s: float,
        frames: int,
    ) -> None:
        """Ramp each arm's inputs from the earlier ones (0 without any) within the duration, and record `frames`."""
        for k in range(frames):
            share = (k + 1) / frames
            given = [
                {name: _between(_earlier(before, arm, name), value, share) for name, value in full.items()}
                for arm, full in enumerate(inputs)
            ]
            simulation.apply([Inputs(one) for one in given])
            simulation.step(duration_s / frames)
            self.see(simulation)

    def hold(self, simulation: SceneSimulation, duration_s: float, frames: int) -> None:
        """Step with the present inputs, and record `frames`."""
        for _ in range(frames):
            simulation.step(duration_s / frames)
            self.see(simulation)

    def equilibrium(self, wall_s: float) -> Equilibrium:
        """Return the first arm at the end, with every use of a law outside its data during the task."""
        assert self.final is not None
        entries = tuple(self.outside[key] for key in sorted(self.outside))
        return replace(
            self.final,
            converged=self.settled,
            iterations=len(self.states) - 1,
            wall_s=wall_s,
            outside_domain=entries,
        )

    def tip_speed_m_s(self) -> float:
        """Return the mean speed of the fastest tip between the last two frames."""
        passed = self.states[-1].time_s - self.states[-2].time_s
        moved = zip(self.markers_m[-1], self.markers_m[-2], strict=True)
        return max(float(np.linalg.norm(now[-1] - then[-1])) for now, then in moved) / passed

    @property
    def frames(self) -> SceneFrames:
        """The motion, for pictures."""
        return SceneFrames.from_states(self.states)

    def still(self, index: int, label: str) -> SceneStill:
        """Return one instant, for pages."""
        return still(self.scene, self.states[index], label)


def pressing_n(contacts: Sequence[Contact], kind: str = "obstacle") -> float:
    """Return Σ of the normal forces (N) between arms and bodies of a kind."""
    return sum(c.normal_n for c in contacts if {c.first.kind, c.second.kind} == {"arm", kind})


def force_on_n(contacts: Sequence[Contact], kind: str = "obstacle") -> Array:
    """Return (3,) the total force (N) of arms on bodies of a kind, which come second."""
    forces = [c.normal_n * c.normal + c.friction_n for c in contacts if c.second.kind == kind]
    forces += [-c.normal_n * c.normal - c.friction_n for c in contacts if c.first.kind == kind]
    return np.asarray(np.sum(forces, axis=0)) if forces else np.zeros(3)


def _earlier(before: Sequence[Mapping[str, float]] | None, arm: int, name: str) -> float:
    return before[arm].get(name, 0.0) if before is not None else 0.0


def _between(start: float, end: float, share: float) -> float:
    return start + share * (end - start)
