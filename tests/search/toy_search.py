"""A search of a formula: problem, evaluator and optimizer small enough that every answer is known."""

from __future__ import annotations

import json
import math
import os
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import create_model

from pliant.execution.executors import executor_for
from pliant.execution.progress import Silent
from pliant.pipeline.remote import RemoteStudy
from pliant_search.config import SearchConfig
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
from pliant_search.run.journal import Journal
from pliant_search.run.loop import Branch, Loop
from pliant_search.workers import Setup, trial_queue

PLANE = (Variable("a", "real", -1.0, 2.0), Variable("b", "real", -2.0, 1.0), Variable("n", "integer", 0, 4))


class ToyEvaluator:
    """A bowl about (0.3, −0.4, 2); settings make it slow, fatal or wrong in places."""

    def __init__(
        self, delay_s: float = 0.0, log: str = "", deadly: float = 9.0, killed: str = "", **wrong: float
    ) -> None:
        self.delay_s, self.log, self.deadly, self.killed, self.wrong = delay_s, log, deadly, killed, wrong

    def evaluate(self, values: Mapping[str, Value], context: int = -1) -> Trial:
        if self.log:
            with Path(self.log).open("a") as file:
                file.write(f"{values['a']!r}\n")
        trial = Trial(-1, values, context, simulations=1, wall_s=0.001)
        a, b, n = (float(values[name]) for name in ("a", "b", "n"))
        time.sleep(self.delay_s * (1.5 + np.sin(1e3 * a)))
        if a > self.deadly:
            with Path(self.killed).open("a") as file:
                file.write(f"{a!r}\n")
            os._exit(9)
        if a < self.wrong.get("nan_below", -9.0):
            return replace(trial, state="not_a_number", objectives=(np.nan,), cause="rmse is not a number")
        if b < self.wrong.get("raises_below", -9.0):
            raise ZeroDivisionError("b")
        if b > self.wrong.get("refused_above", 9.0):
            return replace(trial, state="refused", cause="too high", violation=b, simulations=0)
        bowl = (
            (a - 0.3) ** 2
            + (b + 0.4) ** 2
            + 0.1 * (n - 2 - max(context, 0)) ** 2
            + 0.01 * float(values.get("s", 0))
        )
        metrics = {"rmse_m": bowl, "a_m": a}
        return replace(trial, state="ok", objectives=(bowl,), metrics=metrics, conditions={"": metrics})


class ToyProblem:
    """a + b may not exceed `most`; `until` is rmse below `good`."""

    def __init__(self, most: float = 9.0, good: float = -1.0) -> None:
        self.most, self.good = most, good

    def violated(self, values: Mapping[str, Value], condition: int = -1) -> dict[str, float]:
        over = float(values["a"]) + float(values["b"]) - self.most
        return {f"a + b <= {self.most:g}": over} if over > 0 else {}

    def violated_each(self, trials: Sequence[Trial]) -> list[dict[str, float]]:
        return [self.violated(trial.values) for trial in trials]

    def reached(self, values: Mapping[str, Value], metrics: Mapping[str, float]) -> bool:
        return metrics["rmse_m"] <= self.good


