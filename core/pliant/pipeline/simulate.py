"""Stage 4: simulation of a chain in an engine, under a task, with effects."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pliant.config.noise import UncertaintyConfig
from pliant.errors import UserError
from pliant.interfaces.effect import Effect, EffectConfig, Model
from pliant.interfaces.physics import PhysicsBackend, PhysicsConfig, SceneBackend, StaticSceneBackend
from pliant.interfaces.simulation import SceneSimulation, Simulation, SimulationState
from pliant.interfaces.task import SceneEngine, SceneTask, Task, TaskConfig
from pliant.mechanics.law_draws import draws
from pliant.mechanics.shared_actuation import shared, unshared
from pliant.pipeline.engine_checks import check_asked, check_capabilities, check_terms
from pliant.pipeline.workbench import RunContext, content
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.law import JointLaw
from pliant.records.mount import Carrier
from pliant.records.rollout import Equilibrium, Inputs, OutsideDomain, TaskResult
from pliant.records.scene import Contact, SceneState
from pliant.registry.component import Component
from pliant.store.store import Artifact


class Commands:
    """Commands over time and the inputs after the effects' input maps, which use whole histories from the start."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._time_s = 0.0
        self._past: list[tuple[float, Inputs]] = []
        self._present: Inputs | None = None

    def give(self, inputs: Inputs) -> Inputs:
        """Set a new command and return its inputs after a long wait."""
        self._present = inputs
        return self._acting(())

    def wait(self) -> Inputs | None:
        """Hold the present command so long that its history is discarded; return the resulting inputs."""
        self._past = [] if self._present is None else [(self._time_s, self._present)]
        return None if self._present is None else self._acting(())

    def pass_time(self, duration_s: float) -> Inputs | None:
        """Advance the time with the present command and return the inputs at the end of the step."""
        self._time_s += duration_s
        if self._present is None:
            return None
        acting = self._acting(self._past)
        self._past.append((self._time_s, self._present))
        return acting

    def go_back(self, time_s: float) -> None:
        """Discard the commands after this time."""
        self._time_s = time_s
        self._past = [entry for entry in self._past if entry[0] <= time_s]

    def _acting(self, past: Sequence[tuple[float, Inputs]]) -> Inputs:
        assert self._present is not None
        commands = [*past, (self._time_s, self._present)]
        history = History.from_arrays(
            {n: np.array([inputs.actuation[n] for _, inputs in commands]) for n in self._present.actuation},
            np.array([time_s for time_s, _ in commands]) if past else None,
            tip_force_n=np.array([inputs.tip_force_n for _, inputs in commands]),
            moment_n_m=np.array([inputs.moment_n_m for _, inputs in commands]),
        )
        acting = self._model.commanded(history).at(-1)
        return replace(acting, forces=self._present.forces, cords=self._present.cords)


class WithInputs(Simulation):
    """A simulation whose inputs pass through the effects' input maps; `settle` waits until they are constant."""

    def __init__(self, inner: Simulation, model: Model) -> None:
        self.inner, self.chain = inner, inner.chain
        self._commands = Commands(model)

    def apply(self, inputs: Inputs) -> None:
        self.inner.apply(self._commands.give(inputs))

    def settle(self) -> Equilibrium:
        acting = self._commands.wait()
        if acting is not None:
            self.inner.apply(acting)
        return self.inner.settle()

    def step(self, duration_s: float) -> None:
        self._let_pass(duration_s)
        self.inner.step(duration_s)

    def advance(self, duration_s: float) -> bool:
        if math.isinf(duration_s):
            return self.settle().converged
        self._let_pass(duration_s)
        return self.inner.advance(duration_s)

    def _let_pass(self, duration_s: float) -> None:
        """Set the inputs of the inner simulation at the end of a step."""
        acting = self._commands.pass_time(duration_s)
        if acting is not None:
            self.inner.apply(acting)

    def snapshot(self) -> SimulationState:
        return self.inner.snapshot()

    def restore(self, state: SimulationState) -> None:
        self._commands.go_back(state.time_s)
        self.inner.restore(state)

    def markers(self) -> Array:
        return self.inner.markers()

    def carrier(self) -> Carrier | None:
        return self.inner.carrier()


