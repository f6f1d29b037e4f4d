"""A good task, hold at a pressure, and tasks that mislead."""

from dataclasses import replace
from typing import Any, Literal

import numpy as np

from broken import Variants
from pliant.interfaces.physics import Simulation
from pliant.interfaces.task import SceneEngine, SceneTask, Task, TaskConfig
from pliant.mechanics.stills import still
from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs, Rollout, TaskResult
from pliant.records.scene import Arm, Scene, SceneFrames
from pliant.registry.component import Component
from pliant.units import Mass, Pressure


class HoldConfig(TaskConfig):
    """A pressure and a payload."""

    kind: Literal["small"] = "small"
    pressure_pa: Pressure = 1e4
    payload_kg: Mass = 2e-3


class Hold(Task):
    """Actuate, settle, measure the tip."""

    config: HoldConfig

    def prepare(self, chain: ChainModel) -> ChainModel:
        return chain.with_(payload_kg=self.config.payload_kg)

    def run(self, simulation: Simulation) -> TaskResult:
        simulation.apply(self.inputs())
        final = simulation.settle()
        history = Rollout(np.zeros(1), np.full((1, 1), 1e4), final.joint_angles[None], final.markers_m[None])
        return TaskResult(final, {"tip_x_m": float(final.tip_m[0]), "levels": 1}, history)

    def inputs(self) -> Inputs:
        return Inputs({"pressure_pa": self.config.pressure_pa})


variants = Variants(Component("task", "small", "broken.task:HoldConfig", "broken.task:Hold", "hold"))


class Measured(Hold):
    """Changes the result after the good one made it."""

    def run(self, simulation: Simulation) -> TaskResult:
        return self.changed(super().run(simulation))

    def changed(self, result: TaskResult) -> TaskResult:
        return result


@variants.by("prepare_leaves_the_chain_alone", "in place")
class TurnsGravity(Hold):
    """Writes into the caller's chain."""

    def prepare(self, chain: ChainModel) -> ChainModel:
        chain.gravity_m_s2[:] = 0.0
        return chain


@variants.by("leaves_a_settled_chain", "no TaskResult")
class BareMetrics(Hold):
    """Returns only the metrics."""

    def run(self, simulation: Simulation) -> Any:
        return super().run(simulation).metrics


@variants.by("drives_the_chain", "joints stand at zero")
class NeverApplies(Hold):
    """Zero pressure, no payload."""

    def prepare(self, chain: ChainModel) -> ChainModel:
        return chain.with_(gravity_m_s2=np.zeros(3))

    def inputs(self) -> Inputs:
        return Inputs({"pressure_pa": 0.0})


@variants.by("metrics_carry_their_unit", "metric 'deflection'")
class Unitless(Measured):
    """A deflection in whatever unit."""

    def changed(self, result: TaskResult) -> TaskResult:
        return replace(result, metrics={"deflection": 12.5})


@variants.by("measures_what_it_says", "leaves out levels")
class Forgetful(Hold):
    """Names one of two."""

    def measures(self) -> tuple[str, ...]:
        return ("tip_x_m",)


@variants.by("metrics_are_finite", "metric 'drop_m' is nan")
class DividesByZero(Measured):
    """Not a number."""

    def changed(self, result: TaskResult) -> TaskResult:
        return replace(result, metrics={"drop_m": float("nan")})


@variants.by("is_deterministic", "second run differ")
class Noisy(Hold):
    """A random pressure."""

    def inputs(self) -> Inputs:
        return Inputs({"pressure_pa": 1e4 * np.random.default_rng().random()})


@variants.by("runs_on_one_joint", "IndexError")
class NeedsThree(Measured):
    """Looks at the third joint."""

    def changed(self, result: TaskResult) -> TaskResult:
        return replace(result, metrics={"third_rad": float(result.final.joint_angles[2, 0])})


@variants.by("passes_on_that_it_did_not_converge", "the task says that it did")
class Optimist(Measured):
    """Always converged."""

    def changed(self, result: TaskResult) -> TaskResult:
        return replace(result, final=replace(result.final, converged=True))


@variants.by("history_is_consistent", "the shapes are")
class ForgetsTheTip(Measured):
    """A history of joints without base and tip."""

    def changed(self, result: TaskResult) -> TaskResult:
        assert result.rollout is not None
        return replace(result, rollout=replace(result.rollout, markers_m=result.rollout.markers_m[:, 1:-1]))


class Squeeze(SceneTask):
    """One arm, actuated for a moment: a good task with contact, but for what its subclasses break."""

    config: HoldConfig

    def scene(self, chain: ChainModel) -> Scene:
        return Scene(arms=(Arm(chain),))

    def run(self, chain: ChainModel, engine: SceneEngine) -> TaskResult:
        with engine(Scene(arms=(Arm(chain),))) as simulation:
            states = [simulation.snapshot()]
            simulation.apply([Inputs({"pressure_pa": self.config.pressure_pa})])
            simulation.step(0.1)
            states.append(simulation.snapshot())
            final = simulation.pose(0)
        stills = (still(self.scene(chain), states[-1], "after"),)
        return TaskResult(final, {"time_s": 0.1}, None, SceneFrames.of(states), stills)


@variants.by("makes_a_scene", "the scene has no arms")
class Armless(Squeeze):
    """Forgets the robot."""

    def scene(self, chain: ChainModel) -> Scene:
        return Scene(arms=())


@variants.by("leaves_stills", "the result has no stills")
class Unshown(Squeeze):
    """Leaves nothing for pages."""

    def run(self, chain: ChainModel, engine: SceneEngine) -> TaskResult:
        return replace(super().run(chain, engine), stills=())


@variants.by("leaves_frames", "the result has no frames")
class Unseen(Squeeze):
    """Keeps no motion."""

    def run(self, chain: ChainModel, engine: SceneEngine) -> TaskResult:
        return replace(super().run(chain, engine), frames=None)
