"""The task `crawl`: a crawler on a floor goes through the periods of its gait."""

from __future__ import annotations

import time
from collections.abc import Mapping

from pliant.errors import UserError, closest
from pliant.interfaces.simulation import SceneSimulation
from pliant.interfaces.task import SceneEngine, SceneTask
from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs, TaskResult
from pliant.records.scene import Scene
from pliant_plugins.tasks.crawl.config import CrawlConfig
from pliant_plugins.tasks.crawl.metrics import crawl_metrics
from pliant_plugins.tasks.crawl.scene import crawl_scene
from pliant_plugins.tasks.scene_record import SceneRecord

REST_FRAMES = 10
# Instants of the last period that pages show, as shares of it.
STILLS = (0.0, 0.25, 0.5, 0.75)
MEASURED = (
    "speed_m_s",
    "displacement_m",
    "drift_m",
    "turn_rad",
    "work_j",
    "net_work_j",
    "change_ratio",
    "cost_of_transport_ratio",
)


class Crawl(SceneTask):
    """Copies of the chain on one free body, on a floor, under periodic actuation.

    Metrics of the measured periods: `speed_m_s` of the mean of all markers along `direction`; per period its
    `displacement_m`, its `drift_m` to the left and the `turn_rad` of the body about the vertical; `work_j` that
    supplies put in per period and `net_work_j` less what flows back; `cost_of_transport_ratio`, the work put in over
    weight times distance; `change_ratio` of the joints over the last period, 0 for a periodic motion.
    """

    config: CrawlConfig

    @property
    def free_bases(self) -> bool:
        return True

    def measures(self) -> tuple[str, ...]:
        return MEASURED

    def scene(self, chain: ChainModel) -> Scene:
        return crawl_scene(chain, self.config)

    def run(self, chain: ChainModel, engine: SceneEngine) -> TaskResult:
        started, config = time.perf_counter(), self.config
        self.check_inputs(chain)
        record = SceneRecord(self.scene(chain))
        with engine(record.scene) as simulation:
            record.see(simulation)
            first = self.commands(chain, 0.0)
            record.drive(simulation, first, None, config.rest_time_s, REST_FRAMES)
            for _ in range(config.settling_periods):
                self.play(chain, simulation, record)
            commanded = [
                inputs for _ in range(config.periods) for inputs in self.play(chain, simulation, record)
            ]
        metrics = crawl_metrics(record, commanded, config)
        begin = len(record.states) - 1 - config.commands
        stills = tuple(
            record.still(begin + round(share * config.commands), f"{share:.0%} of a period")
            for share in STILLS
        )
        final = record.equilibrium(time.perf_counter() - started)
        return TaskResult(final, metrics, None, record.frames, stills)

    def play(
        self, chain: ChainModel, simulation: SceneSimulation, record: SceneRecord
    ) -> list[list[Mapping[str, float]]]:
        """Go through one period, with a frame per command; return the inputs of each arm at each command."""
        commands, each = self.config.commands, []
        for k in range(commands):
            each.append(self.commands(chain, (k + 0.5) / commands))
            simulation.apply([Inputs(one) for one in each[-1]])
            simulation.step(self.config.period_s / commands)
            record.see(simulation)
        return each

    def commands(self, chain: ChainModel, clock: float) -> list[Mapping[str, float]]:
        """Return the inputs of each arm at a time in periods."""
        return [self.config.inputs_at(clock, one.phase, chain.inputs) for one in self.config.placed_arms]

    def check_inputs(self, chain: ChainModel) -> None:
        """Refuse a gait of inputs that the chain does not have.

        Raises:
            UserError: such an input.
        """
        for name in self.config.gait:
            if name not in chain.inputs:
                raise UserError(
                    f"task.gait drives '{name}'{closest(name, chain.inputs)} The chain's inputs are "
                    f"{', '.join(chain.inputs)}: use these names."
                )
