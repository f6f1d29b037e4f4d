"""Follow shape: how far the settled backbone is from a target curve."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from pliant.config.chain import BaseConfig
from pliant.errors import UserError
from pliant.interfaces.base import FrozenModel
from pliant.interfaces.simulation import Simulation
from pliant.interfaces.task import Task
from pliant.pipeline.chain import base_rotation
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import TaskResult
from pliant.units import Angle, Length
from pliant_plugins.tasks import curves
from pliant_plugins.tasks.levels import MEASURED, as_list, backbone
from pliant_plugins.tasks.ramp import DriveConfig, ramp

# A bent centre line is longer than the straight chain if its joints are off the line: a helical module of 5 mm whose
# hinge is 3 mm away gains a third at 0.5 rad. Links stretch by 1 or 2 %, translational bellows by more.
LONGER = 1.5
OF_DISTANCES = tuple(one.name for one in fields(curves.Distances))


class TargetConfig(FrozenModel):
    """A helix that starts at the base, or a CSV of points in the base's frame.

    A helix winds about a line along the base's axis, so that a chain has to turn into it first; with
    ``start: tangent`` it leaves the base along the base's axis, as a chain does.
    """

    radius_m: Length | None = Field(default=None, gt=0, description="of a helix")
    height_m: Length | None = Field(default=None, gt=0, description="of a helix, along the base's axis")
    turns: float = Field(default=1.0, gt=0, description="of a helix")
    handedness: Literal["right", "left"] = Field(default="right", description="of a helix")
    start: Literal["axis", "tangent"] = Field(
        default="axis",
        description="what of a helix lies along the base's axis: its axis, or its first tangent",
    )
    phase_rad: Angle = Field(default=0.0, description="turns the target about the base's axis")
    points: Path | None = Field(default=None, description="CSV with x_m, y_m, z_m, instead of a helix")

    @model_validator(mode="after")
    def _one_curve(self) -> TargetConfig:
        given = [value is not None for value in (self.radius_m, self.height_m)]
        if self.points is not None and self.start == "tangent":
            raise ValueError("'start: tangent' is for a helix; turn the points of a file as they shall stand")
        if not (all(given) if self.points is None else not any(given)):
            more = ", and not both" if all(given) and self.points is not None else ""
            raise ValueError(f"give 'radius' and 'height' of a helix, or 'points: curve.csv'{more}")
        return self

    def curve(self) -> Array:
        """Return (n, 3) points in the base's frame, x along the chain."""
        if self.points is not None:
            points = curves.read_points(self.points)
        else:
            right = self.handedness == "right"
            points = curves.helix(self.radius_m or 0.0, self.height_m or 0.0, self.turns, right)
            points = curves.leaving_along_x(points) if self.start == "tangent" else points
        return curves.rolled(points, self.phase_rad)


class FollowShapeConfig(DriveConfig):
    """``task: {kind: follow_shape, pressure: 15 kPa, target: {radius: 18 mm, height: 60 mm}}``."""

    kind: Literal["follow_shape"] = "follow_shape"
    target: TargetConfig = Field(description="the curve to follow")
    alignment: Literal["base", "roll", "direction"] = Field(
        default="base",
        description="base: the target turns with the base; roll: turned about the base's axis to fit best; "
        "direction: it follows the base's direction but not its roll, so that a search may roll the base under it",
    )
    samples: int = Field(default=101, ge=2, le=10_001, description="points along both curves")


class FollowShape(Task):
    """A ramp of the actuation, then a comparison of the chain's centre line with the target.

    Both are resampled by normalised arc length, so that points correspond one to one: a backbone that has the
    target's shape but another length is not at distance zero.
    """

    config: FollowShapeConfig

    def __init__(self, config: FollowShapeConfig) -> None:
        super().__init__(config)
        self.target = curves.resampled(config.target.curve(), config.samples)

    def check_reach(self, length_m: float) -> None:
        """Refuse a target that is more than half as long again as the longest straight chain.

        Raises:
            UserError: with both lengths.
        """
        wanted = curves.length_m(self.config.target.curve())
        if wanted > LONGER * length_m:
            raise UserError(
                f"task.target is {1e3 * wanted:.4g} mm long, and the longest chain that the search can build "
                f"{1e3 * length_m:.4g} mm: bent it is at most half as long again. Make the target smaller, or allow "
                "more or longer modules."
            )

    def measures(self) -> tuple[str, ...]:
        return (*MEASURED, *OF_DISTANCES, "roll_rad", "backbone_length_m", "target_length_m")

    def run(self, simulation: Simulation) -> TaskResult:
        chain = simulation.chain
        result = ramp(simulation, self.config)
        frame, origin = self._frame(chain), np.asarray(chain.base_position_m, float)
        line = backbone(chain, result.final.joint_angles)
        points, target, roll = self._compared(chain, line)
        world = curves.resampled(origin + target @ frame.T, curves.DRAWN)
        metrics = {
            **result.metrics,
            **asdict(curves.Distances.between(points, target)),
            "roll_rad": roll,
            "backbone_length_m": curves.length_m(line),
            "target_length_m": curves.length_m(self.config.target.curve()),
            "backbone_points_m": as_list(curves.resampled(line, curves.DRAWN)),
            "target_points_m": as_list(world),
        }
        return replace(result, metrics=metrics)

    def residuals(self, chain: ChainModel, result: TaskResult) -> Mapping[str, Array]:
        points, target, _ = self._compared(chain, backbone(chain, result.final.joint_angles))
        return {"rmse_m": (points - target).ravel() / np.sqrt(self.config.samples)}

    def _compared(self, chain: ChainModel, line: Array) -> tuple[Array, Array, float]:
        """Return points (n, 3) of a centre line in the world and those of the target, both in its frame; its roll."""
        frame, origin = self._frame(chain), np.asarray(chain.base_position_m, float)
        points = curves.resampled((line - origin) @ frame, self.config.samples)
        roll = curves.best_roll(points, self.target) if self.config.alignment == "roll" else 0.0
        return points, curves.rolled(self.target, roll), roll

    def _frame(self, chain: ChainModel) -> Array:
        """Return the frame (3, 3) of the target."""
        frame = np.asarray(chain.base_rotation, float)
        if self.config.alignment != "direction":
            return frame
        x, y, z = frame[:, 0].tolist()
        return base_rotation(BaseConfig(direction=(x, y, z)))
