"""Checks of a `Task`, run on a small chain in the stand-in engine."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from pliant.interfaces.task import Task
from pliant.records.chain import ChainModel
from pliant.records.rollout import Equilibrium, TaskResult
from pliant.store.codec import encode
from pliant.testing.physics_bench import chain_numbers
from pliant.testing.samples import linear_law, sample_chain
from pliant.testing.stand_ins import StandIn, StandInConfig, StandInSimulation
from pliant.testing.suite import Subject, Suite, require, require_close

suite = Suite("task")
UNITS = r"m|rad|n|n_m|pa|s|j|kg|w|c|hz|k|m_s|rad_s|m_s2|n_m_rad|n_per_m"
# Numbers that have no unit say what they are instead.
DIMENSIONLESS = "ratio|share|count|score|strain"
NAME = re.compile(rf"([a-z][a-z0-9_]*_)?({UNITS}|{DIMENSIONLESS})")


def _chain(subject: Subject, modules: int = 3) -> ChainModel:
    """A chain that takes pressure, or a tendon's force where the task gives no pressure."""
    names = type(subject.build().config).model_fields
    if "tendon_force_n" not in names or "pressure_pa" in names:
        return sample_chain(modules=modules)
    law = replace(linear_law(gain=1.5e-3), actuation_name="tendon_force_n")
    return sample_chain(law, modules=modules)


def _run(subject: Subject, simulation: type[StandInSimulation] | None = None) -> TaskResult:
    task: Task = subject.build()
    chain = task.prepare(_chain(subject))
    with (simulation or StandIn(StandInConfig()).build)(chain) as built:
        return task.run(built)


def _result(subject: Subject) -> TaskResult:
    return subject.once("result", lambda: _run(subject))


def _leaves(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """(name of the metric that holds it, number)"""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _leaves(str(key), item)
    elif isinstance(value, list | tuple | np.ndarray):
        for item in value:
            yield from _leaves(name, item)
    else:
        yield name, value


@suite.check("`prepare` returns a chain and leaves the one it was given as it was.")
def prepare_leaves_the_chain_alone(subject: Subject) -> None:
    chain = _chain(subject)
    before, payload = chain_numbers(chain), chain.payload_kg
    prepared = subject.build().prepare(chain)
    require(
        isinstance(prepared, ChainModel), f"prepare returned {prepared!r}, no ChainModel: a forgotten return?"
    )
    require(
        np.array_equal(before, chain_numbers(chain)) and chain.payload_kg == payload,
        "prepare changed the chain in place; use chain.with_(...)",
    )
    require(prepared.n_joints == chain.n_joints, "prepare changed the number of joints")


@suite.check("`run` gives a `TaskResult` whose `final` is the settled chain, with markers base, joints, tip.")
def leaves_a_settled_chain(subject: Subject) -> None:
    result = _result(subject)
    require(isinstance(result, TaskResult), f"run returned {type(result).__name__}, no TaskResult")
    require(isinstance(result.final, Equilibrium), f"final is {type(result.final).__name__}, no Equilibrium")
    n = _chain(subject).n_joints
    require(
        result.final.markers_m.shape == (n + 2, 3),
        f"final.markers_m has shape {result.final.markers_m.shape}",
    )
    require(result.final.converged, "the task did not converge on a chain of three modules")


@suite.check("the task does something: it actuates or loads the chain.")
def drives_the_chain(subject: Subject) -> None:
    moved = float(np.abs(_result(subject).final.joint_angles).max())
    require(
        moved > 1e-4, "the joints stand at zero at the end: `apply` was not called, or not before `settle`"
    )


@suite.check(
    "metrics are SI with the unit in the name (`tip_deflection_m`); a pure number says what it is "
    "(`…_ratio`)."
)
def metrics_carry_their_unit(subject: Subject) -> None:
    metrics = _result(subject).metrics
    require(len(metrics) > 0, "the task measures nothing")
    for name, value in metrics.items():
        for leaf, number in _leaves(name, value):
            if not isinstance(number, float | np.floating):
                continue  # counts, flags and texts have no unit
            require(
                NAME.fullmatch(leaf) is not None,
                f"metric '{leaf}' = {number!r} does not end in an SI unit such as _m, _rad, _n, _s, nor in "
                "_ratio, "
                "_share or _count",
            )


@suite.check("metrics are finite numbers and can be stored as JSON.")
def metrics_are_finite(subject: Subject) -> None:
    result = _result(subject)
    for name, value in result.metrics.items():
        for leaf, number in _leaves(name, value):
            if isinstance(number, float | int | np.number):
                require(np.isfinite(number), f"metric '{leaf}' is {number}")
    json.dumps(encode(result, {}), allow_nan=False)


@suite.check("the same chain in the same engine gives the same result.")
def is_deterministic(subject: Subject) -> None:
    again = _run(subject)
    require_close(
        again.final.markers_m,
        _result(subject).final.markers_m,
        "markers (m) of a second run differ",
        atol=1e-12,
    )
    texts = [json.dumps(encode(_timeless(r).metrics, {})) for r in (again, _result(subject))]
    require(texts[0] == texts[1], f"metrics of a second run differ: {texts[0]} and {texts[1]}")


@suite.check("the task runs on any number of modules.")
def runs_on_one_joint(subject: Subject) -> None:
    task: Task = subject.build()
    with StandIn(StandInConfig()).build(task.prepare(_chain(subject, 1))) as simulation:
        result = task.run(simulation)
    require(
        result.final.markers_m.shape == (3, 3),
        f"markers of one joint have shape {result.final.markers_m.shape}",
    )


@suite.check("a chain that did not settle is not called settled: `final.converged` is the engine's.")
def passes_on_that_it_did_not_converge(subject: Subject) -> None:
    result = _run(subject, _NeverSettles)
    require(not result.final.converged, "the engine did not converge, the task says that it did")


@suite.check("a history has matching shapes: time (t,), joint_angles (t, n, a), markers (t, n + 2, 3).")
def history_is_consistent(subject: Subject) -> None:
    history = _result(subject).rollout
    if history is None:
        return
    n, t = _chain(subject).n_joints, len(history.time_s)
    shapes = (history.joint_angles.shape, history.markers_m.shape, len(history.actuation))
    require(shapes == ((t, n, 1), (t, n + 2, 3), t), f"for {t} times and {n} joints the shapes are {shapes}")
    require(np.all(np.diff(history.time_s) >= 0), "time_s runs backwards")


class _NeverSettles(StandInSimulation):
    """An engine that always stops early."""

    def settle(self) -> Equilibrium:
        return replace(super().settle(), converged=False, residual=1e-3)


def _timeless(result: TaskResult) -> TaskResult:
    """Without wall times, the only numbers that may differ."""
    return replace(result, metrics={k: v for k, v in result.metrics.items() if not k.endswith("wall_s")})
