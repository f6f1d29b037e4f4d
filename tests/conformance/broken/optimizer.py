"""A correct small search, and searches that break one rule each."""

import json
import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from tests.conformance.broken import Variants

from pliant.registry.component import Component
from pliant_search.optimizer import (
    Context,
    Optimizer,
    OptimizerCapabilities,
    OptimizerConfig,
    Space,
    Trial,
    Value,
    Variable,
)

Scored = tuple[int, dict[str, Value], list[float]]


class SearchConfig(OptimizerConfig):
    """The config of a search without settings."""

    kind: Literal["small"] = "small"


class Search(Optimizer):
    """A search that draws uniformly or near one of the best of its context; candidate k is drawn from (seed, k)."""

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
        """Add to the front of its context, unless a member is as good in every objective."""
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
    Component("optimizer", "small", f"{__name__}:SearchConfig", f"{__name__}:Search", "small search")
)
broken = variants.row_adder(Search)


def _off_by_one(up: Any, self: Any, variable: Variable, *given: Any) -> Any:
    return up(variable, *given) + 1 if variable.type == "integer" else up(variable, *given)


def _numpys(up: Any, self: Any, variable: Variable, *given: Any) -> Any:
    return np.float64(up(variable, *given)) if variable.type == "real" else up(variable, *given)


def _numbered_by_batch(up: Any, self: Any, count: int) -> list[Trial]:
    asked = [replace(c, number=i) for i, c in enumerate(up(count))]
    self.open = {c.number: c for c in asked}
    return asked


def _in_step(up: Any, self: Any, count: int) -> Sequence[Trial]:
    if self.open:
        raise RuntimeError(f"{len(self.open)} outcomes are missing")
    return up(count)  # type: ignore[no-any-return]


def _seeding_everybody(up: Any, self: Any, space: Space, seed: int) -> None:
    up(space, seed)
    np.random.seed(seed + random.Random(seed).randrange(9))


def _the_last_one_counts(up: Any, self: Any, trials: Sequence[Trial]) -> None:
    for trial in trials:
        candidate = self.open.pop(trial.number)
        self.best[candidate.context] = [(trial.number, dict(candidate.values), [trial.objective])]


def _ranked_as_integers(up: Any, self: Any, trials: Sequence[Trial]) -> None:
    self.ranked = sorted(int(trial.objective) for trial in trials)


def _wanting_a_whole_guess(up: Any, self: Any, space: Space, seed: int) -> None:
    up(space, seed)
    self.first = [space.start[v.name] for v in space.variables]


def _logging_beside(up: Any, self: Any, folder: Path) -> Sequence[Path]:
    (folder.parent / "search.log").write_text("")
    return up(folder)  # type: ignore[no-any-return]


def _first_for_ever(up: Any, self: Any, number: int) -> Trial:
    self.best = [[]]
    return replace(up(0), number=number)


def _one_answer(up: Any, self: Any, candidate: Trial, scores: list[float]) -> None:
    up(replace(candidate, context=0), scores)
    self.best = [self.best[0]] * len(self.best)


broken("declares_its_capabilities", capabilities="everything")
broken("proposals_are_within_bounds", value=_off_by_one)
broken("proposals_are_within_bounds", value=_numpys)
broken("batch_is_a_number", batch=0)
broken("candidates_have_their_own_numbers", ask=_numbered_by_batch)
broken("answers_before_all_is_told", ask=_in_step)
broken(
    "seed_decides_everything",
    value=lambda up, self, variable, _, centre: up(variable, np.random.default_rng(), centre),
)
broken("seed_decides_everything", start=lambda up, self, space, seed: up(space, 0))
broken("leaves_global_random_state_alone", start=_seeding_everybody)
broken("result_order_does_not_matter", tell=_the_last_one_counts)
broken(
    "continues_after_an_interruption", state=lambda up, self: json.loads(json.dumps({**up(), "best": [[]]}))
)
broken("survives_failed_evaluations", tell=_ranked_as_integers)
broken("begins_at_a_guess", start=_wanting_a_whole_guess)
broken(
    "recommends_within_bounds",
    recommend=lambda up, self: [replace(c, values={**c.values, "modules": 99}) for c in up()],
)
broken("exports_into_its_folder", export=_logging_beside)
broken("improves_on_a_sphere", candidate=_first_for_ever)
broken(
    "avoids_what_is_refused",
    scores=lambda up, self, trial: [0.0 if math.isnan(score) else score for score in up(trial)],
)
broken("avoids_what_is_refused", scores=lambda up, self, trial: list(trial.objectives))
broken("finds_a_front", scores=lambda up, self, trial: [trial.objective])
for context in (lambda number: 0, lambda number: 1 + number % 2):
    broken(
        "learns_an_answer_for_each_context",
        candidate=lambda up, self, number, of=context: replace(up(number), context=of(number)),
    )
broken("learns_an_answer_for_each_context", keep=_one_answer)
