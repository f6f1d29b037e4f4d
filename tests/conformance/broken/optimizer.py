"""A good small search, and searches that break one rule each."""

import json
import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from broken import Variants
from pliant.interfaces.optimizer import (
    Context,
    Optimizer,
    OptimizerCapabilities,
    OptimizerConfig,
    Space,
    Trial,
    Value,
    Variable,
)
from pliant.registry.component import Component

Scored = tuple[int, dict[str, Value], list[float]]


class SearchConfig(OptimizerConfig):
    """No settings."""

    kind: Literal["small"] = "small"


class Search(Optimizer):
    """Draws uniformly or near one of the best so far, of the same context; candidate k is drawn from (seed, k)."""

    capabilities = OptimizerCapabilities(several_objectives=True, contexts=True)

    def start(self, space: Space, seed: int) -> None:
        self.space, self.seed, self.asked = space, seed, 0
        self.open: dict[int, Trial] = {}
        self.best: list[list[Scored]] = [[] for _ in space.contexts or (None,)]

    def ask(self, count: int) -> Sequence[Trial]:
        asked = [self.candidate(k) for k in range(self.asked, self.asked + count)]
        self.asked += count
        self.open.update({c.number: c for c in asked})
        return asked

    def candidate(self, number: int) -> Trial:
        generator = np.random.default_rng([self.seed, number])
        context = number % len(self.best)
        near = self.best[context]
        centre: Mapping[str, Value] = self.space.start
        if near and generator.random() < 0.8:
            centre = near[int(generator.integers(len(near)))][1]
        values = {v.name: self.value(v, generator, centre.get(v.name)) for v in self.space.variables}
        return Trial(number, values, context)

    def value(self, variable: Variable, generator: np.random.Generator, centre: Value | None) -> Value:
        if variable.type == "categorical":
            return variable.choices[int(generator.integers(len(variable.choices)))]
        low, high = variable.low, variable.high
        drawn = generator.uniform(low, high)
        if isinstance(centre, int | float):
            drawn = generator.normal(centre, (high - low) * 10 ** generator.uniform(-2.0, -0.5))
        drawn = min(max(float(drawn), low), high)
        return round(drawn) if variable.type == "integer" else drawn

    def tell(self, trials: Sequence[Trial]) -> None:
        for trial in sorted(trials, key=lambda o: o.number):
            candidate = self.open.pop(trial.number)
            scores = self.scores(trial)
            if all(map(math.isfinite, scores)):
                self.keep(candidate, scores)

    def scores(self, trial: Trial) -> list[float]:
        return [math.nan if trial.violation > 0 else trial.objective, *trial.objectives[1:]]

    def keep(self, candidate: Trial, scores: list[float]) -> None:
        """Into the front of its context, if nothing there is as good in every objective."""
        front = self.best[candidate.context]
        if not any(all(a <= b for a, b in zip(kept[2], scores, strict=True)) for kept in front):
            front[:] = [k for k in front if not all(a >= b for a, b in zip(k[2], scores, strict=True))]
            front.append((candidate.number, dict(candidate.values), scores))

    def recommend(self) -> Sequence[Trial]:
        return [Trial(-1, f[-1][1], context) for context, f in enumerate(self.best) if f]

    def export(self, folder: Path) -> Sequence[Path]:
        (folder / "best.json").write_text(json.dumps(self.best))
        return (folder / "best.json",)

    def state(self) -> Mapping[str, Any]:
        return {
            "variables": [[v.name, v.type, v.low, v.high, v.choices] for v in self.space.variables],
            "objectives": self.space.objectives,
            "contexts": [[c.name, c.features] for c in self.space.contexts],
            "start": dict(self.space.start),
            "seed": self.seed,
            "asked": self.asked,
            "open": [[c.number, dict(c.values), c.context] for c in self.open.values()],
            "best": self.best,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        variables = tuple(Variable(*v[:4], choices=tuple(v[4])) for v in state["variables"])
        contexts = tuple(Context(name, tuple(features)) for name, features in state["contexts"])
        self.start(Space(variables, state["objectives"], contexts, state["start"]), state["seed"])
        self.asked, self.best = state["asked"], state["best"]
        self.open = {number: Trial(number, *rest) for number, *rest in state["open"]}


variants = Variants(
    Component(
        "optimizer", "small", "broken.optimizer:SearchConfig", "broken.optimizer:Search", "small search"
    )
)


@variants.by("declares_its_capabilities", "capabilities is")
class Boastful(Search):
    """Capabilities in words."""

    capabilities = "everything"  # type: ignore[assignment]


@variants.by("proposals_are_within_bounds", r"not in \[5, 10\]")
class OffByOne(Search):
    """Integers up to and beyond the highest."""

    def value(self, variable: Variable, generator: np.random.Generator, centre: Value | None) -> Value:
        value = super().value(variable, generator, centre)
        return value + 1 if variable.type == "integer" else value  # type: ignore[operator]


@variants.by("proposals_are_plain_values", "JSON cannot hold")
class NumpyValues(Search):
    """numpy's numbers."""

    def value(self, variable: Variable, generator: np.random.Generator, centre: Value | None) -> Value:
        value = super().value(variable, generator, centre)
        return np.float64(value) if variable.type == "real" else value


@variants.by("batch_is_a_number", "batch is 0")
class NoBatch(Search):
    """Its batch is empty."""

    batch = 0  # type: ignore[assignment]


@variants.by("candidates_have_their_own_numbers", "given twice")
class NumbersByBatch(Search):
    """Numbers start anew in each batch."""

    def ask(self, count: int) -> Sequence[Trial]:
        asked = [replace(c, number=i) for i, c in enumerate(super().ask(count))]
        self.open = {c.number: c for c in asked}
        return asked


@variants.by("answers_before_all_is_told", "RuntimeError")
class InStep(Search):
    """Waits for every trial."""

    def ask(self, count: int) -> Sequence[Trial]:
        if self.open:
            raise RuntimeError(f"{len(self.open)} outcomes are missing")
        return super().ask(count)


@variants.by("seed_decides_everything", "two searches with one seed differ")
class Unseeded(Search):
    """Uses the clock."""

    def value(self, variable: Variable, generator: np.random.Generator, centre: Value | None) -> Value:
        return super().value(variable, np.random.default_rng(), centre)


@variants.by("seeds_differ", "the seed is not used")
class OneSeed(Search):
    """Always seed 0."""

    def start(self, space: Space, seed: int) -> None:
        super().start(space, 0)


@variants.by("leaves_global_random_state_alone", "global generator")
class GlobalSeed(Search):
    """Seeds numpy for everybody."""

    def start(self, space: Space, seed: int) -> None:
        super().start(space, seed)
        np.random.seed(seed + random.Random(seed).randrange(9))


@variants.by("order_of_results_does_not_matter", "depend on the order")
class LastOneCounts(Search):
    """Goes on from the trial that came last."""

    def tell(self, trials: Sequence[Trial]) -> None:
        for trial in trials:
            candidate = self.open.pop(trial.number)
            self.best[candidate.context] = [(trial.number, dict(candidate.values), [trial.objective])]


@variants.by("continues_after_an_interruption", "the state leaves something out")
class Forgets(Search):
    """Its state leaves out what was learned."""

    def state(self) -> Mapping[str, Any]:
        return json.loads(json.dumps({**super().state(), "best": [[]]}))


@variants.by("survives_failed_evaluations", "ValueError")
class Fragile(Search):
    """Ranks outcomes as integers."""

    def tell(self, trials: Sequence[Trial]) -> None:
        self.ranked = sorted(int(trial.objective) for trial in trials)


@variants.by("begins_at_a_guess", "KeyError")
class WholeGuess(Search):
    """Wants a guess for every variable."""

    def start(self, space: Space, seed: int) -> None:
        super().start(space, seed)
        self.first = [space.start[v.name] for v in space.variables]


@variants.by("recommends_within_bounds", r"not in \[5, 10\]")
class FarRecommendation(Search):
    """Recommends what it extrapolates."""

    def recommend(self) -> Sequence[Trial]:
        found = super().recommend()
        return [replace(c, values={**c.values, "modules": 99}) for c in found]


@variants.by("exports_into_its_folder", "beside the folder")
class ExportsBeside(Search):
    """Writes a log where it was not asked to."""

    def export(self, folder: Path) -> Sequence[Path]:
        (folder.parent / "search.log").write_text("")
        return super().export(folder)


@variants.by("improves_on_a_sphere", "not searching")
class Stubborn(Search):
    """Proposes the first candidate for ever."""

    def candidate(self, number: int) -> Trial:
        self.best = [[]]
        return replace(super().candidate(0), number=number)


@variants.by("avoids_what_is_refused", "taken for a good one")
class ZeroForNothing(Search):
    """Fills in zero where there is no objective."""

    def scores(self, trial: Trial) -> list[float]:
        return [0.0 if math.isnan(score) else score for score in super().scores(trial)]


@variants.by("avoids_what_is_refused", "whatever its objective")
class Unruly(Search):
    """Goes by the objective of candidates that break a constraint on metrics."""

    def scores(self, trial: Trial) -> list[float]:
        return list(trial.objectives)


@variants.by("finds_a_front", "the second too")
class OneSided(Search):
    """Claims several objectives and looks at the first."""

    def scores(self, trial: Trial) -> list[float]:
        return [trial.objective]


@variants.by("contexts_are_in_range", "were tried")
class OneContext(Search):
    """Never tries the second context."""

    def candidate(self, number: int) -> Trial:
        return replace(super().candidate(number), context=0)


@variants.by("learns_an_answer_for_each_context", "one answer for both")
class OneAnswer(Search):
    """Learns from all contexts as if they were one."""

    def keep(self, candidate: Trial, scores: list[float]) -> None:
        super().keep(replace(candidate, context=0), scores)
        self.best = [self.best[0]] * len(self.best)
