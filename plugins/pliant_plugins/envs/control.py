"""Control by what a bench measures: bring the tip to a point, or along a path, in one of several possible robots.

``gymnasium.make("pliant/Reach-v0", study="finger.yaml", worlds=16)``, and so ``Track``.
"""

from __future__ import annotations

from abc import abstractmethod
from collections import deque
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from pliant.api import OpenStudy
from pliant.diagnosis.kept_posterior import kept_posterior
from pliant.errors import UserError
from pliant.interfaces.effect import Model
from pliant.interfaces.physics import PhysicsBackend
from pliant.interfaces.simulation import Simulation, SimulationState
from pliant.pipeline.motion import prepared_model
from pliant.pipeline.simulate import WithInputs, drawn_chains
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant_plugins.envs.base import OBSERVED
from pliant_plugins.envs.chain_env import LEAST_SHARE, ChainEnv, points_option


@dataclass(frozen=True)
class Evidence:
    """The uncertainty of a robot about its nominal model.

    Attributes:
        models: drawn chains with the task's loads and the effects applied, maps of inputs included.
        noise_m: standard deviation of a reading of the tip's coordinates, from the posterior's noise; 0 without one.
    """

    models: tuple[Model, ...]
    noise_m: float


def evidence(opened: OpenStudy, count: int, seed: int) -> Evidence:
    """Draw `count` chains.

    Raises:
        UserError: the study has no `posterior`, and its laws state no error.
    """
    study, context = opened.study, opened.context
    nominal = prepared_model(context, study)[0].chain
    kept = kept_posterior(context.registry, study)
    has_bars = any(law.states_error for law in nominal.laws)
    if count and kept is None and not has_bars:
        raise UserError(
            f"worlds is {count}, and the study states no uncertainty: it has no 'posterior' block (pliant extend "
            "and improve write it), and its laws state no error (fitted laws do)."
        )
    varied = [study] * count
    if kept is not None and count:
        posterior = kept.posterior
        varied = [
            study.model_copy(update={"effects": posterior.candidate.configs(x)})
            for x in posterior.draws(count, seed)
        ]
    models = [prepared_model(context, one)[0] for one in varied]
    if has_bars:
        seeds = np.random.SeedSequence(seed).generate_state(max(count, 1))
        drawn = (drawn_chains(one.chain, 1, int(own))[0] for one, own in zip(models, seeds, strict=False))
        models = [one.with_(chain=chain) for one, chain in zip(models, drawn, strict=True)]
    noise = {} if kept is None else {name: one.floor for name, one in kept.scatter.items()}
    tips = [value for name, value in noise.items() if name.startswith(("tip_", "marker_"))]
    angle = noise.get("angle_rad", 0.0) * nominal.length_m / 2  # of a bend that is even along the chain
    return Evidence(tuple(models), max([*tips, angle]))


MOST_WORLDS = 10_000
# A path is a sum of this number of sines of the actuation, the slowest of this period.
SINES, PERIOD_S = 3, 2.0
AHEAD = 3  # places of the path in the observation


class World(NamedTuple):
    """One possible robot: in the study's engine, at rest there, and its equilibria."""

    simulation: Simulation
    rest: SimulationState
    statics: Simulation
    straight: SimulationState


