"""Jobs: a job that kills a worker twice, the second time alone, has failed, and no other job is lost."""

import errno
from concurrent.futures import BrokenExecutor, CancelledError, Future, ProcessPoolExecutor, ThreadPoolExecutor

import pytest
from tests.execution.work import deadly, square

from pliant.errors import NotReachedError, UserError
from pliant.execution.executors import FuturesExecutor, InlineExecutor, executor_for
from pliant.execution.jobs import KILLED, JobQueue
from pliant.execution.progress import Silent


class KilledWorker(Exception):  # noqa: N818 - as dask names it
    pass


class Mortal(InlineExecutor):
    """An executor whose workers die, or lose a job, under the calls that a test names.

    A pool loses its jobs in progress with a worker; with `holds`, these are all jobs until a worker dies.
    """

    def __init__(self, dies, error=BrokenExecutor, size=1, restarts=True, holds=False):
        self.size, self.dies, self.error, self.restarts, self.holds = size, dies, error, restarts, holds
        self.calls, self.held, self.restarted = [], [], 0

    def submit(self, function, work, items):
        if not items:
            return super().submit(function, work, items)
        assert len(self.calls) < 100, "jobs are handed in without end"
        self.calls.append(items)
        future = Future()
        if self.dies(items, self.calls):
            self.holds = False
            for one in [future, *self.held]:
                one.set_exception(self.error("gone"))
        elif self.holds:
            self.held.append(future)
        else:
            future.set_result(function(work, items))
        return future

    def restart(self):
        self.restarted += 1
        return self.restarts


def everything(queue):
    found = {}
    while queue.waiting:
        found |= {one.item: one for one in queue.completed()}
    return found


@pytest.mark.parametrize(("size", "under_way"), [(1, 1), (2, 3), (4, 5), (None, 9)])
def test_each_worker_has_a_job_and_one_waits_and_an_unknown_worker_count_has_all(size, under_way):
    executor = Mortal(lambda items, calls: False, size=size, holds=True)
    queue = JobQueue(executor, square)
    for k in range(9):
        queue.submit([k])
    assert executor.calls == [(k,) for k in range(under_way)]
    assert queue.running == list(range(under_way))


def test_a_queue_gives_each_its_result_in_order_whoever_works():
    with ThreadPoolExecutor(3) as threads:
        for workers in (1, 2, threads):
            with executor_for(workers) as executor, JobQueue(executor, square) as queue:
                assert [one.unwrap() for one in queue.each(range(20))] == [k * k for k in range(20)]


def test_processes_that_die_are_replaced_and_only_the_killer_fails(tmp_path):
    items = [(number, str(tmp_path), times) for number, times in ((0, 0), (1, 9), (2, 0), (3, 1), (4, 0))]
    with executor_for(2) as executor, JobQueue(executor, deadly) as queue:
        queue.submit(items[:3])
        queue.submit(items[3:])
        found = everything(queue)
    failed = {item[0] for item, one in found.items() if one.failure}
    assert failed == {1}
    assert found[items[1]].failure.cause == KILLED
    with pytest.raises(NotReachedError):
        found[items[1]].unwrap()
    assert [found[item].unwrap() for item in items if item[0] != 1] == [0, 4, 9, 16]
    assert 2 <= len((tmp_path / "1").read_text().split()) <= 3


@pytest.mark.parametrize(
    ("error", "told"),
    [(OSError("handle is closed"), BrokenExecutor), (OSError(errno.EMFILE, "too many open files"), OSError)],
)
def test_a_pool_that_closes_while_a_process_begins_is_a_broken_one(monkeypatch, error, told):
    def begin_in_closed_pool(pool, *call):
        raise error

    with executor_for(2) as executor:
        monkeypatch.setattr(ProcessPoolExecutor, "submit", begin_in_closed_pool)
        with pytest.raises(told):
            executor.submit(square, 2)


