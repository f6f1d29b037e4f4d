"""Inverse statics: success rate and time for random reachable poses, along a path, and for unreachable ones.

python -m benchmarks.inverse_statics        prints, and writes benchmarks/out/inverse_statics.json

Poses are those of hidden random actuations. Times are this process's processor time, the reachable set solved before.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from benchmarks.output import Bar, engine, make_parser, write

from pliant.config.chain import ChainConfig
from pliant.inverse.statics import InverseStatics
from pliant.inverse.target import Target
from pliant.pipeline.chain import Segment, build_chain, rod_module
from pliant.records.chain import Actuator, ChainModel
from pliant.records.design import Array
from pliant.records.law import Domain
from pliant.records.rollout import Inputs
from pliant.testing.samples import sample_chain
from pliant_plugins.surrogates.config import StudyCoefficients
from pliant_plugins.surrogates.polynomial.law import study_law
from pliant_plugins.surrogates.polynomial.several_law import SeveralLaw

POSES, OUT_OF_REACH, PATH, SEED = 500, 100, 1000, 0
WORKED = StudyCoefficients(k_n=1.637e-6, m_a=-1.704e-6, b_a=0.0, m_e=0.1012, b_e=0.0245)
BOX = Domain(np.array([0.0, 15e3]), np.array([[-0.6, 0.7]]))


@dataclass(frozen=True)
class BenchmarkRobot:
    """A chain, its kind of target, and the bar of the median time."""

    chain: ChainModel
    asks: Callable[[Array, Array], Target]  # markers (n + 2, 3), attitude of the tip
    median_s: float


def finger() -> BenchmarkRobot:
    """Return eight bending modules with 5 g at their tip, and the target of the tip."""
    chain = sample_chain(study_law(WORKED, True, BOX), modules=8, payload=0.005)
    return BenchmarkRobot(chain, lambda markers, turn: Target(tip_m=markers[-1]), 0.3e-3)


def two_segments() -> BenchmarkRobot:
    """Return two segments of five ball joints with three pressures each in one law, and the target of the tip."""
    segments = []
    for number in range(2):
        own = tuple(Actuator(f"pressure_{3 * number + k}_pa") for k in (1, 2, 3))
        segments.append(
            Segment(rod_module(three_chambers(), 0.012, 0.0015), 5, number * np.pi / 3, actuators=own)
        )
    return BenchmarkRobot(
        build_chain(ChainConfig(modules=5), segments), lambda markers, turn: Target(tip_m=markers[-1]), 3e-3
    )


def three_chambers() -> SeveralLaw:
    """Return a law of chambers at 0, 120 and 240 degrees that soften with pressure; STATED numbers.

    With unit pressures x, p = 7.5 kPa (1 + x), and unit angles v, u = 0.6 v: stiffness 0.02 N·m/rad, twist 0.05, of
    fourth order 0.03, push 6e-7 N·m/Pa, softening 1e-7 N·m/(Pa·rad).
    """
    half, turn, push, softer = 7.5e3, 0.6, 6e-7, 1e-7
    terms: dict[tuple[int, ...], float] = {
        (0, 0, 0, 2, 0, 0): 0.05 / 2 * turn**2,
        (0, 0, 0, 0, 4, 0): 0.03 / 4 * turn**4,
        (0, 0, 0, 0, 0, 4): 0.03 / 4 * turn**4,
        (0, 0, 0, 0, 2, 0): (0.02 - 3 * softer * half) / 2 * turn**2,
        (0, 0, 0, 0, 0, 2): (0.02 - 3 * softer * half) / 2 * turn**2,
    }
    for k in range(3):
        x = np.eye(3, dtype=int)[k].tolist()
        side = 2 * np.pi * k / 3
        terms[(*x, 0, 1, 0)] = -half * push * turn * float(np.cos(side))
        terms[(*x, 0, 0, 1)] = -half * push * turn * float(np.sin(side))
        terms[(*x, 0, 2, 0)] = terms[(*x, 0, 0, 2)] = -half * softer / 2 * turn**2
    maps = np.array([[half, half]] * 3 + [[0.0, turn]] * 3)
    box = np.column_stack([maps[:, 0] - maps[:, 1], maps[:, 0] + maps[:, 1]])
    names = "pressure_1_pa, pressure_2_pa, pressure_3_pa"
    numbers = (np.array(list(terms)), np.array(list(terms.values())), maps)
    return SeveralLaw(*numbers, Domain(box[:3], box[3:]), names, ("x", "y", "z"), "spherical")


def main() -> None:
    make_parser(__doc__).parse_args()
    results, bars = {}, []
    for name, robot in {"bending finger": finger(), "two segments, six pressures": two_segments()}.items():
        found, own = measured(name, robot)
        results[name] = found
        bars += own
    write("inverse_statics", results, bars)


def measured(name: str, robot: BenchmarkRobot) -> tuple[dict[str, float], list[Bar]]:
    """Return the figures of one robot."""
    random = np.random.default_rng(SEED)
    simulation = engine("quasistatic").build(robot.chain)
    inverse = InverseStatics(simulation)
    low, high = inverse.bounds.T
    begun = time.process_time()
    reachable = inverse.reachable
    of_set_s = time.process_time() - begun

    def target(values: Array, away: Array | float = 0.0) -> Target:
        found = simulation.respond(Inputs(dict(zip(inverse.inputs, values.tolist(), strict=True))))
        assert found.converged
        return robot.asks(found.markers_m + away, found.tip_rotation)

    poses = [target(values) for values in random.uniform(low, high, (POSES, len(low)))]
    times, away = [], []
    for pose in poses:
        begun = time.process_time()
        away.append(inverse.solve(pose).distance_m)
        times.append(time.process_time() - begun)
    steps = np.linspace(0.0, 2 * np.pi, PATH)
    phases = np.linspace(0.0, np.pi, len(low), endpoint=False)
    circle = (low + high) / 2 + 0.4 * (high - low) * np.cos(steps[:, None] + phases)
    path = [target(values) for values in circle]
    begun = time.process_time()
    along = inverse.path(path)
    path_s = time.process_time() - begun
    # Out of reach for certain: farther from the base than the chain is long, or off a plane that it cannot leave.
    base = np.asarray(robot.chain.base_position_m, float)
    named = 0
    for _ in range(OUT_OF_REACH):
        direction = random.normal(size=3)
        place = base + direction / np.linalg.norm(direction) * robot.chain.length_m * random.uniform(
            1.02, 2.0
        )
        answer = inverse.solve(Target(tip_m=place))
        true = np.linalg.norm(reachable.tips_m - place, axis=1).min()
        named += not answer.reached and answer.distance_m <= true + 1e-9 and "Out of reach" in str(answer)
    found = {
        "solved": float(np.mean(np.array(away) <= 1e-6)),
        "median_s": float(np.median(times)),
        "worst_s": float(np.max(times)),
        "path_s": path_s,
        "path_solved": float(np.mean([one.reached for one in along])),
        "out_of_reach_named": named,
        "reachable_set_s": of_set_s,
    }
    bars = [
        Bar(f"{name}: {POSES} poses solved to 1 um", found["solved"], 0.99, "%", at_most=False, scale=100),
        Bar(f"{name}: median time", found["median_s"], robot.median_s, "ms", scale=1e3),
        Bar(f"{name}: path of {PATH} poses", path_s, 1.5, "s"),
        Bar(f"{name}: path solved", found["path_solved"], 0.99, "%", at_most=False, scale=100),
        Bar(f"{name}: out of reach, named rightly", float(named), OUT_OF_REACH, "targets", at_most=False),
    ]
    return found, bars


if __name__ == "__main__":
    main()
