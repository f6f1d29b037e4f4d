"""All searches of a study side by side: asks, hands out, tells, until every branch has stopped.

What is found depends neither on the number of workers nor on who is quicker: every branch has its own optimizer,
which is told whole batches, sorted by number.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from itertools import groupby

from pliant.execution.jobs import JobQueue
from pliant.execution.progress import Progress, ProgressBar
from pliant.interfaces.optimizer import FAILED, NOT_A_NUMBER, Trial
from pliant.search.run.branch import Branch
from pliant.search.run.journal import Generation
from pliant.search.workers import told_of

CHUNK_S = 0.25  # so long a worker has enough to do not to wait for messages
MOST_AT_A_TIME = 64  # branches, where the executor itself knows how many workers it has


class Loop:
    """Branches driven over workers.

    Args:
        branches: not started yet.
        queue: evaluates.
        progress: one bar of evaluations.
        title: of the bar.
        ended: is called with each branch that has stopped, its optimizer still in hand.
        shown: text of the best value, which is given as minimised.
        before_s: wall time of the same search before this loop.
    """

    def __init__(
        self,
        branches: Sequence[Branch],
        queue: JobQueue[Trial, Trial],
        progress: Progress,
        title: str,
        ended: Callable[[Branch], None],
        shown: Callable[[float], str] = "{:.4g}".format,
        before_s: float = 0.0,
    ) -> None:
        self._branches, self._queue, self._ended = branches, queue, ended
        self._progress, self._title, self._shown = progress, title, shown
        self._by_index = {branch.index: branch for branch in branches}
        self._begun, self._before_s = 0.0, before_s
        self._active: dict[int, Generation] = {}
        self._rows: dict[int, list[Trial]] = {}
        self._counts: Counter[str] = Counter()
        self._best = float("inf")
        self._each_s = 0.0
        self._bar: ProgressBar | None = None
        self._total = self._assumed = 0

    @property
    def wall_s(self) -> float:
        """Of the search so far, all sessions together."""
        return self._before_s + time.perf_counter() - self._begun

    def run(self) -> None:
        """Until no branch is left."""
        waiting = deque(self._branches)
        self._queue.wait_until_ready(self._progress)  # not counted: a rate is of evaluations
        self._begun = time.perf_counter()
        try:
            while waiting or self._active:
                while waiting and len(self._active) < self._side_by_side():
                    self._start(waiting.popleft())
                for branch, rows in groupby(self._queue.completed(), key=lambda one: one.key):
                    self._back(self._by_index[branch], [told_of(one) for one in rows])
        finally:
            if self._bar is not None:
                self._bar.finish()

    def _side_by_side(self) -> int:
        """Branches at a time: one more than workers, so that none waits for the optimizer."""
        size = self._queue.executor.size
        return MOST_AT_A_TIME if size is None else size + 1 if size > 1 else 1

    def _start(self, branch: Branch) -> None:
        branch.start()
        if branch.note:
            self._progress.note(branch.note)
        if self._bar is None:
            self._assumed = branch.budget
            self._total = branch.budget * len(self._branches)
            self._bar = self._progress.begin(self._title, self._total, branch.evaluated)
        else:
            self._total += branch.budget - self._assumed
            self._bar.expect(self._total)
            self._bar.advance(branch.evaluated)
        # Sessions before this one; branches side by side tell the same time.
        self._before_s = max(self._before_s, branch.wall_s)
        for trial in branch.trials:
            self._note(trial)
        self._next(branch)

    def _next(self, branch: Branch) -> None:
        """The branch's next batch to the workers, or its end."""
        batch = branch.ask()
        if batch is None:
            self._active.pop(branch.index, None)
            self._total -= branch.budget - branch.evaluated
            if self._bar is not None:
                self._bar.expect(self._total)
            self._ended(branch)
            return
        self._active[branch.index], self._rows[branch.index] = batch, []
        for tasks in self._chunks(batch.open):
            self._queue.submit(tasks, branch.index)

    def _chunks(self, tasks: tuple[Trial, ...]) -> list[tuple[Trial, ...]]:
        """How a batch travels: split over the workers where it is the only one, finer where evaluations are long."""
        workers = self._queue.executor.size or len(tasks)
        alone = len(self._branches) == 1
        most = -(-len(tasks) // workers) if alone else len(tasks)
        if self._each_s > 0.0:
            most = min(most, max(1, round(CHUNK_S / self._each_s)))
        return [tasks[k : k + most] for k in range(0, len(tasks), most)]

    def _back(self, branch: Branch, rows: Sequence[Trial]) -> None:
        """Outcomes have come back; the branch goes on when its batch is whole."""
        batch, got = self._active[branch.index], self._rows[branch.index]
        got += rows
        for row in rows:
            self._note(row)
            if row.simulated:
                self._each_s += 0.1 * (row.wall_s - self._each_s) if self._each_s else row.wall_s
        if self._bar is not None:
            self._bar.advance(sum(row.simulated for row in rows))
        if len(got) == len(batch.open):
            branch.tell(batch, got, self.wall_s)
            self._next(branch)
        if self._bar is not None:
            self._bar.describe(self._said())

    def _note(self, trial: Trial) -> None:
        self._counts[trial.state] += 1
        if trial.feasible:
            self._best = min(self._best, trial.objective)

    def _said(self) -> str:
        """Best value and what went wrong, for the bar."""
        failed = self._counts[FAILED] + self._counts[NOT_A_NUMBER]
        parts = [f"best {self._shown(self._best)}" if self._best < float("inf") else "nothing feasible yet"]
        refused = sum(branch.refused for branch in self._branches)
        parts += [f"{refused} refused"] if refused else []
        parts += [f"{failed} failed"] if failed else []
        return ", ".join(parts)