class MeasuredEnv(ChainEnv):
    """An environment that observes what a bench measures: the tip, with noise and delay, and the commanded actuation.

    Args in addition to those of all environments:
        worlds: number of robots drawn from the study's evidence (error bars of laws, posterior of effects), one of
            which each episode uses; 0: every episode uses the nominal one.
        world_seed: of the draws.
        noise_m: standard deviation of each coordinate of the tip; by default that of the study's posterior, else 0.
        delay_s: delay until a position of the tip is observed; whole control steps.

    Observation: the tip as measured now and one step before, from the base in chain lengths (6), the shares of the
    actuation, then the goal. Option `world`: which robot, from 0; −1 is the nominal one. `info`: `tip_m` (true),
    `measured_tip_m`, `target_m`, `error_m` (true), `world`.

    Attributes:
        late: control steps from a motion to its reading.
    """

    option_names: ClassVar[tuple[str, ...]] = ("target_m", "world")
    default_study: ClassVar[str] = "free_bending"

    def __init__(
        self,
        study: Any = None,
        *,
        worlds: int = 0,
        world_seed: int = 0,
        noise_m: float | None = None,
        delay_s: float = 0.0,
        **settings: Any,
    ) -> None:
        if not 0 <= worlds <= MOST_WORLDS:
            raise UserError(f"worlds is {worlds}; it needs a number from 0 to {MOST_WORLDS}.")
        if delay_s < 0.0 or (noise_m is not None and noise_m < 0.0):
            raise UserError(f"noise_m is {noise_m} and delay_s {delay_s}; neither may be negative.")
        self._asked = (worlds, world_seed, noise_m, delay_s)
        super().__init__(study, **settings)

    def _prepared(self) -> tuple[ChainModel, PhysicsBackend, Any]:
        self._model, backend, task = prepared_model(self.opened.context, self.opened.study)
        return self._model.chain, backend, task

    def _build(self) -> None:
        super()._build()
        count, seed, noise, delay = self._asked
        self.nominal = self._build_world(self._model)
        known = evidence(self.opened, count, seed)
        self.noise_m = known.noise_m if noise is None else noise
        self.late = round(delay / self.control_s)
        self._models, self._worlds = known.models, dict[int, World]()
        self._world = -1
        self._seen: deque[Array] = deque(maxlen=2)
        self._past: deque[Array] = deque(maxlen=self.late + 1)
        self._set_spaces(len(self.inputs), 6 + len(self.inputs) + self.goal_size)

    def _begin(self, options: dict[str, Any]) -> None:
        drawn = int(self.np_random.integers(len(self._models))) if self._models else -1
        given = options.get("world", drawn)
        if not (isinstance(given, int | np.integer) and -1 <= given < len(self._models)):
            raise UserError(
                f"option 'world' is {given!r}; there are {len(self._models)}, from 0; -1 is nominal."
            )
        self._world = int(given)
        here = self.nominal if self._world < 0 else self._made(self._world)
        self.simulation, self._rest, self._statics, self._straight = here
        super()._begin(options)
        self._past.clear()
        self._seen.clear()
        self._measure()
        self._seen.append(self._seen[0])

    def _advance(self, action: Array) -> bool:
        bounded = super()._advance(action)
        self._measure()
        return bounded

    def _measure(self) -> None:
        """Measure the position of the tip `delay_s` ago."""
        self._past.append(np.array(self._markers[-1]))
        noise = self.np_random.normal(0.0, 1.0, 3) * self.noise_m
        self._seen.append(self._past[0] + noise)

    def _made(self, number: int) -> World:
        """Return a world, built on first use."""
        if number not in self._worlds:
            self._worlds[number] = self._build_world(self._models[number])
        return self._worlds[number]

    def _build_world(self, model: Model) -> World:
        """Build a world behind the model's maps of inputs, if it has any."""
        simulation, statics = (
            WithInputs(engine.build(model.chain), model) if model.inputs else engine.build(model.chain)
            for engine in (self.backend, self._quasistatic())
        )
        return World(simulation, simulation.snapshot(), statics, statics.snapshot())

    @property
    def highest(self) -> Array:
        """(k,) the actuation that action +1 means."""
        return self._highest

    def equilibria(self) -> Simulation:
        """Return the nominal robot's equilibria for controllers, without effects of time."""
        lasting = tuple(term for term in self.chain.terms if not term.needs_time)
        return self._quasistatic().build(self.chain.with_(terms=lasting))

    def reaching(self, name: str, commanded: Array) -> Array:
        """Return the steady actuation (m,) of the nominal chain for values (m,) of one input, the others at 0."""
        values = {one: np.zeros(len(commanded)) for one in self.inputs} | {name: commanded}
        return np.asarray(self._model.commanded(History.from_arrays(values)).actuation[name])

    def _observed(self) -> OBSERVED:
        now, before = self._in_lengths(self._seen[-1]), self._in_lengths(self._seen[0])
        return self._clipped(now, before, self._share, self._goal())

    @abstractmethod
    def _target_now(self) -> Array:
        """Return the (3,) target of the tip."""

    def _error_m(self) -> float:
        return float(np.linalg.norm(self._markers[-1] - self._target_now()))

    def _metrics(self) -> dict[str, Any]:
        return {
            **super()._metrics(),
            "measured_tip_m": self._seen[-1].copy(),
            "target_m": self._target_now().copy(),
            "world": self._world,
        }

    def close(self) -> None:
        self.simulation, self._statics = self.nominal.simulation, self.nominal.statics
        for world in self._worlds.values():
            world.simulation.close()
            world.statics.close()
        self._worlds.clear()
        super().close()


