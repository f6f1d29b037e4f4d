"""Metrics of a crawl: displacement, work of the actuation, cost of transport, whether the gait is periodic."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.mechanics.efforts import JointEfforts
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant_plugins.tasks.crawl.config import CrawlConfig
from pliant_plugins.tasks.crawl.scene import weight_n
from pliant_plugins.tasks.scene_record import SceneRecord

# The change of the joints from one period to the next, of their swing, from which a gait is not called periodic.
PERIODIC = 0.02
# A displacement by which no cost is divided.
LEAST_M = 1e-9


def crawl_metrics(
    record: SceneRecord, commanded: Sequence[Sequence[Mapping[str, float]]], config: CrawlConfig
) -> dict[str, Any]:
    """Return the metrics of the measured periods, which are the last frames of the record.

    Args:
        record: one frame per command, and earlier ones.
        commanded: per command of the measured periods the inputs of each arm.
        config: of the task.
    """
    ends = [len(record.states) - 1 - k * config.commands for k in range(config.periods + 1)][::-1]
    middles = np.array([np.concatenate(record.markers_m[end]).mean(axis=0) for end in ends])
    forward = np.array(config.direction) / np.linalg.norm(config.direction)
    moved = np.diff(middles, axis=0)
    along, aside = moved @ forward, moved @ np.cross([0.0, 0.0, 1.0], forward)
    total = float(along.sum())
    spent, returned = _work_j(record, commanded)
    turn = record.states[ends[-1]].rotations[0] @ record.states[ends[0]].rotations[0].T
    change = _change_ratio(record, config.commands)
    metrics: dict[str, Any] = {
        "speed_m_s": total / (config.periods * config.period_s),
        "displacement_m": total / config.periods,
        "drift_m": float(aside.mean()),
        "turn_rad": float(np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])) / config.periods,
        "work_j": spent / config.periods,
        "net_work_j": (spent - returned) / config.periods,
        "change_ratio": change,
        "displacements_m": along.tolist(),
    }
    if abs(total) > LEAST_M:
        metrics["cost_of_transport_ratio"] = spent / (weight_n(record.scene) * abs(total))
    if change > PERIODIC:
        metrics["note"] = (
            f"The motion is not periodic: joints end the last period {100 * change:.2g} % of their swing away from "
            "where they began it. More 'settling_periods' show whether it becomes so."
        )
    return metrics


def _change_ratio(record: SceneRecord, commands: int) -> float:
    """Return the largest change of a joint over the last period, of the largest swing of any joint."""
    last = record.states[-commands - 1 :]
    change, swing = 0.0, 0.0
    for arm in range(len(record.scene.arms)):
        q = np.array([state.coordinates[arm] for state in last])
        change = max(change, float(np.abs(q[-1] - q[0]).max()))
        swing = max(swing, float(np.ptp(q, axis=0).max()))
    return change / swing if swing > 0.0 else 0.0


def _work_j(record: SceneRecord, commanded: Sequence[Sequence[Mapping[str, float]]]) -> tuple[float, float]:
    """Return the work (J) that supplies put in, and that which flows back, both ≥ 0, over the commands.

    A supply is one input of one arm. Its work in a step is p ΔV, V the sum of the travels of its actuators: exact while
    p is constant; where p changes between steps, V changes at the mean p.
    """
    positions = record.states[-len(commanded) - 1 :]
    spent = returned = 0.0
    for arm, one in enumerate(record.scene.arms):
        q = np.array([state.coordinates[arm] for state in positions])
        work = supply_work_j(one.chain, q, [inputs[arm] for inputs in commanded])
        spent += float(np.maximum(work, 0.0).sum())
        returned -= float(np.minimum(work, 0.0).sum())
    return spent, returned


def supply_work_j(chain: ChainModel, q: Array, commanded: Sequence[Mapping[str, float]]) -> Array:
    """Return (t, inputs) the work of each input in each step from q[k] to q[k + 1], q (t + 1, n, a)."""
    efforts = JointEfforts(chain.with_(terms=()))
    values = np.array([efforts.values(inputs) for inputs in commanded])
    at_start, at_end = efforts.travels(q[:-1], values), efforts.travels(q[1:], values)
    work = values * (at_end - at_start)
    work[1:] += 0.5 * (values[1:] + values[:-1]) * (at_start[1:] - at_end[:-1])
    of_input = np.array([[actuator.input == name for name in chain.inputs] for actuator in chain.actuators])
    return np.asarray(work @ of_input)
