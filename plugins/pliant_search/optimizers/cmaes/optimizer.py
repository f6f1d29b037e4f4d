"""CMA-ES with the ask-and-tell interface, a generation at a time."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import cma
import numpy as np

from pliant.records.design import Array
from pliant_search.optimizer import Optimizer, Space, Trial, Value, Variable
from pliant_search.optimizers.cmaes.fitness import FAILED, ScoredTrial, fitness
from pliant_search.optimizers.config import CmaesConfig

NOT_ASKED = -1
LEAST_CHOICE_STD = 0.1
CHOSEN, NOT_CHOSEN = 0.75, 0.25  # where a guess puts the coordinates of a choice


@dataclass(frozen=True)
class EncodedVariable:
    """A variable and the coordinates that encode it; `size` 0 for a single choice."""

    variable: Variable
    first: int
    size: int

    @property
    def steps(self) -> float:
        """The coordinate's highest value; its lowest is 0."""
        return self.variable.high - self.variable.low if self.variable.type == "integer" else 1.0

    def value(self, x: Array) -> Value:
        """Return the variable's value at coordinates x, within its bounds."""
        v, part = self.variable, x[self.first : self.first + self.size]
        if v.type == "categorical":
            if self.size > 1:
                return v.choices[int(np.argmax(part))]
            return v.choices[round(min(max(part[0], 0.0), 1.0)) if self.size else 0]
        coordinate = float(part[0]) if self.size else 0.0
        if v.type == "integer":
            return int(min(max(v.low + round(coordinate), v.low), v.high))
        return float(min(max(v.low + coordinate * (v.high - v.low), v.low), v.high))


@dataclass(frozen=True, eq=False)
class Encoding:
    """Variables as coordinates of a normal distribution.

    A real variable is one coordinate 0…1. A whole number is one coordinate in its own steps, which pycma rounds and
    keeps from freezing (its `integer_variables`). A choice of two is a whole number 0 or 1, which imposes no order. A
    choice of more is one coordinate 0…1 per choice and the largest wins: an index would put choices in an order that
    they do not have. Their standard deviation has a lower limit, so that a choice can still change late. There are at
    least two coordinates since pycma does not search a single one: one without meaning is added.

    Attributes:
        axes: the variables.
        high: (n,) upper bound of each coordinate; the lower bound is 0.
        whole: coordinates that are rounded.
        least_std: (n,) lower limit of the standard deviation; 0 for none.
    """

    axes: tuple[EncodedVariable, ...]
    high: Array
    whole: tuple[int, ...]
    least_std: Array

    @classmethod
    def from_variables(cls, variables: Sequence[Variable]) -> Encoding:
        """Return the encoding of a space's variables."""
        axes: list[EncodedVariable] = []
        n = 0
        for v in variables:
            count = len(v.choices)
            size = (count - (count < 3)) if v.type == "categorical" else int(v.high > v.low)
            axes.append(EncodedVariable(v, n, size))
            n += size
        high, least = np.ones(max(n, 2)), np.zeros(max(n, 2))
        for axis in axes:
            high[axis.first : axis.first + axis.size] = axis.steps
            if axis.size > 1:
                least[axis.first : axis.first + axis.size] = LEAST_CHOICE_STD
        whole = tuple(axis.first for axis in axes if axis.size == 1 and axis.variable.type != "real")
        return cls(tuple(axes), high, whole, least)

    def encoded(self, guess: Mapping[str, Value]) -> Array:
        """Return (n,) coordinates of a guess; variables that it omits are in the middle."""
        x: Array = 0.5 * self.high
        for axis in self.axes:
            v = axis.variable
            if v.name not in guess or axis.size == 0:
                continue
            value = guess[v.name]
            if v.type != "categorical":
                share = (float(value) - v.low) / (v.high - v.low)
                x[axis.first] = min(max(share, 0.0), 1.0) * axis.steps
            elif value in v.choices:
                index = v.choices.index(value)
                if axis.size == 1:
                    x[axis.first] = index
                else:
                    x[axis.first : axis.first + axis.size] = NOT_CHOSEN
                    x[axis.first + index] = CHOSEN
        return x

    def rounded(self, x: Array) -> Array:
        """Return the coordinates (n,) of the values that x encodes."""
        rounded = x.copy()
        rounded[list(self.whole)] = np.round(x[list(self.whole)])
        return rounded

    def decoded(self, x: Array) -> dict[str, Value]:
        """Return variable → value, within its bounds."""
        return {axis.variable.name: axis.value(x) for axis in self.axes}


