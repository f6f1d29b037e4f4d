"""pymoo's algorithms with the ask-and-tell interface, a generation at a time.

pymoo's state cannot be written as JSON; with the same seed and results it is reproducible, so the state consists of the
results, and `restore` replays them.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.soo.nonconvex.de import DE
from pymoo.core.evaluator import Evaluator
from pymoo.core.problem import Problem
from pymoo.core.termination import NoTermination
from pymoo.problems.static import StaticProblem
from scipy.stats import qmc

from pliant.records.design import Array
from pliant_pymoo import encoding
from pliant_pymoo.config import DeConfig, Nsga2Config
from pliant_search.optimizer import Optimizer, OptimizerCapabilities, Space, Trial

# Violation that a failed evaluation counts as: worse than every design that works, better than every refused one.
FAILED = 1e-12
Told = tuple[tuple[float, ...], float]  # objectives and violation; no objectives where the evaluation failed


class Evolution(Optimizer):
    """pymoo's algorithms: a generation is handed out on request and learned when all its results are known.

    If more are requested while a generation is pending, it returns random candidates, which keep workers busy and are
    not learned from.
    """

    _numbers: dict[int, int]  # candidate → member of the generation
    _told: dict[int, Told]  # member → what became of it

    def start(self, space: Space, seed: int) -> None:
        """Begin with a Latin hypercube, its first member at the guess."""
        self._space, self._seed = space, seed
        self._count, self._history = 0, list[list[Told]]()
        n = encoding.size(space.variables)
        sample = qmc.LatinHypercube(n, rng=np.random.default_rng([seed, 0])).random(self.members(n))
        if space.start:
            sample[0] = encoding.encoded(space.variables, space.start, np.full(n, 0.5))
        self._problem = Problem(n_var=n, n_obj=space.objectives, n_ieq_constr=1, xl=0.0, xu=1.0)
        self._algorithm = self.algorithm(sample)
        self._algorithm.setup(self._problem, termination=NoTermination(), seed=seed)
        self._next_generation()

    @property
    def batch(self) -> int:
        """The population, once the search has begun."""
        return len(self._population) if hasattr(self, "_population") else 8

    @abstractmethod
    def members(self, coordinates: int) -> int:
        """Return the size of the population."""

    @abstractmethod
    def algorithm(self, sample: Array) -> Any:
        """Return pymoo's algorithm with this first generation (members, coordinates)."""

    def ask(self, count: int) -> Sequence[Trial]:
        """Return the rest of the generation, at most `count`; random candidates if none remain."""
        free = [k for k in range(len(self._population)) if k not in self._numbers.values()][:count]
        if free:
            return [self._candidate(self._population[k].X, member=k) for k in free]
        n = self._problem.n_var
        numbers = range(self._count, self._count + count)
        return [self._candidate(np.random.default_rng([self._seed, 1, k]).random(n)) for k in numbers]

    def tell(self, trials: Sequence[Trial]) -> None:
        """Keep the generation's results; learn once it is complete."""
        for trial in trials:
            if trial.number in self._numbers:
                self._told[self._numbers[trial.number]] = _told(trial)
        if len(self._told) == len(self._population):
            self._learn([self._told[k] for k in range(len(self._population))])

    def state(self) -> Mapping[str, Any]:
        """Return the space, the seed and all results."""
        return {
            "space": self._space.as_json(),
            "seed": self._seed,
            "asked": self._count,
            "history": [[[list(o), v] for o, v in generation] for generation in self._history],
            "numbers": [[number, member] for number, member in self._numbers.items()],
            "told": [[member, list(o), v] for member, (o, v) in sorted(self._told.items())],
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Replay all results."""
        self.start(Space.from_json(state["space"]), int(state["seed"]))
        for generation in state["history"]:
            self._learn([(tuple(o), float(v)) for o, v in generation])
        self._count = int(state["asked"])
        self._numbers = {int(number): int(member) for number, member in state["numbers"]}
        self._told = {int(member): (tuple(o), float(v)) for member, o, v in state["told"]}

    def _candidate(self, x: Array, member: int | None = None) -> Trial:
        number = self._count
        self._count += 1
        if member is not None:
            self._numbers[number] = member
        return Trial(number, encoding.decoded(self._space.variables, np.asarray(x, float)))

    def _next_generation(self) -> None:
        self._population = self._algorithm.ask()
        self._numbers, self._told = {}, {}

    def _learn(self, told: list[Told]) -> None:
        self._history.append(told)
        none = (0.0,) * self._space.objectives
        scores = np.array([objectives or none for objectives, _ in told])
        violations = np.array([[violation] for _, violation in told])
        static = StaticProblem(self._problem, F=scores, G=violations)
        Evaluator().eval(static, self._population)
        self._algorithm.tell(infills=self._population)
        self._next_generation()


class De(Evolution):
    """Differential evolution, one objective."""

    config: DeConfig

    def members(self, coordinates: int) -> int:
        return self.config.population or min(max(5 * coordinates, 12), 60)

    def algorithm(self, sample: Array) -> Any:
        variant = f"DE/{self.config.base}/1/bin"
        return DE(
            pop_size=len(sample),
            sampling=sample,
            variant=variant,
            F=self.config.step,
            CR=self.config.crossover,
        )


class Nsga2(Evolution):
    """NSGA-II, one objective or several."""

    capabilities: ClassVar[OptimizerCapabilities] = OptimizerCapabilities(several_objectives=True)
    config: Nsga2Config

    def members(self, coordinates: int) -> int:
        return self.config.population

    def algorithm(self, sample: Array) -> Any:
        return NSGA2(pop_size=len(sample), sampling=sample)


def _told(trial: Trial) -> Told:
    violation = float(trial.violation)
    if not violation <= 0:
        return (), violation if math.isfinite(violation) else 1e300
    objectives = tuple(map(float, trial.objectives))
    return (objectives, 0.0) if all(math.isfinite(value) for value in objectives) else ((), FAILED)
