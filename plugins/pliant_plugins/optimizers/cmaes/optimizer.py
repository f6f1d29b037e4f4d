"""CMA-ES as ask and tell, a generation at a time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pliant.interfaces.optimizer import Optimizer, Space, Trial
from pliant.records.design import Array
from pliant_plugins.optimizers.cmaes.config import CmaesConfig
from pliant_plugins.optimizers.cmaes.encoding import Encoding
from pliant_plugins.optimizers.cmaes.fitness import FAILED, Result, fitness
from pliant_plugins.optimizers.cmaes.run import Run

NOT_ASKED = -1


@dataclass
class Member:
    """A sample and the number of its candidate."""

    sample: Array
    number: int = NOT_ASKED


class Cmaes(Optimizer):
    """A generation is sampled at once, handed out as it is asked for and learned when all of it is told.

    Asked for more while results of a generation are missing, it draws surplus candidates from the same distribution;
    they take part in the next generations. `recommend` stays empty: the scenarios of a search are the same for all
    candidates, so the best that was tried is known to be good, while the distribution's mean may break a constraint.
    """

    config: CmaesConfig
    _worst: float | None
    _results: dict[int, Result]

    @property
    def batch(self) -> int:
        """The population; it doubles at the restarts that the config names."""
        doublings = min(self._runs, self.config.restarts)
        return self._first_population * 2**doublings

    def __init__(self, config: CmaesConfig) -> None:
        super().__init__(config)
        self._runs, self._first_population = 0, config.population or 8

    def start(self, space: Space, seed: int) -> None:
        """Begin at the guess, which is tried itself, or in the middle of the ranges."""
        self._set_space(space, seed)
        self._begin_run(0)

    def ask(self, count: int) -> Sequence[Trial]:
        """What is left of the generation, `count` at most; surplus candidates when nothing is left."""
        free = [m for m in self._members if m.number == NOT_ASKED][:count]
        if not free:
            free = self._drawn(count)
            self._surplus += free
        for member in free:
            member.number = self._asked
            self._asked += 1
        return [Trial(m.number, self._encoding.decoded(m.sample)) for m in free]

    def tell(self, trials: Sequence[Trial]) -> None:
        """Keep results; learn once a generation is complete. Results of an earlier run are ignored."""
        known = {m.number for m in (*self._members, *self._surplus)}
        self._results.update({t.number: Result.of(t) for t in trials if t.number in known})
        while self._complete():
            self._learn()

    def state(self) -> Mapping[str, Any]:
        """What the present run was told: pycma gets it once more on `restore`, which costs a millisecond or so for
        each generation.
        """
        return {
            "space": self._space.as_json(),
            "seed": self._seed,
            "run": self._runs,
            "asked": self._asked,
            "worst": self._worst,
            "history": [[surplus, list(values)] for surplus, values in self._history],
            "drawn": self._surplus_drawn,
            "members": [m.number for m in self._members],
            "surplus": [m.number for m in self._surplus],
            "results": [[n, r.objective, r.violation] for n, r in sorted(self._results.items())],
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Repeat the present run."""
        self._set_space(Space.from_json(state["space"]), int(state["seed"]))
        self._begin_run(int(state["run"]))
        for surplus, values in state["history"]:
            self._surplus += self._drawn(surplus)
            self._advance([float(v) for v in values])
        self._surplus += self._drawn(int(state["drawn"]))
        for members, numbers in ((self._members, state["members"]), (self._surplus, state["surplus"])):
            for member, number in zip(members, numbers, strict=True):
                member.number = int(number)
        self._asked, self._worst = int(state["asked"]), state["worst"]
        self._results = {int(n): Result(objective, violation) for n, objective, violation in state["results"]}

    def _set_space(self, space: Space, seed: int) -> None:
        self._space, self._seed = space, seed
        self._encoding = Encoding.of(space.variables)
        rule = 4 + math.floor(3 * math.log(len(self._encoding.high)))
        self._first_population = self.config.population or rule
        self._asked = 0
        self._worst = None

    def _begin_run(self, index: int) -> None:
        self._runs = index
        guess = self._encoding.encoded(self._space.start) if index == 0 else None
        sigma = min(self.config.sigma, self._space.spread or 1.0) if index == 0 else self.config.sigma
        self._run = Run(self._encoding, guess, sigma, self.batch, (self._seed, index))
        self._history: list[tuple[int, tuple[float, ...]]] = []
        self._surplus: list[Member] = []
        self._results = {}
        first = [Member(self._encoding.rounded(guess))] if guess is not None and self._space.start else []
        self._next_generation(first)

    def _next_generation(self, members: list[Member]) -> None:
        fresh = self._run.sample(self.batch - len(members))
        self._members = members + [Member(sample) for sample in fresh]
        self._surplus_drawn = 0

    def _drawn(self, count: int) -> list[Member]:
        self._surplus_drawn += count
        return [Member(sample) for _ in range(count) for sample in self._run.sample(1)]

    def _complete(self) -> bool:
        """Whether all is told; or as much surplus is told as a generation has, so that the rest will not come."""
        if any(m.number == NOT_ASKED for m in self._members):
            return False
        if all(m.number in self._results for m in self._members):
            return True
        return sum(m.number in self._results for m in self._surplus) >= self.batch

    def _learn(self) -> None:
        results = [self._results.pop(m.number, FAILED) for m in self._members]
        objectives = [r.objective for r in results if r.objective is not None]
        known = [self._worst] if self._worst is not None else []
        self._worst = max((*objectives, *known), default=None)
        self._advance(fitness(results, self._worst))

    def _advance(self, values: Sequence[float]) -> None:
        """Learn a generation's fitness, then the next generation, half of it surplus at most; or the next run."""
        self._history.append((self._surplus_drawn, tuple(values)))
        if self._run.learn([m.sample for m in self._members], values):
            self._begin_run(self._runs + 1)
            return
        half = self.batch // 2
        members, self._surplus = self._surplus[:half], self._surplus[half:]
        self._next_generation(members)
