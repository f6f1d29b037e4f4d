"""Executors: their names, start and end of processes, and the message for a script without its guard."""

import os
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from filelock import FileLock
from tests.execution.work import threads

from pliant.errors import UserError
from pliant.execution.executors import (
    THREADS,
    FuturesExecutor,
    InlineExecutor,
    ProcessExecutor,
    ThreadExecutor,
    executor_for,
    one_thread_each,
    own_threads,
)
from pliant.execution.jobs import JobQueue
from pliant.execution.progress import LogBar
from pliant.execution.progress_store import FOLDER, LOCK, JobProgress, progress_store_in

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("workers", "most", "made"),
    [
        (1, None, InlineExecutor),
        (3, 1, InlineExecutor),
        (3, 2, ProcessExecutor),
        (InlineExecutor(), 5, InlineExecutor),
    ],
)
def test_an_executor_is_made_from_what_is_said(workers, most, made):
    with executor_for(workers, most) as executor:
        assert type(executor) is made
        assert executor.size == (2 if made is ProcessExecutor else 1)


def test_an_executor_from_the_caller_is_not_shut_down():
    with ThreadPoolExecutor(1) as pool:
        with executor_for(pool) as executor:
            assert type(executor) is FuturesExecutor
        assert pool.submit(int).result() == 0


@pytest.mark.parametrize("workers", [0, -1, True, 5000])
def test_an_invalid_worker_count_is_refused(workers):
    with pytest.raises(UserError, match="whole number from 1"), executor_for(workers):
        pass


def test_workers_have_one_thread_each_unless_the_user_says_otherwise(monkeypatch):
    for name in THREADS:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    with executor_for(2) as executor, JobQueue(executor, threads) as queue:
        assert [one.unwrap() for one in queue.each([0])] == [["3", "1"]]
    assert [name in os.environ for name in THREADS] == [True, False, False, False]
    with one_thread_each():
        assert [os.environ[name] for name in THREADS] == ["3", "1", "1", "1"]


def test_threads_in_this_process_are_those_that_blas_may_have(monkeypatch):
    for stated, made, size in (("1", InlineExecutor, 1), ("3", ThreadExecutor, 3)):
        monkeypatch.setenv("OMP_NUM_THREADS", stated)
        with executor_for(1, threads=own_threads()) as executor, JobQueue(executor, abs) as queue:
            assert type(executor) is made and executor.size == size
            assert [one.unwrap() for one in queue.each([-1, 2, -3, 4])] == [1, 2, 3, 4]
    with executor_for(2, threads=3) as executor:
        assert type(executor) is ProcessExecutor
    monkeypatch.delenv("OMP_NUM_THREADS")
    assert 1 <= own_threads() <= 4


def test_a_script_without_its_guard_is_told_so(tmp_path):
    script = tmp_path / "main.py"
    script.write_text(
        f"import sys\nsys.path.insert(0, {str(ROOT)!r})\n"
        "from pliant.execution.executors import executor_for\nfrom pliant.execution.jobs import JobQueue\n"
        "from tests.execution.work import square\n"
        "with executor_for(2) as executor:\n    print(list(JobQueue(executor, square).each([1, 2])))\n"
    )
    call = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False)
    assert call.returncode != 0
    assert "__name__ == '__main__'" in call.stderr


def test_progress_is_seen_from_other_processes_and_abandoned_folders_go(tmp_path):
    folders = tmp_path / FOLDER
    for name in ("killed", "busy"):
        (folders / name).mkdir(parents=True)
        (folders / name / LOCK).touch()
    with FileLock(folders / "busy" / LOCK), progress_store_in(tmp_path) as progress:
        assert sorted(path.name for path in folders.iterdir()) == sorted(["busy", progress.folder.name])
        assert (progress.states([7]), progress.began(7)) == ("", False)
        job = JobProgress(progress.folder / "7").begin("states", 5)
        job.advance(2)
        assert (progress.states([7, 8]), progress.began(7)) == ("state 2 of 5 in 1 under way", True)
        progress.clear(7)
        assert not progress.began(7)
    assert [path.name for path in folders.iterdir()] == ["busy"]
    with pytest.raises(OSError):
        job.advance()


def test_a_log_has_the_rate_and_the_time_left(monkeypatch):
    clock, lines = [0.0], []
    monkeypatch.setattr("time.monotonic", lambda: clock[0])
    bar = LogBar(lines.append, "designs", 10, done=2)
    for _ in range(4):
        clock[0] += 15.0
        bar.advance()
    bar.finish()
    assert lines[0] == "designs: going on from 2/10"
    assert lines[1] == "designs: 4/10, 15.00 s each, about 90 s left"
    assert lines[-1] == "designs: 6/10 in 60.0 s"


def test_no_thread_of_a_pool_is_left_after_an_interrupt():
    before = set(threading.enumerate())
    with pytest.raises(KeyboardInterrupt), executor_for(2) as executor:
        running = executor.submit(time.sleep, 60)
        executor.submit(time.sleep, 0).result()
        raise KeyboardInterrupt
    assert running.cancelled() or running.done()
    assert set(threading.enumerate()) == before