class SceneWithInputs(SceneSimulation):
    """A scene whose arms' inputs pass through the effects' input maps, each arm with its own history."""

    def __init__(self, inner: SceneSimulation, model: Model) -> None:
        self.inner, self.scene = inner, inner.scene
        self._commands = [Commands(model) for _ in inner.scene.arms]

    def apply(self, inputs: Sequence[Inputs]) -> None:
        pairs = zip(self._commands, inputs, strict=True)
        self.inner.apply([commands.give(given) for commands, given in pairs])

    def step(self, duration_s: float) -> None:
        acting = [commands.pass_time(duration_s) for commands in self._commands]
        given = [inputs for inputs in acting if inputs is not None]
        if given:  # all arms are commanded at once
            self.inner.apply(given)
        self.inner.step(duration_s)

    def restore(self, state: SceneState) -> None:
        for commands in self._commands:
            commands.go_back(state.time_s)
        self.inner.restore(state)

    def carry(self, velocity_m_s: Array) -> None:
        self.inner.carry(velocity_m_s)

    def push(self, index: int, force_n: Array, moment_n_m: Array | None = None) -> None:
        self.inner.push(index, force_n, moment_n_m)

    def snapshot(self) -> SceneState:
        return self.inner.snapshot()

    def markers(self, arm: int) -> Array:
        return self.inner.markers(arm)

    def contacts(self) -> tuple[Contact, ...]:
        return self.inner.contacts()

    def outside_domain(self) -> tuple[OutsideDomain, ...]:
        return self.inner.outside_domain()

    def pose(self, arm: int) -> Equilibrium:
        return self.inner.pose(arm)

    def close(self) -> None:
        self.inner.close()


@dataclass(frozen=True)
class ChainSource:
    """A chain with its inputs, for the keys of artifacts derived from it."""

    chain: ChainModel
    config: Mapping[str, Any]
    inputs: Mapping[str, str]
    components: Sequence[Component]


def simulate_stage(
    context: RunContext,
    source: ChainSource,
    physics: PhysicsConfig,
    task: TaskConfig,
    effects: Sequence[EffectConfig],
    uncertainty: UncertaintyConfig | None = None,
) -> Artifact:
    """Run the task; the artifact's value is a `TaskResult`.

    With `uncertainty`, the task is run with `samples` chains of drawn laws, and the value is the dict of `spread`.

    Raises:
        MissingDependencyError: an engine that is not installed.
        UserError: a chain that the engine cannot simulate, or whose laws state no error to draw from.
    """
    backend: PhysicsBackend = context.build("physics", physics)
    built_task: Task | SceneTask = context.build("task", task)
    built_effects: list[Effect] = [context.build("effect", effect) for effect in effects]
    check_capabilities(backend, source.chain, physics.kind)

    def nominal(partial: Path) -> TaskResult:
        if sentence := backend.preparing(source.chain, histories=False):
            context.progress.note(sentence)
        return run_task(backend, built_task, built_effects, source.chain)

    compute: Callable[[Path], Any] = nominal
    stage, more = "simulate", {}
    if uncertainty is not None:
        drawn, level = drawn_chains(source.chain, uncertainty.samples, uncertainty.seed), uncertainty.level

        def with_drawn_laws(partial: Path) -> dict[str, Any]:
            bar, results = context.progress.begin("drawn laws", len(drawn)), []
            try:
                for chain in drawn:
                    results.append(run_task(backend, built_task, built_effects, chain))
                    bar.advance()
            finally:
                bar.finish()
            return spread(results, level)

        stage, compute, more = "uncertainty", with_drawn_laws, {"uncertainty": content(uncertainty)}
    plugins = [("physics", physics), ("task", task), *(("effect", effect) for effect in effects)]
    return context.make(
        stage,
        compute,
        components=[*source.components, *(context.component(name, config) for name, config in plugins)],
        modules=["pliant.pipeline.simulate", "pliant.pipeline.chain"],
        config={
            **source.config,
            "physics": content(physics),
            "task": content(task),
            "effects": [content(effect) for effect in effects],
            **more,
        },
        inputs=source.inputs,
    )