class MeasuredReachEnv(MeasuredEnv):
    """``pliant/Reach-v0``: the target is where this episode's robot settles at a random actuation.

    Reward per step: −(distance of the tip to the target) / (chain length) − 0.01 (change of the actuation)².
    The goal in the observation is the target from the base in chain lengths (3). Option: `target_m`. See `MeasuredEnv`.
    """

    goal_size: ClassVar[int] = 3

    _target: Array = np.zeros(3)

    def _ask(self, options: dict[str, Any]) -> None:
        target = points_option(options, "target_m")
        share = self.np_random.uniform(LEAST_SHARE, 1.0, len(self.inputs))
        self._target = self._settled(share).tip_m.copy() if target is None else target

    def _goal(self) -> Array:
        return self._in_lengths(self._target)

    def _target_now(self) -> Array:
        return self._target


class MeasuredTrackEnv(MeasuredEnv):
    """``pliant/Track-v0``: the target moves along a path on which this episode's robot can settle.

    Each input's share is a sum of three sines of periods from 2 s down; the targets are where the tip settles there.
    The goal in the observation are the targets of the next three steps from the base in chain lengths (9). Option:
    `path_m`, points (k, 3), the target of each step from the start on, the last one held. Rewards as of
    `MeasuredReachEnv`, of the target of the moment. `info`: `ahead_m` (3, 3), the next targets. See `MeasuredEnv`.
    """

    goal_size: ClassVar[int] = 3 * AHEAD
    option_names: ClassVar[tuple[str, ...]] = ("path_m", "world")

    _path: Array = np.zeros((1, 3))

    def _ask(self, options: dict[str, Any]) -> None:
        path = points_option(options, "path_m", curve=True)
        shares = self._drawn_shares()
        self._path = np.array([self._settled(share).tip_m for share in shares]) if path is None else path

    def _drawn_shares(self) -> Array:
        """Draw (steps + 1, k) shares within 10 % to 100 %, starting at the mean."""
        time_s = self.control_s * np.arange(self.steps + 1)
        rates = 2 * np.pi * np.arange(1, SINES + 1) / PERIOD_S
        sizes = (
            self.np_random.uniform(-1.0, 1.0, (SINES, len(self.inputs))) / np.arange(1, SINES + 1)[:, None]
        )
        swing = np.sin(time_s[:, None] * rates) @ sizes
        swing /= np.maximum(np.abs(sizes).sum(axis=0), 1e-9)
        middle = 0.5 * (1.0 + LEAST_SHARE)
        return np.asarray(middle + (1.0 - middle) * swing)

    def _at(self, step: int) -> Array:
        return np.asarray(self._path[min(step, len(self._path) - 1)])

    def _ahead(self) -> Array:
        return np.array([self._at(self._taken + k) for k in range(1, AHEAD + 1)])

    def _goal(self) -> Array:
        return self._in_lengths(self._ahead())

    def _target_now(self) -> Array:
        return self._at(self._taken)

    def _metrics(self) -> dict[str, Any]:
        return {**super()._metrics(), "ahead_m": self._ahead()}
