"""Checks of a `Task` or `SceneTask`, run on a small chain in the stand-in engines."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from pliant.interfaces.task import SceneTask, Task
from pliant.records.chain import ChainModel
from pliant.records.rollout import Equilibrium, TaskResult
from pliant.records.scene import Scene
from pliant.records.shape import Shape
from pliant.store.codec import encode
from pliant.testing import CheckSkipped, Finding, Subject, agree, once, require
from pliant.testing.samples import chain_numbers, linear_law, sample_chain
from pliant.testing.stand_ins import StandInScene, StandInSimulation

UNITS = r"m|rad|n|n_m|pa|s|j|kg|w|c|hz|k|m_s|rad_s|m_s2|n_m_rad|n_per_m"
# Names of numbers without a unit state their kind instead.
DIMENSIONLESS = "ratio|share|count|score|strain|reward"
NAME = re.compile(rf"([a-z][a-z0-9_]*_)?({UNITS}|{DIMENSIONLESS})")


def _chain(subject: Subject, modules: int = 3) -> ChainModel:
    """Return a chain driven by pressure, or by a tendon if the task has no pressure; round if it may touch."""
    task = subject.build()
    if isinstance(task, SceneTask):
        ball = Shape("sphere", (4e-3,), np.zeros(3), np.eye(3))
        return sample_chain(modules=modules).with_(shapes=((ball,),) * (modules + 1))
    names = type(task.config).model_fields
    if "tendon_force_n" not in names or "pressure_pa" in names:
        return sample_chain(modules=modules)
    law = replace(linear_law(gain=1.5e-3), actuation_name="tendon_force_n")
    return sample_chain(law, modules=modules)


def _run(
    subject: Subject, simulation: type[StandInSimulation] = StandInSimulation, modules: int = 3
) -> TaskResult:
    task: Task | SceneTask = subject.build()
    chain = task.prepare(_chain(subject, modules))
    if isinstance(task, SceneTask):
        return task.run(chain, StandInScene)
    with simulation(chain) as built:
        return task.run(built)


@once
def _result(subject: Subject) -> TaskResult:
    return _run(subject)


def _contact_only(subject: Subject, otherwise: str) -> None:
    """Skip the check for a task without contact."""
    if not isinstance(subject.build(), SceneTask):
        raise CheckSkipped(f"a task without contact {otherwise}")


def _leaves(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield pairs (name of the metric, number) of a value's numbers."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _leaves(str(key), item)
    elif isinstance(value, list | tuple | np.ndarray):
        for item in value:
            yield from _leaves(name, item)
    else:
        yield name, value


def prepare_leaves_the_chain_alone(subject: Subject) -> None:
    """`prepare` returns a chain and does not change its argument."""
    chain = _chain(subject)
    before, payload = chain_numbers(chain), chain.payload_kg
    prepared = subject.build().prepare(chain)
    is_chain = isinstance(prepared, ChainModel)
    require(is_chain, f"prepare returned {prepared!r}, no ChainModel: a forgotten return?")
    same = np.array_equal(before, chain_numbers(chain)) and chain.payload_kg == payload
    require(same, "prepare changed the chain in place; use chain.with_(...)")
    require(prepared.n_joints == chain.n_joints, "prepare changed the number of joints")


def makes_a_scene(subject: Subject) -> None:
    """`scene` puts copies of the chain into a `Scene` and does not change the chain."""
    _contact_only(subject, "has no scene")
    task = subject.build()
    chain = task.prepare(_chain(subject))
    before = chain_numbers(chain)
    scene = task.scene(chain)
    require(isinstance(scene, Scene), f"scene returned {scene!r}, no Scene: a forgotten return?")
    require(len(scene.arms) > 0, "the scene has no arms")
    same = np.array_equal(before, chain_numbers(chain))
    require(same, "scene changed the chain in place; use chain.with_(...)")
    joints = [arm.chain.n_joints for arm in scene.arms]
    require(set(joints) == {chain.n_joints}, f"the chain has {chain.n_joints} joints, the arms have {joints}")


def leaves_stills(subject: Subject) -> None:
    """a task with contact returns stills, which pages show."""
    _contact_only(subject, "is drawn as a chain")
    how = "still(scene, state, label) of pliant.mechanics.stills, at least of the end"
    require(len(_result(subject).stills) > 0, f"the result has no stills: {how}")


def leaves_frames(subject: Subject) -> None:
    """a task with contact returns frames of its motion: a time, a carriage and joint coordinates of each arm."""
    _contact_only(subject, "leaves a rollout instead")
    frames = _result(subject).frames
    if frames is None:
        raise Finding("the result has no frames: SceneFrames.from_states(states) of the first trial")
    t = len(frames.time_s)
    require(t > 1 and np.all(np.diff(frames.time_s) > 0), f"time_s of the {t} frames does not increase")
    rows = {len(part) for part in (frames.carriage_m, *frames.coordinates, frames.positions_m)}
    require(rows == {t}, f"for {t} times the frames' arrays have {rows} rows")


def leaves_a_settled_chain(subject: Subject) -> None:
    """`run` gives a `TaskResult` whose `final` is the settled chain, with markers base, joints, tip."""
    result, n = _result(subject), _chain(subject).n_joints
    require(isinstance(result, TaskResult), f"run returned {type(result).__name__}, no TaskResult")
    final = result.final
    require(isinstance(final, Equilibrium), f"final is {type(final).__name__}, no Equilibrium")
    require(final.markers_m.shape == (n + 2, 3), f"final.markers_m has shape {final.markers_m.shape}")
    require(final.converged, "the task did not converge on a chain of three modules")


def drives_the_chain(subject: Subject) -> None:
    """the task actuates or loads the chain."""
    moved = float(np.abs(_result(subject).final.joint_angles).max())
    finding = "the joints stand at zero at the end: `apply` was not called, or not before `settle`"
    require(moved > 1e-4, finding)


def metrics_carry_their_unit(subject: Subject) -> None:
    """metrics are SI with the unit in the name (`tip_deflection_m`); a pure number names its kind (`…_ratio`)."""
    metrics = _result(subject).metrics
    require(len(metrics) > 0, "the task measures nothing")
    for leaf, number in _leaves("", metrics):
        if isinstance(number, float | np.floating):  # counts, flags and texts have no unit
            does = "does not end in an SI unit such as _m, _rad, _n, _s, nor in _ratio, _share or _count"
            require(NAME.fullmatch(leaf) is not None, f"metric '{leaf}' = {number!r} {does}")


def measures_what_it_says(subject: Subject) -> None:
    """`measures`, unless empty, names every number that `run` measures."""
    stated = subject.build().measures()
    if not stated:
        raise CheckSkipped("the task does not say before what it measures")
    found = {name for name, value in _result(subject).metrics.items() if isinstance(value, int | float)}
    missing = ", ".join(sorted(found - set(stated)))
    require(not missing, f"measures() leaves out {missing}: a search would refuse to name it")


def residuals_are_of_their_metric(subject: Subject) -> None:
    """The squares of `residuals` add up to the square of the metric that they are of."""
    task: Task | SceneTask = subject.build()
    if isinstance(task, SceneTask):
        raise CheckSkipped("a task with contact has no residuals")
    result = _result(subject)
    found = task.residuals(task.prepare(_chain(subject)), result)
    if not found:
        raise CheckSkipped("no metric is a sum of squares")
    for name, numbers in found.items():
        require(name in result.metrics, f"residuals() names '{name}', which is no metric")
        norm, metric = float(np.linalg.norm(numbers)), float(result.metrics[name])
        require(
            np.isclose(norm, metric, rtol=1e-9, atol=1e-15),
            f"the residuals of '{name}' have the norm {norm:.6g}, and the metric is {metric:.6g}",
        )


def metrics_are_finite(subject: Subject) -> None:
    """metrics are finite numbers and can be stored as JSON."""
    result = _result(subject)
    for leaf, number in _leaves("", result.metrics):
        if isinstance(number, float | int | np.number):
            require(np.isfinite(number), f"metric '{leaf}' is {number}")
    final = result.final
    if not final.at_rest:  # the residual excludes contact forces and those that accelerate a chain in motion
        moves = isinstance(subject.build(), SceneTask) or _ends_in_motion(subject)
        require(moves, f"the residual of the settled chain is {final.residual}")
        result = replace(result, final=replace(final, residual=0.0))
    json.dumps(encode(result, {}), allow_nan=False)


def is_deterministic(subject: Subject) -> None:
    """the same chain in the same engine gives the same result."""
    first, again = _result(subject), _run(subject)
    finding = "markers (m) of a second run differ"
    agree(again.final.markers_m, first.final.markers_m, finding, atol=1e-12)
    # Without wall times, which may differ.
    timeless = [{k: v for k, v in r.metrics.items() if not k.endswith("wall_s")} for r in (again, first)]
    texts = [json.dumps(encode(metrics, {})) for metrics in timeless]
    require(texts[0] == texts[1], f"metrics of a second run differ: {texts[0]} and {texts[1]}")


def runs_on_one_joint(subject: Subject) -> None:
    """the task runs on any number of modules."""
    shape = _run(subject, modules=1).final.markers_m.shape
    require(shape == (3, 3), f"markers of one joint have shape {shape}")


def passes_on_that_it_did_not_converge(subject: Subject) -> None:
    """a chain that did not settle is not reported as settled: `final.converged` is the engine's."""
    if isinstance(subject.build(), SceneTask):
        raise CheckSkipped("a task with contact does not settle")
    final = _run(subject, _NeverSettles).final
    require(not final.converged, "the engine did not converge, the task says that it did")


