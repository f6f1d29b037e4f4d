"""Ask-and-tell loop over all branches of a study in parallel, until every branch has stopped.

The result depends neither on the number of workers nor on their speed: every branch has its own optimizer, whose
`tell` gets whole batches, sorted by number.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from pliant.errors import ContractError
from pliant.execution.jobs import JobQueue
from pliant.execution.progress import Progress, ProgressBar
from pliant_search.optimizer import FAILED, NOT_A_NUMBER, Optimizer, Space, Trial
from pliant_search.problem.search_problem import SearchProblem
from pliant_search.run.journal import Generation, Journal
from pliant_search.workers import finished_trial

SNAPSHOT_EVERY_S = 30.0
REFUSED_PER_EVALUATION = 50
BUDGET, UNTIL, EXHAUSTED = "budget", "until", "exhausted"
CHUNK_S, LEAST_S = 0.25, 0.02  # longest and shortest work of one message to a worker
MOST_AT_A_TIME = 64  # branches; used if the number of workers is not known


class _MismatchError(Exception):
    """Error of an optimizer whose proposals differ from those in the journal."""


class Branch:
    """Search of one combination of the `each` variables, with its optimizer and its journal.

    Args:
        index: of the branch; with the study's seed it determines all proposals.
        problem: the search, its budget and rules.
        make: builds its optimizer.
        space: that the optimizer searches.
        journal: of this branch.
        times: its budget as a multiple of the study's budget, or of `generations` times the optimizer's batch.

    Attributes:
        budget: largest number of simulated candidates; known once the optimizer is started.
        trials: reported to the optimizer in `batches`; `evaluated` of them were simulated, `refused` were not.
        stopped: why it ended: "budget", "until", "exhausted"; "" while it runs.
        wall_s: of the search, summed over sessions.
        note: why it could not resume from its journal, if so.
    """

    def __init__(
        self,
        index: int,
        problem: SearchProblem,
        make: Callable[[], Optimizer],
        space: Space,
        journal: Journal,
        times: int = 1,
    ) -> None:
        self.index, self._problem, self._make, self._times = index, problem, make, times
        self._space, self._journal = space, journal
        self._seed = int(np.random.SeedSequence((problem.config.seed, index)).generate_state(1)[0]) % 2**31
        self.budget, self.note = times * problem.config.budget, ""
        self._saved = time.monotonic()
        self._reset()

    def _reset(self) -> None:
        self.optimizer = self._make()
        self.trials: list[Trial] = []
        self.evaluated = self.refused = self.batches = 0
        self.stopped, self.wall_s = "", 0.0
        # Where `until` must be satisfied: in each context, since each has its own design.
        self._ahead = set(range(len(self._space.contexts))) or {-1}

    @property
    def gave_up(self) -> bool:
        """Return whether too many candidates were refused to continue the search."""
        return self.refused >= REFUSED_PER_EVALUATION * self.budget

    def start(self) -> None:
        """Start, or resume from the journal; `note` states why that was not possible."""
        recorded = self._journal.read()
        self.optimizer.start(self._space, self._seed)
        config, batch = self._problem.config, max(1, self.optimizer.batch)
        if config.generations is not None:
            self.budget = self._times * config.generations * batch
        elif config.halving is not None:  # whole batches, so that a larger budget continues after the last
            self.budget += -self.budget % batch
        try:
            self._resume(recorded)
        except Exception as error:  # a plugin may raise anything on a state of another version
            if not recorded:
                raise
            cause = str(error) if isinstance(error, _MismatchError) else f"{type(error).__name__}: {error}"
            self.note = f"search {self.index} begins anew: its journal cannot be followed ({cause})."
            self._journal.clear()
            self._reset()
            self.optimizer.start(self._space, self._seed)

    def _resume(self, recorded: Sequence[Generation]) -> None:
        """Replay the journal as far as the budget allows, calling `tell` with its trials."""
        followed: list[Generation] = []
        for generation in recorded:
            if self.stopped or generation.asked != min(generation.size, self.budget - self.evaluated):
                break
            self._count(generation)
            followed.append(generation)
        if len(followed) < len(recorded):
            self._journal.keep(len(followed))
        begin, snapshot = 0, self._journal.snapshot()
        if snapshot is not None and snapshot[0] > len(followed):
            self._journal.forget_snapshot()  # it would match again once other batches replace them
        elif snapshot is not None:
            self.optimizer = self._make()
            begin = snapshot[0]
            self.optimizer.restore(snapshot[1])
        for generation in followed[begin:]:
            proposed, kept = (
                [(trial.number, trial.context, dict(trial.values)) for trial in trials]
                for trials in (self._proposed(generation.asked), generation.trials)
            )
            if proposed != kept:
                raise _MismatchError("the optimizer proposes other candidates now")
            self._learn(generation)

    def ask(self) -> Generation | None:
        """Return the next generation with trials to evaluate; None when the search has stopped."""
        while not self.stopped:
            size = max(1, self.optimizer.batch)
            asked = min(size, self.budget - self.evaluated)
            proposed = self._proposed(asked)
            trials = [
                trial.refused(broken) if broken else trial
                for trial, broken in zip(proposed, self._problem.violated_each(proposed), strict=True)
            ]
            generation = Generation(asked, size, tuple(trials))
            if generation.open:
                return generation
            if not trials:
                self.stopped = EXHAUSTED
                self._journal.sync()
            else:
                self.tell(generation, (), self.wall_s)
        return None

    def tell(self, generation: Generation, evaluated: Sequence[Trial], wall_s: float) -> None:
        """Record a generation with its evaluated trials, then call the optimizer's `tell`."""
        done = [trial for trial in generation.trials if trial not in generation.open]
        trials = tuple(sorted((*done, *evaluated), key=lambda trial: trial.number))
        record = replace(generation, trials=trials, wall_s=wall_s)
        self._journal.append(record)
        self._learn(record)
        self._count(record)
        if self.stopped:
            self._journal.sync()
        due = time.monotonic() - self._saved >= SNAPSHOT_EVERY_S
        # A last batch truncated by the budget would prevent a continuation with a larger budget.
        if (self.stopped or due) and record.asked == record.size:
            self._journal.save(self.batches, self.optimizer.state())
            self._saved = time.monotonic()

    def recommended(self) -> list[Trial]:
        """Return the optimizer's recommendations beyond its trials, without those that violate constraints."""
        found = [replace(self._full(trial), number=-1) for trial in self.optimizer.recommend()]
        return [trial for trial in found if not self._problem.violated(trial.values, trial.context)]

    def _full(self, trial: Trial) -> Trial:
        """Return the trial with all values, including those of the branch, and its condition."""
        names = [variable.name for variable in self._space.variables]
        if set(trial.values) != set(names):
            raise ContractError(
                f"the optimizer proposes values for {', '.join(sorted(trial.values)) or 'nothing'}; the search is "
                f"over {', '.join(names)}."
            )
        context = max(trial.context, 0) if self._space.contexts else -1
        return replace(
            trial, values={**self._problem.branches()[self.index], **trial.values}, context=context
        )

    def _proposed(self, count: int) -> list[Trial]:
        proposed = sorted(self.optimizer.ask(count), key=lambda trial: trial.number)
        if len(proposed) > count:
            raise ContractError(
                f"the optimizer was asked for {count} candidates and proposes {len(proposed)}."
            )
        return [self._full(trial) for trial in proposed]

    def _learn(self, generation: Generation) -> None:
        self.optimizer.tell([trial.told(self._space.objectives) for trial in generation.trials])

    def _count(self, generation: Generation) -> None:
        """Count a generation and check whether the search stops."""
        simulated = sum(trial.simulated for trial in generation.trials)
        self.trials += generation.trials
        self.batches += 1
        self.evaluated += simulated
        self.refused += len(generation.trials) - simulated
        self.wall_s = generation.wall_s
        for trial in generation.trials:
            if trial.feasible and self._problem.reached(trial.values, trial.metrics):
                self._ahead.discard(trial.context)
        if not self._ahead:
            self.stopped = UNTIL
        elif self.evaluated >= self.budget:
            self.stopped = BUDGET
        elif self.gave_up:
            self.stopped = EXHAUSTED