class CmaRun:
    """One run of pycma from its first mean to its own stop criterion, with bounds, integers and separate random
    numbers.

    Bounds are kept by pycma's `BoundTransform`: every sample maps to a point inside, which is evaluated unchanged. Its
    `BoundPenalty` would add penalties that it weighs by the objective's spread, which failed and refused candidates
    distort. pycma's integer handling calls `np.random.rand` whatever its option `randn`, so numpy's global state is
    replaced by this run's during a call. Not thread-safe.
    """

    def __init__(
        self, encoding: Encoding, mean: Array | None, sigma: float, population: int, seed: Sequence[int]
    ) -> None:
        """Start a run; `mean` None: uniformly drawn."""
        self._state = np.random.RandomState(np.random.SeedSequence(seed).generate_state(8)).get_state()
        options = {
            "bounds": [[0.0] * len(encoding.high), list(encoding.high)],
            "BoundaryHandler": "BoundTransform",
            "CMA_stds": list(encoding.high),
            "integer_variables": list(encoding.whole),
            "minstd": encoding.least_std if encoding.least_std.any() else 0,
            "popsize": population,
            "maxiter": math.inf,  # the search's budget ends it
            "maxfevals": math.inf,
            "seed": math.nan,  # leave numpy's generator alone
            "verbose": -9,
            "verb_disp": 0,
            "verb_log": 0,
            "signals_filename": "",
        }
        with self._own_random():
            first = np.random.uniform(0.0, encoding.high) if mean is None else mean
            self._pycma = cma.CMAEvolutionStrategy(first, sigma, options)

    @contextmanager
    def _own_random(self) -> Iterator[None]:
        others = np.random.get_state()
        np.random.set_state(self._state)
        try:
            yield
        finally:
            self._state = np.random.get_state()
            np.random.set_state(others)

    def sample(self, count: int) -> list[Array]:
        """Draw `count` arrays (n,) within bounds."""
        with self._own_random():
            drawn: list[Array] = self._pycma.ask(count)
        return drawn

    def learn(self, samples: Sequence[Array], values: Sequence[float]) -> bool:
        """Update from a generation, low values being good; whether the run has come to its end.

        Samples that were drawn before the last update count as injected ones (Hansen 2011, Injecting external
        solutions into CMA-ES), whose step pycma limits.
        """
        with self._own_random(), warnings.catch_warnings():
            warnings.filterwarnings("ignore", category=UserWarning, module="cma")  # about the injected ones
            self._pycma.tell(list(samples), list(values))
            return bool(self._pycma.stop())


@dataclass
class Member:
    """A sample and the number of its candidate."""

    sample: Array
    number: int = NOT_ASKED


class Cmaes(Optimizer):
    """CMA-ES: a generation is sampled at once, handed out on request and learned when all its results are known.

    If more are requested while results of a generation are missing, it draws surplus candidates from the same
    distribution; they take part in the next generations. `recommend` stays empty: the scenarios of a search are the
    same for all candidates, so the score of the best one is known, while the distribution's mean may break a
    constraint.
    """

    config: CmaesConfig
    _worst: float | None
    _results: dict[int, ScoredTrial]

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
        """Return the rest of the generation, at most `count`; surplus candidates if none remain."""
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
        self._results.update({t.number: ScoredTrial.from_trial(t) for t in trials if t.number in known})
        while self._complete():
            self._learn()

    def state(self) -> Mapping[str, Any]:
        """Return the results of the present run; `restore` replays them in pycma, a millisecond per generation."""
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
        self._results = {
            int(n): ScoredTrial(objective, violation) for n, objective, violation in state["results"]
        }

    def _set_space(self, space: Space, seed: int) -> None:
        self._space, self._seed = space, seed
        self._encoding = Encoding.from_variables(space.variables)
        rule = 4 + math.floor(3 * math.log(len(self._encoding.high)))
        self._first_population = self.config.population or rule
        self._asked = 0
        self._worst = None

    def _begin_run(self, index: int) -> None:
        self._runs = index
        guess = self._encoding.encoded(self._space.start) if index == 0 else None
        sigma = min(self.config.sigma, self._space.spread or 1.0) if index == 0 else self.config.sigma
        self._run = CmaRun(self._encoding, guess, sigma, self.batch, (self._seed, index))
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
        """Return whether all results are known, or those of a generation's number of surplus candidates (the rest is
        lost).
        """
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
