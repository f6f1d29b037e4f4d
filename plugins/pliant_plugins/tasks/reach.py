"""Reach: the actuations that bring the tip, its direction or the backbone where they should be, or along a path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from pliant.errors import NotReachedError
from pliant.interfaces.simulation import Simulation
from pliant.interfaces.study_loads import Actuation
from pliant.interfaces.task import Task, TaskConfig
from pliant.inverse.answer import InverseAnswer
from pliant.inverse.clearance import Clearance
from pliant.inverse.statics import InverseStatics
from pliant.inverse.target import Target
from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs, TaskResult
from pliant.units import Force, Length, Mass, Time
from pliant_plugins.tasks import curves
from pliant_plugins.tasks.levels import Level, levels_result
from pliant_plugins.tasks.obstacles import ObstacleConfig, capsule_radius_m, solids


class ReachConfig(TaskConfig):
    """``task: {kind: reach, tip: [60 mm, 0 mm, -30 mm]}``."""

    kind: Literal["reach"] = "reach"
    tip_m: tuple[Length, Length, Length] | None = Field(
        default=None, description="where the tip shall be, world"
    )
    direction: tuple[float, float, float] | None = Field(
        default=None, description="where the tip's axis shall point, world; with 'tip' or alone"
    )
    backbone: Path | None = Field(
        default=None, description="CSV of x_m, y_m, z_m in the world: base, every joint, tip"
    )
    path: Path | None = Field(
        default=None, description="CSV of x_m, y_m, z_m in the world: places of the tip, one after the other"
    )
    push_n: tuple[Force, Force, Force] | None = Field(
        default=None, description="force that the tip gives to what it touches there, world"
    )
    payload_kg: Mass | None = Field(
        default=None, ge=0.0, description="point mass at the tip; left out, the chain's own payload stays"
    )
    bounds: Mapping[str, tuple[Actuation, Actuation]] = Field(
        default_factory=dict, description="low and high of inputs; left out, the domain of the law"
    )
    rates: Mapping[str, Actuation] = Field(
        default_factory=dict, description="most change of an input in a second, along a path"
    )
    time_step_s: Time = Field(default=0.1, gt=0.0, description="between places of a path")
    turn_m: Length | None = Field(
        default=None,
        gt=0.0,
        description="length that a radian of direction counts as; the chain's by default",
    )
    samples: int | None = Field(
        default=None, ge=2, le=100_000, description="equilibria of the reachable set to start from"
    )

    obstacles: tuple[ObstacleConfig, ...] = Field(
        default=(), description="fixed bodies from which the chain keeps `clearance`"
    )
    clearance_m: Length = Field(
        default=1e-3,
        ge=0.0,
        description="distance from obstacles; ten times what is missing counts as distance",
    )
    radius_m: Length | None = Field(
        default=None,
        gt=0,
        description="of the capsules that keep it; by default the chain's half width, needed without a family",
    )

    def canonical(self) -> dict[str, Any]:
        """Return the canonical form, without the keys of obstacles if there are none, as in keys of earlier results."""
        of_obstacles = () if self.obstacles else ("obstacles", "clearance_m", "radius_m")
        return {name: value for name, value in super().canonical().items() if name not in of_obstacles}

    @model_validator(mode="after")
    def _one_aim(self) -> ReachConfig:
        places = [name for name in ("tip_m", "backbone", "path") if getattr(self, name) is not None]
        if len(places) > 1:
            raise ValueError("give one of 'tip', 'backbone' and 'path', not several")
        if not places and self.direction is None:
            raise ValueError("give 'tip', 'direction', 'backbone' or 'path'")
        if self.rates and self.path is None:
            raise ValueError("'rates' are for a 'path'")
        return self


class Reach(Task):
    """A search for the actuations of given targets; the chain ends there, or at the closest point.

    Metrics: each input's value at the end, `distance_m` (the largest of a path, missing clearance included),
    `reached_share` of the targets, `clearance_m` from obstacles.
    """

    config: ReachConfig

    def prepare(self, chain: ChainModel) -> ChainModel:
        """Return the chain with the task's payload at its tip."""
        return chain if self.config.payload_kg is None else chain.with_(payload_kg=self.config.payload_kg)

    def targets(self, chain: ChainModel) -> list[Target]:
        """Return the targets, in order.

        Raises:
            UserError: obstacles, and a chain without a width.
        """
        config = self.config
        shared: dict[str, Any] = {
            "direction": None if config.direction is None else np.array(config.direction),
            "push_n": None if config.push_n is None else np.array(config.push_n),
            "turn_m": config.turn_m,
            "clearance": self._clearance(chain) if config.obstacles else None,
        }
        if config.path is not None:
            return [Target(tip_m=place, **shared) for place in curves.read_points(config.path)]
        if config.backbone is not None:
            return [Target(backbone_m=curves.read_points(config.backbone), **shared)]
        tip = None if config.tip_m is None else np.array(config.tip_m)
        return [Target(tip_m=tip, **shared)]

    def _clearance(self, chain: ChainModel) -> Clearance:
        config = self.config
        obstacles = tuple(one.record(f"obstacle {k}", 0.0) for k, one in enumerate(config.obstacles, 1))
        radius = capsule_radius_m(chain, config.radius_m, "reach")
        return Clearance(solids(obstacles), radius, config.clearance_m)

    def run(self, simulation: Simulation) -> TaskResult:
        config, chain = self.config, simulation.chain
        inverse = InverseStatics(simulation, config.bounds, config.samples)
        targets = self.targets(chain)
        try:
            answers = inverse.path(targets, config.rates, config.time_step_s)
        except NotReachedError as error:
            return _unsettled(simulation, inverse, str(error))
        force = np.zeros(3) if config.push_n is None else -np.array(config.push_n)
        levels = [
            Level(k * config.time_step_s, Inputs(one.actuation, force), f"target {k + 1}")
            for k, one in enumerate(answers)
        ]
        found = []
        for level, answer in zip(levels, answers, strict=True):
            simulation.respond(
                level.inputs, answer.response.joint_angles
            )  # begins at the branch that was found
            simulation.apply(level.inputs)
            found.append(simulation.settle())
        result = levels_result(chain, levels, found)
        away = np.array([one.distance_m for one in answers])
        metrics = {
            **result.metrics,
            **answers[-1].actuation,
            "distance_m": float(away.max()),
            "rms_distance_m": float(np.sqrt(np.mean(away**2))),
            "reached_share": float(np.mean([one.reached for one in answers])),
        }
        keeps = targets[0].clearance
        if keeps is not None:
            metrics["clearance_m"] = min(keeps.smallest_m(one.response.markers_m) for one in answers)
        said = result.not_reached or _sentence(answers)
        return replace(result, metrics=metrics, not_reached=said)


def _unsettled(simulation: Simulation, inverse: InverseStatics, said: str) -> TaskResult:
    """Return a result for a chain that does not settle in the middle of its bounds."""
    values = dict(zip(inverse.inputs, inverse.bounds.mean(axis=1).tolist(), strict=True))
    level = Level(0.0, Inputs(values), "the middle of the bounds")
    simulation.apply(level.inputs)
    return replace(levels_result(simulation.chain, [level], [simulation.settle()]), not_reached=said)


def _sentence(answers: list[InverseAnswer]) -> str:
    """Return a sentence on the targets that were not reached; empty if all were."""
    missed = [k for k, one in enumerate(answers) if not one.reached]
    if not missed:
        return ""
    if len(answers) == 1:
        return str(answers[0])
    worst = max(missed, key=lambda k: answers[k].distance_m)
    count = f"{len(missed)} of {len(answers)} places are not reached"
    return f"{count}; the farthest is place {worst + 1}. {answers[worst]}"
