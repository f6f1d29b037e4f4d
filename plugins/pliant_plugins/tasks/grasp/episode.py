"""One grasp: lower, actuate, hold, lift, hold; and its record."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from pliant.interfaces.simulation import SceneSimulation
from pliant.records.design import Array
from pliant.records.rollout import Inputs, OutsideDomain
from pliant.records.scene import Contact, SceneState
from pliant_plugins.tasks.grasp.config import GraspConfig, HandConfig

RECORD_S = 0.04  # between frames
COMMAND_S = 0.01  # between changes of the actuation on the ramp
DOMAIN_FRAMES = 5  # between looks at the laws' domains


@dataclass(frozen=True)
class Phase:
    """A part of the episode: the carriage's vertical speed, and the share of the actuation at start and end."""

    name: str
    duration_s: float
    rise_m: float = 0.0
    start: float = 1.0
    end: float = 1.0

    @property
    def velocity_m_s(self) -> Array:
        """(3,) velocity of the carriage in the phase."""
        return np.array([0.0, 0.0, self.rise_m / self.duration_s])

    def steps(self) -> Iterator[tuple[float, float, bool]]:
        """Yield (duration, share of the actuation in it, record a frame at its end) of each step."""
        ramps = self.start != self.end
        frames = max(1, round(self.duration_s / RECORD_S))
        parts = max(1, round(self.duration_s / frames / COMMAND_S)) if ramps else 1
        for k in range(frames * parts):
            share = self.start + (self.end - self.start) * (k + 1) / (frames * parts)
            yield self.duration_s / (frames * parts), share, (k + 1) % parts == 0


def phases(config: HandConfig) -> tuple[Phase, ...]:
    """Return the phases of the episode; those without duration are left out."""
    found = (
        Phase("lower", config.lower_time_s, -config.lower_height_m, 0.0, 0.0),
        Phase("actuate", config.ramp_time_s, 0.0, 0.0, 1.0),
        Phase("hold", config.hold_time_s),
        Phase("lift", config.lift_time_s, config.lift_height_m),
        Phase("final", config.final_time_s),
    )
    return tuple(phase for phase in found if phase.duration_s > 0)


@dataclass(eq=False)
class GraspEpisode:
    """The record of an episode: state and contacts at each frame, and the names of the phases that they end in."""

    states: list[SceneState] = field(default_factory=list)
    contacts: list[tuple[Contact, ...]] = field(default_factory=list)
    phase: list[str] = field(default_factory=list)
    outside: dict[tuple[int, str], OutsideDomain] = field(default_factory=dict)

    def see(self, simulation: SceneSimulation, phase: str) -> None:
        """Record the present instant; contacts only once the fingers are down."""
        self.states.append(simulation.snapshot())
        self.contacts.append(() if phase in ("start", "lower") else simulation.contacts())
        self.phase.append(phase)
        if len(self.states) % DOMAIN_FRAMES:
            return
        for entry in simulation.outside_domain():
            key = (entry.module, entry.variable)
            if key not in self.outside or abs(entry.excess) > abs(self.outside[key].excess):
                self.outside[key] = entry

    def last_frame(self, phase: str) -> int:
        """Return index of the last frame of a phase."""
        return len(self.phase) - 1 - self.phase[::-1].index(phase)

    def during(self, phase: str) -> list[int]:
        """Return indices of the frames of a phase."""
        return [k for k, name in enumerate(self.phase) if name == phase]


def play(simulation: SceneSimulation, config: GraspConfig, actuation: dict[str, float]) -> GraspEpisode:
    """Drive a scene at rest through all phases; `actuation` is the full value of each input of a finger."""
    episode = GraspEpisode()
    arms = len(simulation.scene.arms)
    episode.see(simulation, "start")
    for phase in phases(config):
        simulation.carry(phase.velocity_m_s)
        for duration_s, share, record in phase.steps():
            inputs = Inputs({name: share * value for name, value in actuation.items()})
            simulation.apply([inputs] * arms)
            simulation.step(duration_s)
            if record:
                episode.see(simulation, phase.name)
    return episode
