"""A good random search, and searches that break one rule each."""

import json
import random
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any, Literal

import numpy as np

from pliant.interfaces.optimizer import Candidate, Optimizer, OptimizerConfig, Outcome, Value, Variable
from pliant.registry.component import Component
from spoiled import Spoils


class SearchConfig(OptimizerConfig):
    """No settings."""

    kind: Literal["small"] = "small"


class Search(Optimizer):
    """Uniform random proposals; candidate k is drawn from (seed, k)."""

    def start(self, variables: Sequence[Variable], seed: int) -> None:
        self.variables, self.seed, self.asked, self.sum = tuple(variables), seed, 0, 0.0

    def ask(self, count: int) -> Sequence[Candidate]:
        self.asked += count
        return [self.candidate(k) for k in range(self.asked - count, self.asked)]

    def candidate(self, number: int) -> Candidate:
        generator = np.random.default_rng([self.seed, number])
        return Candidate(number, {v.name: self.value(v, generator) for v in self.variables})

    def value(self, variable: Variable, generator: np.random.Generator) -> Value:
        if variable.type == "categorical":
            return variable.choices[int(generator.integers(len(variable.choices)))]
        if variable.type == "integer":
            return int(generator.integers(int(variable.low), int(variable.high) + 1))
        return float(generator.uniform(variable.low, variable.high))

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        """A random search learns nothing."""

    def state(self) -> Mapping[str, Any]:
        return {"variables": [asdict(v) for v in self.variables], "seed": self.seed, "asked": self.asked}

    def restore(self, state: Mapping[str, Any]) -> None:
        variables = [Variable(**{**v, "choices": tuple(v["choices"])}) for v in state["variables"]]
        self.start(variables, state["seed"])
        self.asked = state["asked"]


spoils = Spoils(
    Component(
        "optimizer", "small", "spoiled.optimizer:SearchConfig", "spoiled.optimizer:Search", "random search"
    )
)


@spoils.by("proposals_are_within_bounds", r"not in \[5, 10\]")
class OffByOne(Search):
    """Integers up to and beyond the highest."""

    def value(self, variable: Variable, generator: np.random.Generator) -> Value:
        value = super().value(variable, generator)
        return value + 1 if variable.type == "integer" else value  # type: ignore[operator]


@spoils.by("proposals_are_plain_values", "JSON cannot hold")
class NumpyValues(Search):
    """numpy's numbers."""

    def value(self, variable: Variable, generator: np.random.Generator) -> Value:
        value = super().value(variable, generator)
        return np.float64(value) if variable.type == "real" else value


@spoils.by("candidates_have_their_own_numbers", "given twice")
class NumbersByBatch(Search):
    """Numbers start anew in each batch."""

    def ask(self, count: int) -> Sequence[Candidate]:
        return [replace(c, number=i) for i, c in enumerate(super().ask(count))]


@spoils.by("seed_decides_everything", "two searches with one seed differ")
class Unseeded(Search):
    """Uses the clock."""

    def value(self, variable: Variable, generator: np.random.Generator) -> Value:
        return super().value(variable, np.random.default_rng())


@spoils.by("seeds_differ", "the seed is not used")
class OneSeed(Search):
    """Always seed 0."""

    def start(self, variables: Sequence[Variable], seed: int) -> None:
        super().start(variables, 0)


@spoils.by("leaves_global_random_state_alone", "global generator")
class GlobalSeed(Search):
    """Seeds numpy for everybody."""

    def start(self, variables: Sequence[Variable], seed: int) -> None:
        super().start(variables, seed)
        np.random.seed(seed + random.Random(seed).randrange(9))


class Learning(Search):
    """Shifts its draws by what it was told, last outcome first."""

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        for outcome in outcomes:
            self.sum = 0.5 * self.sum + outcome.objective

    def candidate(self, number: int) -> Candidate:
        drawn = np.random.default_rng([self.seed, number, int(1e6 * self.sum) if self.sum == self.sum else 0])
        return Candidate(number, {v.name: self.value(v, drawn) for v in self.variables})


spoils.add(
    "order_of_outcomes_does_not_matter", "depend on the order", implementation="spoiled.optimizer:Learning"
)


@spoils.by("continues_after_an_interruption", "the state leaves something out")
class Forgets(Search):
    """Its state leaves out how far it was."""

    def state(self) -> Mapping[str, Any]:
        return json.loads(json.dumps({**super().state(), "asked": 0}))


@spoils.by("survives_failed_evaluations", "ValueError")
class Fragile(Search):
    """Ranks outcomes as integers."""

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        self.ranked = sorted(int(outcome.objective) for outcome in outcomes)


@spoils.by("improves_on_a_sphere", "not searching")
class Stubborn(Search):
    """Proposes the first candidate for ever."""

    def candidate(self, number: int) -> Candidate:
        return replace(super().candidate(0), number=number)
