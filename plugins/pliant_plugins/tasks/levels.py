"""Levels of actuation and load that a chain is settled at, one from the other, and what it could not hold."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pliant.interfaces.physics import Simulation
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Equilibrium, Inputs, OutsideDomain, Rollout, TaskResult
from pliant_plugins.tasks.measures import OF_BENDING, OF_CHAINS, OF_EXTENSION, chain_metrics

# What `result_of` measures, of chains that bend and of chains that extend.
MEASURED = (*OF_CHAINS, *OF_BENDING, *OF_EXTENSION, "unsettled_levels")

# A joint that is further outside its law's box than this share of the box's width, or turned further than this, is
# no answer: the law is a continuation there, and would carry any load.
FAR_WIDTHS = 0.25
FAR_TURN_RAD = np.pi


@dataclass(frozen=True, eq=False)
class Level:
    """Inputs to settle at; `time_s` stands in the history, `name` in sentences."""

    time_s: float
    inputs: Inputs
    name: str


def settle_levels(simulation: Simulation, levels: Iterable[Level]) -> list[Equilibrium]:
    """The equilibrium of each level, reached from the one before."""
    found = []
    for level in levels:
        simulation.apply(level.inputs)
        found.append(simulation.settle())
    return found


def result_of(
    chain: ChainModel, levels: Sequence[Level], found: Sequence[Equilibrium], asked: Sequence[int] = (-1,)
) -> TaskResult:
    """The last level's equilibrium with metrics of it, and all levels as a history.

    `iterations` and `wall_s` of the result are those of all levels; its `outside_domain` holds the worst entry of
    each joint and variable over all of them. `asked` are the levels that the task is about: if one of them did not
    hold, `not_reached` says which, why, and which level held last.
    """
    final = replace(
        found[-1],
        iterations=sum(one.iterations for one in found),
        wall_s=sum(one.wall_s for one in found),
        outside_domain=_worst_outside(levels, found),
    )
    inputs = list(levels[-1].inputs.actuation)
    rollout = Rollout(
        time_s=np.array([level.time_s for level in levels]),
        actuation=np.array([[level.inputs.actuation[name] for name in inputs] for level in levels]),
        joint_angles=np.array([one.joint_angles for one in found]),
        markers_m=np.array([one.markers_m for one in found]),
    )
    unsettled = sum(not one.converged for one in found)
    metrics = {**chain_metrics(chain, final), "unsettled_levels": unsettled}
    return TaskResult(final, metrics, rollout, not_reached=_not_reached(chain, levels, found, asked))


def why_not_held(chain: ChainModel, found: Equilibrium) -> str:
    """Why this equilibrium holds nothing, as the end of a sentence about the chain; empty if it does."""
    if not found.converged:
        return f"did not settle (residual {found.residual:.2g})"
    if found.stable is False:
        return "has no stable equilibrium"
    for number, (joint, q) in enumerate(zip(chain.joints, found.joint_angles, strict=True), start=1):
        law = chain.laws[joint.law]
        box = law.domain.deformation
        for actuator in chain.actuators:
            excess = law.domain.excess(np.zeros(1), actuator.sign * q[None])[0, 1:]
            far = np.abs(excess) / np.ptp(box, axis=1)
            if far.max() > FAR_WIDTHS:
                return f"is held by no data: joint {number} stands {100 * far.max():.0f} % of its law's range outside"
        if law.joint != "prismatic" and np.linalg.norm(q) > FAR_TURN_RAD:
            return f"folds: joint {number} is turned by {np.degrees(np.linalg.norm(q)):.0f}°"
    return ""


def _not_reached(
    chain: ChainModel, levels: Sequence[Level], found: Sequence[Equilibrium], asked: Sequence[int]
) -> str:
    for index in sorted(k % len(levels) for k in asked):
        reason = why_not_held(chain, found[index])
        if reason:
            held = [levels[k].name for k in range(index) if not why_not_held(chain, found[k])]
            last = f"the last level that held is {held[-1]}" if held else "no level before it held"
            return f"At {levels[index].name} the chain {reason}; {last}."
    return ""


def _worst_outside(levels: Sequence[Level], found: Sequence[Equilibrium]) -> tuple[OutsideDomain, ...]:
    worst: dict[tuple[int, str], OutsideDomain] = {}
    for level, one in zip(levels, found, strict=True):
        for entry in one.outside_domain:
            key = (entry.module, entry.variable)
            if key not in worst or abs(entry.excess) > abs(worst[key].excess):
                worst[key] = replace(entry, time_s=level.time_s)
    return tuple(worst[key] for key in sorted(worst))


def as_list(points: Array) -> list[object]:
    """An array as a metric: nested lists of numbers."""
    listed: list[object] = np.asarray(points, float).tolist()
    return listed
