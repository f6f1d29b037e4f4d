"""Tendon finger: one tendon over all joints, pulled by a force or by a travel, against a weight over a pulley."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.polynomial import polynomial
from pydantic import Field, model_validator
from scipy.optimize import brentq

from pliant.interfaces.simulation import Simulation, SimulationState
from pliant.interfaces.task import Task, TaskConfig
from pliant.records.chain import GRAVITY_M_S2, ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Cord, Equilibrium, Inputs, TaskResult
from pliant.units import Force, Length, Mass
from pliant_plugins.tasks.levels import MEASURED, Level, as_list, levels_result, why_not_held
from pliant_plugins.tasks.ramp import driven

# Tendon length of one joint (m) by powers of its angle (rad), as the study gives it in mm.
STUDY_LENGTH_M = (27.297e-3, -2.4933e-3, -1.2698e-3)
STEP_N = 0.5
FORCE_MAX_N = 50.0


class TendonFingerConfig(TaskConfig):
    """``task: {kind: tendon_finger, tendon_travel: 5 mm, payload: 20 g, pulley: [100 mm, 0, 0]}``."""

    kind: Literal["tendon_finger"] = "tendon_finger"
    tendon_force_n: Force | None = Field(default=None, ge=0, description="pull; this or tendon_travel")
    tendon_travel_m: Length | None = Field(
        default=None, ge=0, description="length pulled in, for which the force is found"
    )
    force_max_n: Force = Field(
        default=FORCE_MAX_N, gt=0, description="largest force that is tried for the travel"
    )
    payload_kg: Mass = Field(default=0.0, ge=0, description="weight on a cord from the tip over the pulley")
    pulley_m: tuple[Length, Length, Length] | None = Field(
        default=None,
        description="where the pulley stands in the world; without one the weight hangs at the tip",
    )
    bare_keys = ("tendon_length_m",)
    tendon_length_m: tuple[float, ...] = Field(
        default=STUDY_LENGTH_M,
        min_length=1,
        description="tendon length of one joint in m, by powers of its angle in rad, lowest first",
    )

    @model_validator(mode="after")
    def _one_drive(self) -> TendonFingerConfig:
        if (self.tendon_force_n is None) == (self.tendon_travel_m is None):
            raise ValueError("give exactly one of 'tendon_force' and 'tendon_travel'")
        # Canonical JSON, from which workers read a study, states the default too.
        if self.tendon_force_n is not None and self.force_max_n != FORCE_MAX_N:
            raise ValueError(
                "'force_max' is for a search by 'tendon_travel'; leave it out beside 'tendon_force'"
            )
        return self


class TendonFinger(Task):
    """A finger with a hanging weight whose tendon is pulled in steps of 0.5 N; force, travel and tip are measured.

    The travel is Σ L(0) − L(θ) over the joints, with L the tendon length of one joint. The force for a given
    travel is found between the two steps that enclose it, by Brent's method.
    """

    config: TendonFingerConfig

    def measures(self) -> tuple[str, ...]:
        return (*MEASURED, "tendon_force_n", "tendon_travel_m")

    def run(self, simulation: Simulation) -> TaskResult:
        pull = _Pull(simulation, self.config)
        if self.config.tendon_force_n is not None:
            for force in np.arange(0.0, self.config.tendon_force_n, STEP_N).tolist():
                pull.settle(force)
            pull.settle(self.config.tendon_force_n)
            return pull.result()
        return pull.result(pull.find(self.config.tendon_travel_m or 0.0))


class _Pull:
    """A finger under its load, with the levels that it was settled at."""

    def __init__(self, simulation: Simulation, config: TendonFingerConfig) -> None:
        self.simulation, self.config, self.chain = simulation, config, simulation.chain
        self.levels: list[Level] = []
        self.found: list[Equilibrium] = []
        self.cords, self.force_n = _load(self.chain, config)

    def settle(self, force_n: float) -> float:
        """Settle at a tendon force; returns the travel in m."""
        actuation = driven(self.chain, "tendon_force_n", force_n)
        level = Level(
            float(len(self.levels)), Inputs(actuation, self.force_n, cords=self.cords), f"{force_n:.4g} N"
        )
        self.simulation.apply(level.inputs)
        self.levels.append(level)
        self.found.append(self.simulation.settle())
        return self.travel()

    def travel(self) -> float:
        """Return length pulled in at the last level, m."""
        return travel_m(self.found[-1].joint_angles, self.config.tendon_length_m)

    def find(self, travel: float) -> str:
        """Settle where the tendon is pulled in by `travel`; a sentence where no force does it."""
        low, reached = 0.0, self.settle(0.0)
        if reached > travel:
            return (
                f"The load alone pulls the tendon in by {1e3 * reached:.4g} mm: a travel of {1e3 * travel:g} mm "
                "would take a pushing tendon."
            )
        high = low
        while reached < travel:
            low, high = high, high + STEP_N
            why = why_not_held(self.chain, self.found[-1])
            if high > self.config.force_max_n or why:
                end = why or f"'force_max' is {self.config.force_max_n:g} N"
                return (
                    f"No force pulls the tendon in by {1e3 * travel:g} mm: at {low:g} N it is "
                    f"{1e3 * reached:.4g} mm, and the search ends there because {end}."
                )
            before = self.simulation.snapshot()
            reached = self.settle(high)
        if reached > travel:
            # Trials are not recorded: each starts from the last level below, and the history continues from there.
            def missed(force: float) -> float:
                self._take_back(before)
                return self.settle(force) - travel

            force = brentq(missed, low, high, xtol=1e-9, rtol=1e-12)
            missed(float(force))
        return ""

    def _take_back(self, state: SimulationState) -> None:
        """Undo the last level."""
        self.levels.pop()
        self.found.pop()
        self.simulation.restore(state)

    def result(self, problem: str = "") -> TaskResult:
        """Return metrics of the last level and all levels as the history."""
        result = levels_result(self.chain, self.levels, self.found)
        name = next(iter(driven(self.chain, "tendon_force_n", 0.0)))
        metrics: dict[str, Any] = {
            **result.metrics,
            "tendon_force_n": self.levels[-1].inputs.actuation[name],
            "tendon_travel_m": self.travel(),
            "joint_angles_rad": as_list(result.final.joint_angles[:, 0]),
        }
        return replace(result, metrics=metrics, not_reached=problem or result.not_reached)


def travel_m(joint_angles: Array, tendon_length_m: tuple[float, ...]) -> float:
    """Return Σ L(0) − L(θ) over the joints' angles (n, 1), in m."""
    length = polynomial.polyval(joint_angles[:, 0], np.array(tendon_length_m))
    return float(np.sum(tendon_length_m[0] - length))


def _load(chain: ChainModel, config: TendonFingerConfig) -> tuple[tuple[Cord, ...], Array]:
    """Return the weight as a cord over the pulley, or as a dead force at the tip (3,)."""
    weight = config.payload_kg * float(np.linalg.norm(chain.gravity_m_s2) or np.linalg.norm(GRAVITY_M_S2))
    if config.pulley_m is None or weight == 0.0:
        return (), weight * np.array([0.0, 0.0, -1.0])
    tip = np.asarray(chain.tip_offset_m, float)
    return (Cord(chain.n_joints, tip, np.array(config.pulley_m), weight),), np.zeros(3)