def run_task(
    backend: PhysicsBackend, task: Task | SceneTask, effects: Sequence[Effect], chain: ChainModel
) -> TaskResult:
    """Apply the effects to the prepared chain, simulate it under the task, map the result.

    Raises:
        UserError: the engine cannot simulate it, or a joint leaves its law's data and the task forbids that.
    """
    model = Model(task.prepare(chain))
    for effect in effects:
        model = effect.apply(model)
    check_terms(backend, model.chain)
    check_asked(backend, task)
    if isinstance(task, SceneTask):
        result = task.run(model.chain, scene_engine(backend, model))
    else:
        with backend.build(model.chain) as simulation:
            result = task.run(WithInputs(simulation, model) if model.inputs else simulation)
    if task.config.outside_domain == "error":
        refuse_extrapolation(result.final.outside_domain)
    # Output maps may depend on the sum of the last inputs; a task may leave no history.
    last = -1 if result.last_held is None else result.last_held
    acting = {} if result.rollout is None else {"actuation": float(np.sum(result.rollout.actuation[last]))}
    reported = model.reported({**result.metrics, **acting}) if effects else result.metrics
    metrics = {name: reported[name] for name in reported if name != "actuation"}
    if isinstance(task, Task):
        metrics |= task.against_readings(model.chain, result, model.reported)
    return replace(result, metrics=metrics)


def refuse_extrapolation(outside: Sequence[OutsideDomain]) -> None:
    """Raise `UserError` that names the entry furthest outside its law's domain."""
    if not outside:
        return
    worst = max(outside, key=lambda entry: abs(entry.excess))
    raise UserError(
        f"joint {worst.module} leaves the domain of its law: {worst} at time {worst.time_s:.3g} of the task"
        f"{f', and {len(outside) - 1} more' if len(outside) > 1 else ''}. Give the law data there, load the chain "
        "less, or set 'outside_domain: report' in the task."
    )


def scene_engine(backend: PhysicsBackend, model: Model) -> SceneEngine:
    """Return the engine's scenes, preceded by the effects' input maps."""
    if isinstance(backend, SceneBackend):
        build: SceneEngine = backend.build_scene
    else:
        assert isinstance(backend, StaticSceneBackend)  # by `check_asked`
        build = backend.build_static_scene
    return (lambda scene: SceneWithInputs(build(scene), model)) if model.inputs else build


def drawn_chains(chain: ChainModel, count: int, seed: int) -> list[ChainModel]:
    """Return chains whose laws are drawn from their error bars; laws without an error bar are unchanged.

    Raises:
        UserError: no law states an error.
    """
    if not any(law.states_error for law in chain.laws):
        raise UserError(
            "'uncertainty' needs a law with an error bar, and the laws of this chain state none (laws of given "
            "coefficients have none); fit the law to data or leave the block out."
        )
    # one random stream for each law, so that laws of one seed are independent
    inside = list(dict.fromkeys(unshared(law)[0] for law in chain.laws))
    seeds = np.random.SeedSequence(seed).generate_state(len(inside))
    drawn = {
        law: (law,) * count if not law.states_error else draws(law, count, int(own))
        for law, own in zip(inside, seeds, strict=True)
    }

    def nth(law: JointLaw, number: int) -> JointLaw:
        """Return the draw of a law; segments with different shares of the actuation share one law and one error."""
        own, share = unshared(law)
        return shared(drawn[own][number], share)

    return [chain.with_(laws=tuple(nth(law, number) for law in chain.laws)) for number in range(count)]


def spread(results: Sequence[TaskResult], level: float) -> dict[str, Any]:
    """Return statistics of the results of drawn laws.

    `tips_m` (n, 3) of the runs that settled; `tip_low_m`, `tip_high_m` (3,) the interval that contains the share
    `level` of them in each coordinate; `tip_radius_m` of the ball about their mean `tip_mean_m` with the same share;
    `metrics`: name → low and high of each number that the task measures; `failed`: runs that did not settle.
    """
    settled = [r for r in results if r.final.converged and not r.not_reached]
    sides = [(1 - level) / 2, (1 + level) / 2]
    tips = np.array([r.final.tip_m for r in settled]).reshape(-1, 3)
    told: dict[str, Any] = {
        "level": level,
        "samples": len(results),
        "failed": len(results) - len(settled),
        "tips_m": tips,
    }
    if not settled:
        return told
    low, high = np.quantile(tips, sides, axis=0)
    mean = tips.mean(axis=0)
    radius = float(np.quantile(np.linalg.norm(tips - mean, axis=1), level))
    told |= {"tip_mean_m": mean, "tip_low_m": low, "tip_high_m": high, "tip_radius_m": radius, "metrics": {}}
    for name in settled[0].metrics:  # metrics that are single numbers in every run
        values: list[Any] = [one.metrics.get(name) for one in settled]
        if all(isinstance(v, float | int) and not isinstance(v, bool) for v in values):
            low, high = map(float, np.quantile(values, sides))
            told["metrics"][name] = {"low": low, "high": high, "sd": float(np.std(values, ddof=1))}
    return told
