"""Workers: processes give what one process gives; who dies is replaced; who kills workers has failed."""

import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import pytest
from tests.search.toy_search import ToyEvaluator, searched, setup_of, told

from pliant.errors import NotReachedError, UserError
from pliant.interfaces.optimizer import Trial
from pliant.pipeline.crews import Given
from pliant.search.evaluate.evaluator import evaluated
from pliant.search.run.journal import Generation
from pliant.search.team import KILLED, Chunk, Team
from pliant.search.workers import Job, Setup, work

VALUES = {"a": 0.5, "b": 0.0, "n": 2}


def test_processes_find_what_one_process_finds(tmp_path):
    two = searched(tmp_path / "two", workers=2, budget=30, branches=({"s": 0}, {"s": 1}, {"s": 2}))
    one = searched(tmp_path / "one", workers=1, budget=30, branches=({"s": 0}, {"s": 1}, {"s": 2}))
    assert told(two) == told(one)


def test_who_kills_workers_fails_and_the_others_are_evaluated(tmp_path):
    killed = tmp_path / "killed"
    (alone,) = searched(tmp_path / "alone", budget=6)
    *_, second, largest = sorted(row.values["a"] for row in alone.rows)
    deadly = (second + largest) / 2  # one of the first batch: every death costs two new processes
    (branch,) = searched(tmp_path / "a", workers=2, budget=6, deadly=deadly, killed=str(killed))
    dead = [row for row in branch.trials if row.values["a"] > deadly]
    assert [row.values["a"] for row in dead] == [largest]
    assert all((row.state, row.cause) == ("failed", KILLED) for row in dead)
    assert all(row.state == "ok" for row in branch.trials if row not in dead)
    assert branch.evaluated == 6
    times = killed.read_text().splitlines()
    assert all(2 <= times.count(repr(row.values["a"])) <= 3 for row in dead)


def test_an_executor_that_breaks_is_said_and_what_was_told_is_kept(tmp_path):
    with ProcessPoolExecutor(1) as pool, pytest.raises(NotReachedError, match="run again to go on"):
        searched(tmp_path / "a", crew=Given(pool, work), deadly=1.2, killed=str(tmp_path / "killed"))
    assert told(searched(tmp_path / "a")) == told(searched(tmp_path / "b"))


def test_a_mistake_of_every_candidate_is_raised_once():
    def refuse(job):
        raise UserError("no engine here.")

    with ThreadPoolExecutor(2) as pool:
        team = Team(Given(pool, refuse), setup_of())
        team.submit(Chunk(0, (Trial(0, VALUES),)))
        with pytest.raises(UserError, match="no engine here"):
            team.collect()


def test_a_cluster_that_loses_a_job_twice_leaves_a_failed_candidate():
    tried = []

    def lose(job):
        tried.append(len(job.tasks))
        if any(task.number == 1 for task in job.tasks):
            raise TimeoutError("worker lost")
        return work(job)

    with ThreadPoolExecutor(1) as pool:
        team = Team(Given(pool, lose), setup_of())
        team.submit(Chunk(7, tuple(Trial(k, VALUES) for k in range(3))))
        back = []
        while team.waiting:
            back += team.collect()
    assert {branch for branch, _ in back} == {7}
    rows = {row.number: row for _, chunk in back for row in chunk}
    assert [rows[k].state for k in range(3)] == ["ok", "failed", "ok"]
    assert rows[1].cause == "TimeoutError: worker lost"
    assert sorted(tried) == [1, 1, 1, 3]


def test_a_worker_builds_its_evaluator_once():
    first = work(Job(setup_of(delay_s=0.0), (Trial(0, VALUES),)))
    assert first[0].objectives == ToyEvaluator().evaluate(VALUES).objectives
    from pliant.search import workers

    kept = workers._KEPT.evaluator
    work(Job(setup_of(delay_s=0.0), (Trial(1, VALUES),)))
    assert workers._KEPT.evaluator is kept
    work(Job(setup_of(delay_s=1e-4), (Trial(1, VALUES),)))
    assert workers._KEPT.evaluator is not kept


@pytest.mark.parametrize(
    ("setup", "words"),
    [(Setup("{}", (), "/", "abc"), "another version"), (Setup("{}", (), "/nowhere"), "does not see")],
)
def test_a_worker_elsewhere_says_what_it_lacks(setup, words):
    with pytest.raises(UserError, match=words):
        work(Job(setup, ()))


def test_ctrl_c_inside_compiled_code_is_no_failed_candidate():
    class Compiled:
        def evaluate(self, values, context=-1):
            try:
                raise KeyboardInterrupt
            except KeyboardInterrupt as error:
                raise SystemError("error return without exception set") from error

    with pytest.raises(KeyboardInterrupt):
        evaluated(Compiled(), Trial(0, VALUES))


def test_an_outcome_survives_its_journal():
    row = Trial(
        3,
        {"a": 0.1 + 0.2, "n": 2, "k": "x"},
        1,
        "ok",
        (1 / 3, 2.0),
        0.25,
        "why",
        {"m": 1e-300},
        {"c": {"m": 2.0}},
        (1.0,),
        7,
        0.5,
    )
    generation = Generation(4, 6, (row,), 2.5)
    assert Generation.of_line(generation.line().encode()) == generation


def test_a_script_without_its_guard_is_told_so(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "from pathlib import Path\nfrom tests.search.toy_search import searched\n"
        f"searched(Path({str(tmp_path / 'a')!r}), workers=2)\n"
    )
    root = Path(__file__).parents[2]
    guardless = tmp_path / "main.py"
    guardless.write_text(f"import sys\nsys.path.insert(0, {str(root)!r})\n" + script.read_text())
    call = subprocess.run([sys.executable, str(guardless)], capture_output=True, text=True, check=False)
    assert call.returncode != 0
    assert "__name__ == '__main__'" in call.stderr
