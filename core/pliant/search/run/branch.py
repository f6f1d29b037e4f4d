"""One search under way: its optimizer is asked and told, its journal follows, until it stops."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from pliant.errors import ContractError
from pliant.interfaces.optimizer import Optimizer, Space, Trial, Value
from pliant.search.run.journal import Generation, Journal, Snapshot

SNAPSHOT_EVERY_S = 30.0
REFUSED_PER_EVALUATION = 50
BUDGET, UNTIL, EXHAUSTED = "budget", "until", "exhausted"


class Rules(Protocol):
    """What a branch asks of the problem."""

    def violated(self, values: Mapping[str, Value], condition: int = -1) -> dict[str, float]:
        """Constraint → amount, of those that name variables only; −1: for all conditions."""
        ...

    def reached(self, values: Mapping[str, Value], metrics: Mapping[str, float]) -> bool:
        """Whether `until` holds."""
        ...


class _MismatchError(Exception):
    """The optimizer proposes something else than the journal holds."""


class Branch:
    """The search of one combination of the `each` variables.

    Args:
        index: its place among the branches; with the seed it decides all proposals.
        values: of the `each` variables.
        make: builds its optimizer.
        problem: knows constraints and `until`.
        space: what is searched.
        journal: of this branch.
        seed: of the study.
        budget: candidates that are simulated; None: `generations` times the optimizer's batch.
        generations: see `budget`.
        whole: whether the budget is rounded up to whole batches, so that a larger one goes on behind the last.
    """

    def __init__(
        self,
        index: int,
        values: Mapping[str, Value],
        make: Callable[[], Optimizer],
        problem: Rules,
        space: Space,
        journal: Journal,
        seed: int,
        budget: int,
        generations: int | None = None,
        whole: bool = False,
    ) -> None:
        self.index, self.values, self._make = index, values, make
        self.optimizer = make()
        self._problem, self._space, self._journal = problem, space, journal
        self._seed = seed_of(seed, index)
        self._budget, self._generations, self._whole = budget, generations, whole
        self.trials: list[Trial] = []
        self._ahead = self._conditions()
        self.evaluated = self.refused = self.batches = 0
        self.stopped = ""
        self.wall_s = 0.0
        self.note = ""
        self._saved = time.monotonic()

    @property
    def gave_up(self) -> bool:
        """Whether too many candidates were refused for the search to go on."""
        return self.refused >= REFUSED_PER_EVALUATION * self._budget

    @property
    def budget(self) -> int:
        """Candidates that are simulated at most; known once the optimizer is started."""
        return self._budget

    def start(self) -> None:
        """Begin, or go on from the journal; `note` says where that was not possible."""
        recorded = self._journal.read()
        self.optimizer.start(self._space, self._seed)
        if self._generations is not None:
            self._budget = self._generations * max(1, self.optimizer.batch)
        elif self._whole:
            self._budget += -self._budget % max(1, self.optimizer.batch)
        try:
            self._resume(recorded)
        except Exception as error:  # a state of another version may break a plugin in any way
            if not recorded:
                raise
            self._journal.clear()
            self.trials, self.evaluated, self.refused, self.batches = [], 0, 0, 0
            self._ahead = self._conditions()
            self.stopped, self.wall_s = "", 0.0
            cause = str(error) if isinstance(error, _MismatchError) else f"{type(error).__name__}: {error}"
            self.note = f"search {self.index} begins anew: its journal cannot be followed ({cause})."
            self.optimizer = self._make()
            self.optimizer.start(self._space, self._seed)

    def ask(self) -> Generation | None:
        """The next generation with something to evaluate; None when the search has stopped."""
        while not self.stopped:
            size = max(1, self.optimizer.batch)
            asked = min(size, self._budget - self.evaluated)
            proposed = self._proposed(asked)
            if not proposed:
                self.stopped = EXHAUSTED
                self._journal.sync()
                break
            trials = []
            for trial in proposed:
                broken = self._problem.violated(trial.values, trial.context)
                trials.append(trial.refused(broken) if broken else trial)
            generation = Generation(asked, size, tuple(trials))
            if generation.open:
                return generation
            self.tell(generation, (), self.wall_s)
        return None

    def tell(self, generation: Generation, evaluated: Sequence[Trial], wall_s: float) -> None:
        """Record a generation with the trials that were open in it, then tell the optimizer."""
        done = [trial for trial in generation.trials if trial not in generation.open]
        trials = tuple(sorted((*done, *evaluated), key=lambda trial: trial.number))
        record = replace(generation, trials=trials, wall_s=wall_s)
        self._journal.append(record)
        self._learn(record)
        self._count(record)
        if self.stopped:
            self._journal.sync()
        due = time.monotonic() - self._saved >= SNAPSHOT_EVERY_S
        # A last batch cut short by the budget would stand in the way of a larger budget.
        if (self.stopped or due) and record.asked == record.size:
            self._journal.save(Snapshot(self.batches, self.optimizer.state()))
            self._saved = time.monotonic()

    def recommended(self) -> list[Trial]:
        """What the optimizer recommends beyond what was tried, without what breaks constraints."""
        found = [replace(self._full(trial), number=-1) for trial in self.optimizer.recommend()]
        return [trial for trial in found if not self._problem.violated(trial.values, trial.context)]

    def _conditions(self) -> set[int]:
        """Where `until` is to hold: with contexts in each of them, since each has a design of its own."""
        return set(range(len(self._space.contexts))) or {-1}

    def _full(self, trial: Trial) -> Trial:
        """With all values, those of the branch too, and its condition."""
        if set(trial.values) != {variable.name for variable in self._space.variables}:
            raise ContractError(
                f"the optimizer proposes values for {', '.join(sorted(trial.values)) or 'nothing'}; the search is "
                f"over {', '.join(variable.name for variable in self._space.variables)}."
            )
        context = max(trial.context, 0) if self._space.contexts else -1
        return replace(trial, values={**self.values, **trial.values}, context=context)

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
        """Take a generation into the account and see whether the search stops."""
        self.trials += generation.trials
        self.batches += 1
        self.evaluated += generation.evaluated
        self.refused += len(generation.trials) - generation.evaluated
        self.wall_s = generation.wall_s
        for trial in generation.trials:
            if trial.feasible and self._problem.reached(trial.values, trial.metrics):
                self._ahead.discard(trial.context)
        if not self._ahead:
            self.stopped = UNTIL
        elif self.evaluated >= self._budget:
            self.stopped = BUDGET
        elif self.gave_up:
            self.stopped = EXHAUSTED

    def _resume(self, recorded: Sequence[Generation]) -> None:
        """Go through the journal as far as it fits the budget, telling what was told."""
        followed: list[Generation] = []
        for generation in recorded:
            if self.stopped or generation.asked != min(generation.size, self._budget - self.evaluated):
                break
            self._count(generation)
            followed.append(generation)
        if len(followed) < len(recorded):
            self._journal.keep(len(followed))
        begin, snapshot = 0, self._journal.snapshot()
        if snapshot is not None and snapshot.batches > len(followed):
            self._journal.forget_snapshot()  # it would fit again once other batches stand in their place
        elif snapshot is not None:
            self.optimizer = self._make()
            self.optimizer.restore(snapshot.state)
            begin = snapshot.batches
        for generation in followed[begin:]:
            proposed = [_proposal(trial) for trial in self._proposed(generation.asked)]
            if proposed != [_proposal(trial) for trial in generation.trials]:
                raise _MismatchError("the optimizer proposes other candidates now")
            self._learn(generation)


def _proposal(trial: Trial) -> tuple[int, int, dict[str, Value]]:
    return trial.number, trial.context, dict(trial.values)


def seed_of(seed: int, branch: int) -> int:
    """The optimizer's seed in a branch, below 2³¹."""
    return int(np.random.SeedSequence((seed, branch)).generate_state(1)[0]) % 2**31
