"""The bench of the closed loop's benchmark: the same readings as the sets of the evidence bed."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.bench.arms import RandomRuns, rich_minutes, rich_protocols
from benchmarks.bench.bed_bench import BedBench
from benchmarks.bench.loop_tasks import LoopPlan, experiment
from benchmarks.evidence.robots import ROBOTS
from benchmarks.evidence.sets import SetSpec, make_set

from pliant_bench.bench import BenchProtocol, BenchRecording
from pliant_bench.choose import Choice
from pliant_bench.limits import check_protocol
from pliant_bench.loop.experiment import Situation
from pliant_bench.loop.planner import first_repeat


def test_the_rich_protocol_on_the_bench_gives_the_readings_of_the_set() -> None:
    spec = SetSpec("mullins", 1, "functional", "joint", "rich", "calibration")
    made = make_set(spec)
    label = {**made.label, "sigma": dict.fromkeys(made.sigma, 0.0)}
    bench = BedBench.from_label(label, 0)
    for protocol, hidden in zip(rich_protocols(bench)[:5], made.hidden, strict=False):
        recording = bench.run(protocol, lambda sample: None)
        np.testing.assert_allclose(recording.readings["angle_rad"], hidden["angle_rad"], atol=1e-9)


def test_sixty_truths_of_all_groups_and_the_first_ones_of_each() -> None:
    tasks = LoopPlan().tasks()
    assert len(tasks) == 60 and len({task.public_id for task in tasks}) == 60
    assert {task.group for task in LoopPlan(share=0.2).tasks()} == {"effect", "clean", "unknown", "pair"}
    judged = LoopPlan(split="judged", draw="abc").tasks()
    assert {task.spec.engine for task in judged} == {"functional", "mujoco", "explicit"}
    assert not {task.public_id for task in judged} & {task.public_id for task in tasks}


def situation(recordings: list[BenchRecording]) -> Situation:
    """Return a situation for planners that look at the recordings alone."""
    return Situation(None, None, recordings, np.inf)  # type: ignore[arg-type]


def recorded(protocol: BenchProtocol) -> BenchRecording:
    """Return a complete recording without outputs."""
    clock = protocol.time_s
    return BenchRecording(protocol, clock, clock, protocol.commands, {}, np.zeros(len(clock), bool))


class AfterRuns:
    """A planner that asks for the first condition until a number of runs is done."""

    def __init__(self, first: BenchProtocol, runs: int) -> None:
        self.first, self.runs = first, runs

    def repeat(self, number: int) -> Choice:
        return Choice(self.first, "repeat", "")

    def next(self, now: Situation) -> Choice:
        over = len(now.recordings) > self.runs
        return Choice(None if over else self.first, "expose", "", exposes=("leak",))


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_planners_that_are_compared_keep_the_same_limits_and_count_visits(robot: str) -> None:
    spec = SetSpec("none", 1, "functional", robot, "rich", "calibration")
    bench = BedBench(spec, (), dict.fromkeys(ROBOTS[robot].outputs, 0.0))
    settings = experiment(bench.robot)
    first = first_repeat(settings, bench).protocol
    assert first is not None
    random = RandomRuns(AfterRuns(first, 20), settings, bench)  # type: ignore[arg-type]
    visits = 0
    done = [recorded(first)]
    for _ in range(20):
        choice = random.next(situation(done))
        assert choice.protocol is not None and choice.protocol.words != first.words
        assert choice.exposes == ("leak",)
        check_protocol(choice.protocol, bench.inputs)
        visits += choice.minutes > 2.0 + choice.protocol.duration_s / 60.0
        done.append(recorded(choice.protocol))
    assert 0 < visits < 12
    assert random.next(situation(done)).protocol is None  # it ends by the other planner's rules
    motion = sum(one.duration_s for one in rich_protocols(bench)) / 60.0
    assert motion < rich_minutes(bench, settings) < motion + 60.0