class Narrowing(Optimizer):
    """An optimizer that draws ever nearer to the best reported value; it depends on all reported values."""

    def __init__(self, config: OptimizerConfig | None = None, batch: int = 6, shift: float = 0.0) -> None:
        super().__init__(config or OptimizerConfig(kind="narrowing"))
        self._size, self.shift = batch, shift

    @property
    def batch(self) -> int:
        return self._size

    def start(self, space: Space, seed: int) -> None:
        self.space, self.seed, self.asked, self.told = space, seed, 0, 0.0
        self.best: tuple[float, dict[str, Value]] | None = None
        self.open: dict[int, dict[str, Value]] = {}

    def ask(self, count: int) -> Sequence[Trial]:
        made = [self._candidate(number) for number in range(self.asked, self.asked + count)]
        self.asked += count
        self.open = {candidate.number: dict(candidate.values) for candidate in made}
        return made

    def _candidate(self, number: int) -> Trial:
        drawn = np.random.default_rng([self.seed, number, int(1e6 * abs(self.told))])
        width = 1.0 if self.best is None else 0.97**number
        values = {v.name: self._value(v, drawn, width) for v in self.space.variables}
        return Trial(number, values, number % len(self.space.contexts) if self.space.contexts else 0)

    def _value(self, variable: Variable, drawn: np.random.Generator, width: float) -> Value:
        if variable.type == "integer":
            return int(drawn.integers(int(variable.low), int(variable.high) + 1))
        at = float(drawn.uniform(variable.low, variable.high)) + self.shift
        if self.best is not None:
            at = float(self.best[1][variable.name]) * (1 - width) + width * at
        return float(min(max(at, variable.low), variable.high))

    def tell(self, trials: Sequence[Trial]) -> None:
        for trial in sorted(trials, key=lambda one: one.number):
            if trial.violation > 0 or not np.isfinite(trial.objective):
                continue
            self.told = 0.5 * self.told + trial.objective
            if self.best is None or trial.objective < self.best[0]:
                self.best = (trial.objective, self.open[trial.number])

    def state(self) -> Mapping[str, Any]:
        return {
            "variables": [[v.name, v.type, v.low, v.high] for v in self.space.variables],
            "contexts": [c.name for c in self.space.contexts],
            "seed": self.seed, "asked": self.asked, "told": self.told, "best": self.best,
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        contexts = tuple(Context(name) for name in state["contexts"])
        self.start(Space(tuple(Variable(*v) for v in state["variables"]), contexts=contexts), state["seed"])
        self.asked, self.told = state["asked"], state["told"]
        self.best = None if state["best"] is None else (state["best"][0], dict(state["best"][1]))

    def export(self, folder: Path) -> Sequence[Path]:
        (folder / "best.txt").write_text(repr(self.best))
        return [folder / "best.txt"]


class Contextual(Narrowing):
    """An optimizer that tries candidates in turn in each condition, and recommends the best known one for all."""

    capabilities = OptimizerCapabilities(contexts=True)

    def recommend(self) -> Sequence[Trial]:
        values = dict(self.best[1]) if self.best else {}
        return [Trial(-1, values, k) for k, _ in enumerate(self.space.contexts)] if values else []


class Front(Narrowing):
    """An optimizer that scores by the first of several objectives; otherwise a random search."""

    capabilities = OptimizerCapabilities(several_objectives=True)


class Knowing(Narrowing):
    """An optimizer that knows and recommends the values that bring the tip of `search_study` to 10 mm."""

    def recommend(self) -> Sequence[Trial]:
        return [Trial(-1, {"task.pressure": 6.16245e3, "chain.module_length": 10.5e-3})]


def make_config(kind: str) -> type[OptimizerConfig]:
    """Return a config without settings."""
    return create_model(f"{kind.title()}Config", __base__=OptimizerConfig, kind=(Literal[kind], kind))


NarrowingConfig, ContextualConfig, FrontConfig, KnowingConfig = map(
    make_config, ("narrowing", "contextual", "front", "knowing")
)


class StopError(Exception):
    """Raised in place of any event that ends a process."""


class Watched(Silent):
    """A progress that keeps its messages, and ends the search after a given number of steps."""

    def __init__(
        self, after: float = math.inf, error: type[BaseException] = StopError, title: str = ""
    ) -> None:
        self.left, self.error, self.title = after, error, title
        self.notes: list[str] = []
        self.texts: list[str] = []
        self.done = self.total = 0
        self.counts = True

    def begin(self, title: str, total: int, done: int = 0) -> Watched:
        self.counts = self.title in title
        self.done, self.total = (done, total) if self.counts else (self.done, self.total)
        return self

    def advance(self, steps: int = 1) -> None:
        if self.counts:
            self.done += steps
            self.left -= steps
            if self.left < 0:
                raise self.error

    def note(self, text: str) -> None:
        self.notes.append(text)

    def describe(self, text: str) -> None:
        self.texts.append(text)

    def expect(self, total: int) -> None:
        self.total = total


def evaluator_from_setup(setup: Setup) -> ToyEvaluator:
    """Return an evaluator for workers: the setup's study is the evaluator's settings."""
    return ToyEvaluator(**json.loads(setup.study.study))


def make_setup(**settings: Any) -> Setup:
    """Return the setup that `evaluator_from_setup` reads."""
    return Setup(
        RemoteStudy(json.dumps(settings), (), ""), make="tests.search.toy_search:evaluator_from_setup"
    )


def searched(
    folder: Path,
    *,
    workers: int = 1,
    budget: int = 40,
    branches: Sequence[Mapping[str, Value]] = ({},),
    problem: ToyProblem | None = None,
    make: Any = Narrowing,
    seed: int = 3,
    generations: int | None = None,
    progress: Any = None,
    executor: Any = None,
    space: Space | None = None,
    **settings: Any,
) -> list[Branch]:
    """Run searches; return the branches as they ended."""
    folder.mkdir(exist_ok=True)
    rules, axes = problem or ToyProblem(), space or Space(PLANE)
    rules.config = SearchConfig.model_construct(seed=seed, budget=budget, generations=generations)
    rules.branches = lambda: branches
    made = [Branch(k, rules, make, axes, Journal(folder, f"branch-{k}")) for k in range(len(branches))]
    with (
        executor_for(executor or workers) as running,
        trial_queue(running, make_setup(**settings), ToyEvaluator(**settings)) as queue,
    ):
        Loop(made, queue, progress or Silent(), "searching", lambda branch: None).run()
    return made


def told(branches: Sequence[Branch]) -> list[list[Any]]:
    """Return everything except the time, branch by branch."""
    return [[astuple(replace(trial, wall_s=0.0)) for trial in branch.trials] for branch in branches]


if __name__ == "__main__":  # a process to kill: folder, workers, settings
    searched(Path(sys.argv[1]), workers=int(sys.argv[2]), **json.loads(sys.argv[3]))