class Loop:
    """Loop that distributes the branches' trials over workers.

    Args:
        branches: not started yet.
        queue: evaluates trials.
        progress: shows one bar of evaluations.
        title: of the bar.
        ended: called with each branch that has stopped, while it still has its optimizer.
        shown: formats the best value, which is given as minimised.
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
        self._active: dict[
            int, tuple[Generation, list[Trial]]
        ] = {}  # the generation under evaluation, and its trials that have returned
        self._counts: Counter[str] = Counter()
        self._best = float("inf")
        self._each_s = 0.0
        self._bar: ProgressBar | None = None
        self._total = self._assumed = 0

    @property
    def wall_s(self) -> float:
        """Wall time of the search so far, summed over sessions."""
        return self._before_s + time.perf_counter() - self._begun

    def run(self) -> None:
        """Run until all branches have stopped."""
        waiting, size = deque(self._branches), self._queue.executor.size
        # One more branch than workers, so that no worker waits for an optimizer.
        side_by_side = MOST_AT_A_TIME if size is None else size + 1 if size > 1 else 1
        self._queue.wait_until_ready(self._progress)  # not counted, since the rate is that of evaluations
        self._begun = time.perf_counter()
        try:
            while waiting or self._active:
                while waiting and len(self._active) < side_by_side:
                    branch = waiting.popleft()
                    self._next(branch, self._start(branch))
                for index, rows in groupby(self._queue.completed(), key=lambda one: one.key):
                    self._back(self._by_index[index], [finished_trial(one) for one in rows])
        finally:
            if self._bar is not None:
                self._bar.finish()

    def _start(self, branch: Branch) -> ProgressBar:
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
        # Earlier sessions; parallel branches report the same time.
        self._before_s = max(self._before_s, branch.wall_s)
        self._note(branch.trials)
        return self._bar

    def _next(self, branch: Branch, bar: ProgressBar) -> None:
        """Send the branch's next batch to the workers, or end the branch."""
        batch = branch.ask()
        if batch is None:
            self._active.pop(branch.index, None)
            self._total -= branch.budget - branch.evaluated
            bar.expect(self._total)
            self._ended(branch)
            return
        self._active[branch.index] = batch, []
        for part in self._parts(batch.open):
            self._queue.submit(part, branch.index)

    def _parts(self, trials: Sequence[Trial]) -> Iterator[Sequence[Trial]]:
        """Yield the parts of a batch to send together: smaller for long evaluations, shrinking for one branch.

        The last parts are small, so that workers end at the same time (guided self-scheduling, Polychronopoulos and
        Kuck, IEEE Transactions on Computers C-36, 1987).
        """
        most = max(1, round(CHUNK_S / self._each_s)) if self._each_s > 0.0 else len(trials)
        least = max(1, round(LEAST_S / self._each_s)) if self._each_s > 0.0 else 1
        workers = self._queue.executor.capacity() or len(trials)
        while trials:
            share = -(-len(trials) // (2 * workers)) if len(self._branches) == 1 else len(trials)
            count = min(max(share, least), most)
            yield trials[:count]
            trials = trials[count:]

    def _back(self, branch: Branch, rows: Sequence[Trial]) -> None:
        """Take evaluated trials; continue the branch when its batch is complete."""
        bar = self._bar
        assert bar is not None
        batch, got = self._active[branch.index]
        got += rows
        self._note(rows)
        simulated = [row for row in rows if row.simulated]
        for row in simulated:
            self._each_s += 0.1 * (row.wall_s - self._each_s) if self._each_s else row.wall_s
        bar.advance(len(simulated))
        if len(got) == len(batch.open):
            branch.tell(batch, got, self.wall_s)
            self._next(branch, bar)
        failed = self._counts[FAILED] + self._counts[NOT_A_NUMBER]
        refused = sum(one.refused for one in self._branches)
        parts = [f"best {self._shown(self._best)}" if self._best < float("inf") else "nothing feasible yet"]
        parts += [f"{refused} refused"] if refused else []
        parts += [f"{failed} failed"] if failed else []
        bar.describe(", ".join(parts))

    def _note(self, trials: Sequence[Trial]) -> None:
        self._counts.update(trial.state for trial in trials)
        self._best = min([self._best, *(trial.objective for trial in trials if trial.feasible)])