@pytest.mark.parametrize("travels", [1, 3])
@pytest.mark.parametrize("error", [BrokenExecutor, KilledWorker])
def test_pools_and_clusters_quarantine_alike(error, travels):
    executor = Mortal(lambda items, calls: 4 in items, error)
    with JobQueue(executor, square) as queue:
        for k in range(0, 9, travels):
            queue.submit(range(k, k + travels))
        found = everything(queue)
    assert {k for k, one in found.items() if one.failure} == {4}
    assert all(one.unwrap() == k * k for k, one in found.items() if k != 4)
    assert executor.calls.count((4,)) == 2
    assert bool(executor.restarted) == (error is BrokenExecutor)


def test_one_death_is_forgiven():
    executor = Mortal(lambda items, calls: items == (4,) and calls.count(items) == 1)
    with JobQueue(executor, square) as queue:
        found = [one.unwrap() for one in queue.each(range(6))]
    assert found == [k * k for k in range(6)]


def test_who_had_not_begun_is_no_suspect():
    executor = Mortal(lambda items, calls: len(calls) == 3, size=2, holds=True)
    with JobQueue(executor, square, began=lambda item: item == 1) as queue:
        assert [one.unwrap() for one in queue.each(range(5))] == [0, 1, 4, 9, 16]
    assert executor.calls[:3] == [(0,), (1,), (2,)]  # all lost
    assert executor.calls[3] == (1,)  # the suspect, alone, before all others
    assert executor.calls[4:] == [(0,), (2,), (3,), (4,)]


def test_an_executor_that_cannot_be_restarted_says_that_it_broke():
    executor = Mortal(lambda items, calls: True, restarts=False)
    with (
        JobQueue(executor, square) as queue,
        pytest.raises(NotReachedError, match="run the command again to continue"),
    ):
        list(queue.each([1]))


def test_workers_that_end_before_they_begin_are_no_job_failure():
    class FailedAtStart(Mortal):
        def submit(self, function, work, items):
            future = Future()
            future.set_exception(BrokenExecutor())
            return future

    executor = FailedAtStart(None, size=2)
    with pytest.raises(NotReachedError, match="__main__"):
        JobQueue(executor, square).wait_until_ready(Silent())
    assert executor.restarted == 1


@pytest.mark.parametrize("error", [TimeoutError, CancelledError])
def test_a_job_that_the_executor_loses_is_tried_once_more_by_itself(error):
    executor = Mortal(lambda items, calls: 1 in items, error)
    with JobQueue(executor, square) as queue:
        queue.submit(range(3), "key")
        found = everything(queue)
    assert executor.calls == [(0, 1, 2), (0,), (1,), (2,)]
    assert [found[k].failure is None for k in range(3)] == [True, False, True]
    assert {one.key for one in found.values()} == {"key"}


def raises(item):
    raise {1: ZeroDivisionError("b"), 2: UserError("no engine here."), 3: ImportError("no torch")}[item]


def test_what_one_item_raises_is_its_own_failure_and_what_all_would_meet_ends_the_work():
    with ThreadPoolExecutor(1) as threads:
        queue = JobQueue(FuturesExecutor(threads), raises)
        (one,) = queue.each([1])
        assert one.failure.cause == "ZeroDivisionError: b"
        with pytest.raises(ZeroDivisionError):
            one.unwrap()
        with pytest.raises(UserError, match="no engine here"):
            list(queue.each([2]))
        with pytest.raises(UserError, match="cannot import"):
            list(queue.each([3]))


def interrupted_in_compiled_code(item):
    try:
        raise KeyboardInterrupt
    except KeyboardInterrupt as error:
        raise SystemError("error return without exception set") from error


def test_ctrl_c_inside_compiled_code_is_no_failure():
    with pytest.raises(KeyboardInterrupt):
        list(JobQueue(InlineExecutor(), interrupted_in_compiled_code).each([1]))
