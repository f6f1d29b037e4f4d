"""A correct task, hold at a pressure, and incorrect tasks."""

from dataclasses import replace
from typing import Any, Literal

import numpy as np
from tests.conformance.broken import Variants

from pliant.interfaces.simulation import Simulation
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
    """A task that actuates, settles and measures the tip."""

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


class Squeeze(SceneTask):
    """One arm, actuated for a moment: a correct task with contact."""

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
        return TaskResult(final, {"time_s": 0.1}, None, SceneFrames.from_states(states), stills)


variants = Variants(Component("task", "small", f"{__name__}:HoldConfig", f"{__name__}:Hold", "hold"))
broken, broken_scene = variants.row_adder(Hold), variants.row_adder(Squeeze)


def resulting(check: str, change: Any) -> None:
    """Add a row: fields of the correct result are changed."""
    broken(check, run=lambda up, self, *given: replace(result := up(*given), **change(result)))


def _without_gravity(up: Any, self: Any, chain: ChainModel) -> ChainModel:
    chain.gravity_m_s2[:] = 0.0  # the caller's
    return chain


broken("prepare_leaves_the_chain_alone", prepare=_without_gravity)
broken("leaves_a_settled_chain", run=lambda up, self, *given: up(*given).metrics)
broken(
    "drives_the_chain",
    prepare=lambda up, self, chain: chain.with_(gravity_m_s2=np.zeros(3)),
    inputs=lambda up, self: Inputs({"pressure_pa": 0.0}),
)
resulting("metrics_carry_their_unit", lambda _: {"metrics": {"deflection": 12.5}})
broken("measures_what_it_says", measures=lambda up, self: ("tip_x_m",))
broken("residuals_are_of_their_metric", residuals=lambda up, self, *given: {"unknown_m": np.ones(2)})
resulting("metrics_are_finite", lambda _: {"metrics": {"drop_m": float("nan")}})
resulting("metrics_are_finite", lambda result: {"final": replace(result.final, residual=float("nan"))})
broken(
    "is_deterministic",
    inputs=lambda up, self: Inputs({"pressure_pa": 1e4 * np.random.default_rng().random()}),
)
resulting(
    "runs_on_one_joint", lambda result: {"metrics": {"third_rad": float(result.final.joint_angles[2, 0])}}
)
resulting(
    "passes_on_that_it_did_not_converge", lambda result: {"final": replace(result.final, converged=True)}
)
resulting(
    "history_is_consistent",
    lambda result: {"rollout": replace(result.rollout, markers_m=result.rollout.markers_m[:, 1:-1])},
)
broken_scene("makes_a_scene", scene=lambda up, self, chain: Scene(arms=()))
for check, lost in (("leaves_stills", {"stills": ()}), ("leaves_frames", {"frames": None})):
    broken_scene(check, run=lambda up, self, *given, lost=lost: replace(up(*given), **lost))