def history_is_consistent(subject: Subject) -> None:
    """a history has matching shapes: time (t,), joint_angles (t, n, a), markers (t, n + 2, 3)."""
    history = _result(subject).rollout
    if history is None:
        return
    n, t = _chain(subject).n_joints, len(history.time_s)
    shapes = (history.joint_angles.shape, history.markers_m.shape, len(history.actuation))
    require(shapes == ((t, n, 1), (t, n + 2, 3), t), f"for {t} times and {n} joints the shapes are {shapes}")
    require(np.all(np.diff(history.time_s) >= 0), "time_s runs backwards")


def _ends_in_motion(subject: Subject) -> bool:
    """Return whether the last call of a task without contact is a step in time."""
    task: Task = subject.build()
    with _Noting(task.prepare(_chain(subject))) as simulation:
        task.run(simulation)
        return simulation.moves


class _Noting(StandInSimulation):
    """An engine that records whether the last call was `step` or `settle`."""

    moves = False

    def settle(self) -> Equilibrium:
        self.moves = False
        return super().settle()

    def step(self, duration_s: float) -> None:
        self.moves = True
        super().step(duration_s)


class _NeverSettles(StandInSimulation):
    """An engine that never converges."""

    def settle(self) -> Equilibrium:
        return replace(super().settle(), converged=False, residual=1e-3)
