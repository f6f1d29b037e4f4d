"""An episode: take hold, lift if the object is carried, turn cycle by cycle, rest; and what was commanded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.simulation import SceneSimulation
from pliant.records.design import Array
from pliant_plugins.tasks.grasp.episode import phases
from pliant_plugins.tasks.hold_and_turn.config import HoldAndTurnConfig, TurnConfig, WaveConfig
from pliant_plugins.tasks.scene_record import SceneRecord

FRAME_S = 0.02  # between frames, at which the inputs change
LOOK_FRAMES = 10  # between looks at the laws' domains
SAMPLES = 48  # of a wave in its period

Levels = list[dict[str, float]]  # inputs of each finger


@dataclass(frozen=True)
class Command:
    """Inputs of each finger that are reached linearly within a duration, while the carriage moves."""

    name: str
    duration_s: float
    levels: Levels
    velocity_m_s: Array = field(default_factory=lambda: np.zeros(3))


def holding(config: HoldAndTurnConfig, grip: Mapping[str, float]) -> tuple[Command, ...]:
    """Return the commands that bring the object into the hand: the grasp's phases, without the lift on a table."""
    skipped = {"final", *(("lift",) if config.support == "table" else ())}
    skipped |= {"lower"} if config.lower_height_m == 0.0 else set()

    def levels(share: float) -> Levels:
        return [{name: share * value for name, value in grip.items()}] * config.fingers

    taken = (phase for phase in phases(config) if phase.name not in skipped)
    return tuple(Command(p.name, p.duration_s, levels(p.end), p.velocity_m_s) for p in taken)


def cycle(config: HoldAndTurnConfig, grip: Mapping[str, float]) -> tuple[Command, ...]:
    """Return the commands of one cycle; the first one of waves, "start", brings the inputs to their start.

    Raises:
        UserError: an input that the chain does not have.
    """
    turn = config.turn
    named = {name for one in turn.keyframes for inputs in one.inputs for name in inputs}
    unknown = sorted((named | {wave.input for wave in turn.waves}) - set(grip))
    if unknown:
        raise UserError(
            f"task.turn drives {', '.join(unknown)}, and the chain's inputs are {', '.join(grip)}: use these names."
        )
    now: Levels = [dict(grip)] * config.fingers
    if turn.waves:
        times = np.linspace(0.0, turn.period_s, SAMPLES + 1).tolist()
        start = Command("start", config.ramp_time_s, _waved(turn, now, 0.0))
        return (start, *(Command("turn", b - a, _waved(turn, now, b)) for a, b in pairwise(times)))
    commands, before = [], 0.0
    for frame in turn.keyframes:
        now = [{**one, **frame.inputs[k % len(frame.inputs)]} for k, one in enumerate(now)]
        commands.append(Command("turn", frame.time_s - before, now))
        before = frame.time_s
    return tuple(commands)


def _waved(turn: TurnConfig, grip: Levels, time_s: float) -> Levels:
    def value(wave: WaveConfig, finger: int) -> float:
        mean = grip[finger][wave.input] if wave.mean is None else wave.mean
        phase = wave.phases_rad[finger % len(wave.phases_rad)]
        return mean + wave.amplitude * float(np.sin(2 * np.pi * time_s / turn.period_s + phase))

    return [{**one, **{w.input: value(w, k) for w in turn.waves}} for k, one in enumerate(grip)]


@dataclass(eq=False)
class Episode:
    """What was seen and commanded.

    Attributes:
        record: states, contacts and markers of each frame.
        inputs: of each frame and finger.
        ends: index of the frame at which the turning begins, and of the last one of each cycle.
    """

    record: SceneRecord
    inputs: list[Levels]
    ends: list[int] = field(default_factory=list)

    @property
    def last(self) -> int:
        """Return the index of the last frame of the turning, without the rest after it."""
        return self.ends[-1]

    def follow(self, simulation: SceneSimulation, command: Command) -> None:
        """Carry out a command and record its frames."""
        simulation.carry(command.velocity_m_s)
        frames, before = max(1, round(command.duration_s / FRAME_S)), self.inputs[-1]
        for levels in _between(before, command.levels, frames):
            self.record.drive(simulation, levels, None, command.duration_s / frames, 1)
            self.inputs.append(levels)


def _between(before: Levels, after: Levels, frames: int) -> Iterator[Levels]:
    for k in range(frames):
        share = (k + 1) / frames
        yield [
            {name: one[name] + share * (value - one[name]) for name, value in other.items()}
            for one, other in zip(before, after, strict=True)
        ]


def take_hold(simulation: SceneSimulation, config: HoldAndTurnConfig, grip: Mapping[str, float]) -> Episode:
    """Drive a scene at rest until the object is in the hand."""
    record = SceneRecord(simulation.scene, LOOK_FRAMES)
    episode = Episode(record, [[dict.fromkeys(grip, 0.0)] * config.fingers])
    record.see(simulation)
    for command in holding(config, grip):
        episode.follow(simulation, command)
    simulation.carry(np.zeros(3))
    episode.ends.append(len(episode.inputs) - 1)
    return episode


def play(simulation: SceneSimulation, config: HoldAndTurnConfig, grip: Mapping[str, float]) -> Episode:
    """Drive a scene at rest through the whole task."""
    turning = cycle(config, grip)  # a wrong name is reported before anything moves
    episode = take_hold(simulation, config, grip)
    for number in range(config.turn.cycles):
        for command in turning:
            if command.name == "turn" or number == 0:
                episode.follow(simulation, command)
        episode.ends.append(len(episode.inputs) - 1)
    episode.follow(simulation, Command("final", config.final_time_s, episode.inputs[-1]))
    episode.record.look(simulation)
    return episode
