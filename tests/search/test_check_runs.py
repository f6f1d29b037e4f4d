"""The runs of a check in parallel: the check finds them, and still reports failures."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from tests.search.found_stand_ins import found
from tests.search.test_verification import RADIUS, StudyProblem, springs

from pliant.execution.executors import FuturesExecutor, InlineExecutor
from pliant.pipeline import simulate
from pliant_search.verify import check as check_runs
from pliant_search.verify.check import run_ahead
from pliant_search.verify.verification import verify

CONDITIONS = {"soft": {"task.pressure": "5 kPa"}, "hard": {"task.pressure": "10 kPa"}}
BOTH = ("physics: quasistatic", "physics: quasistatic\ncross_check: [mujoco]")


@pytest.fixture(autouse=True)
def however_short(monkeypatch):
    monkeypatch.setattr(check_runs, "WORTH_S", 0.0)


@pytest.fixture
def threads():
    with ThreadPoolExecutor(2) as pool:
        yield FuturesExecutor(pool)


def never(*given):
    pytest.fail("it was run again")


def test_what_was_run_ahead_is_not_run_by_the_check(tmp_path, monkeypatch, threads):
    (tmp_path / "alone").mkdir()
    opened, alone = springs(tmp_path, BOTH), springs(tmp_path / "alone", BOTH)
    run_ahead(opened.context, StudyProblem(opened, CONDITIONS), [found(RADIUS)], threads)
    expected = verify(alone.context, StudyProblem(alone, CONDITIONS), found(RADIUS))
    monkeypatch.setattr(simulate, "run_task", never)
    check = verify(opened.context, StudyProblem(opened, CONDITIONS), found(RADIUS))
    assert set(check.verified) == {"quasistatic", "mujoco"}
    assert (check.predicted, check.conditions) == (expected.predicted, expected.conditions)
    assert check.notes == expected.notes == ()


@pytest.mark.slow
def test_designs_in_several_conditions_are_run_ahead(tmp_path, monkeypatch, threads):
    opened = springs(tmp_path)
    problem = StudyProblem(opened, CONDITIONS)
    designs = [found({"family.radius": radius}, context=k) for k, radius in enumerate((4.7e-3, 5.1e-3))]
    run_ahead(opened.context, problem, designs, threads)
    monkeypatch.setattr(simulate, "run_task", never)
    soft, hard = (verify(opened.context, problem, design).verified["quasistatic"] for design in designs)
    assert 0 < soft["max_joint_angle_rad"] < hard["max_joint_angle_rad"]


def test_a_design_that_fem_does_not_solve_is_told_by_the_check(tmp_path, threads):
    opened = springs(tmp_path)
    problem, design = StudyProblem(opened, CONDITIONS), found({**RADIUS, "family.defect": "stuck"})
    run_ahead(opened.context, problem, [design], threads)
    assert any(
        "Direct FEM of the design failed" in note for note in verify(opened.context, problem, design).notes
    )


@pytest.mark.parametrize("conditions, alone", [(CONDITIONS, True), (None, False)])
def test_one_process_and_a_single_run_are_left_to_the_check(
    tmp_path, monkeypatch, threads, conditions, alone
):
    opened = springs(tmp_path)
    monkeypatch.setattr(check_runs, "run_in", never)
    executor = InlineExecutor() if alone else threads
    run_ahead(opened.context, StudyProblem(opened, conditions), [found(RADIUS)], executor)
    assert not (opened.context.store.root / "simulate").exists()


def test_short_runs_are_left_to_the_check(tmp_path, monkeypatch, threads):
    opened = springs(tmp_path)
    monkeypatch.setattr(check_runs, "WORTH_S", 1e6)
    monkeypatch.setattr(check_runs, "run", never)
    run_ahead(opened.context, StudyProblem(opened, CONDITIONS), [found(RADIUS)], threads)
    assert len([p for p in (opened.context.store.root / "simulate").iterdir() if p.is_dir()]) == 1
