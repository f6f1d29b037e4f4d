"""Checks of an `Optimizer`: bounds, reproducibility, interruptions, failed evaluations, progress."""

from __future__ import annotations

import json
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from pliant.interfaces.optimizer import Optimizer, OptimizerCapabilities, Value
from pliant.testing.optimizer_bench import (
    BATCH,
    MIXED,
    generation,
    proposals,
    require_within,
    sphere,
    squares,
    started,
)
from pliant.testing.optimizer_learning import suite as learning
from pliant.testing.suite import Subject, Suite, require

suite = Suite("optimizer")


@suite.check("`capabilities` says what the optimizer can do, before it is built.")
def declares_its_capabilities(subject: Subject) -> None:
    given = subject.component.implementation_class().capabilities
    require(isinstance(given, OptimizerCapabilities), f"capabilities is {given!r}")


@suite.check("every value is within its variable's bounds and of its type; every variable has one.")
def proposals_are_within_bounds(subject: Subject) -> None:
    optimizer = started(subject)
    for _ in range(5):
        for candidate in generation(optimizer):
            require_within(MIXED, candidate.values)


@suite.check("values are plain int, float or str, so that they can be written to a study.")
def proposals_are_plain_values(subject: Subject) -> None:
    for candidate in started(subject).ask(BATCH):
        for name, value in candidate.values.items():
            require(
                type(value) in (int, float, str),
                f"'{name}' is a {type(value).__name__}, which JSON cannot hold",
            )


@suite.check("`batch` is how many candidates to ask for at a time: a whole number, 1 or more.")
def batch_is_a_number(subject: Subject) -> None:
    batch = started(subject).batch
    require(isinstance(batch, int) and batch >= 1, f"batch is {batch!r}")


@suite.check("`ask(count)` gives one to `count` new candidates, each with a number of its own.")
def candidates_have_their_own_numbers(subject: Subject) -> None:
    optimizer = started(subject)
    seen: list[int] = []
    for count in (1, 5, BATCH):
        asked = optimizer.ask(count)
        require(1 <= len(asked) <= count, f"ask({count}) gave {len(asked)} candidates")
        seen += [c.number for c in asked]
        optimizer.tell([sphere(c) for c in asked])
    require(len(set(seen)) == len(seen), f"a number was given twice: {sorted(seen)}")


@suite.check("it may be asked again before everything is told, and told later.")
def answers_before_all_is_told(subject: Subject) -> None:
    optimizer = started(subject)
    asked = [c for _ in range(6) for c in optimizer.ask(BATCH)]
    require(len({c.number for c in asked}) == len(asked), "a number was given twice")
    optimizer.tell([sphere(c) for c in asked[1::2]])
    optimizer.tell([sphere(c) for c in asked[::2]])
    for candidate in generation(optimizer):
        require_within(MIXED, candidate.values)


@suite.check("same seed, space and results give the same proposals.")
def seed_decides_everything(subject: Subject) -> None:
    require(
        proposals(started(subject)) == proposals(started(subject)),
        "two searches with one seed differ: a random generator without the seed",
    )


@suite.check("another seed gives another search.")
def seeds_differ(subject: Subject) -> None:
    require(
        proposals(started(subject, seed=3)) != proposals(started(subject, seed=4)),
        "two seeds give the same proposals: the seed is not used",
    )


@suite.check("the global random state of numpy is left alone.")
def leaves_global_random_state_alone(subject: Subject) -> None:
    before = repr(np.random.get_state())
    proposals(started(subject), rounds=1)
    require(
        repr(np.random.get_state()) == before,
        "numpy's global generator was used or seeded; use np.random.default_rng(seed)",
    )


@suite.check("results may be told in any order.")
def order_of_results_does_not_matter(subject: Subject) -> None:
    searches = [started(subject), started(subject)]
    for direction, optimizer in zip((1, -1), searches, strict=True):
        for _ in range(2):
            optimizer.tell([sphere(c) for c in optimizer.ask(BATCH)][::direction])
    first, second = ([dict(c.values) for c in o.ask(BATCH)] for o in searches)
    require(first == second, "proposals depend on the order in which a batch's results arrived")


@suite.check("`state` is JSON and `restore` continues the search exactly where it was taken.")
def continues_after_an_interruption(subject: Subject) -> None:
    optimizer = started(subject)
    generation(optimizer)
    waiting = optimizer.ask(3)
    text = json.dumps(optimizer.state(), allow_nan=False)
    resumed: Optimizer = subject.build()
    resumed.restore(json.loads(text))
    for search in (optimizer, resumed):
        search.tell([sphere(c) for c in waiting])
    require(
        proposals(resumed) == proposals(optimizer),
        "the restored search proposes something else: the state leaves something out",
    )


@suite.check("NaN objectives are survived: the search goes on within bounds.")
def survives_failed_evaluations(subject: Subject) -> None:
    optimizer = started(subject)
    generation(optimizer, lambda trial: trial.scored(float("nan")))
    generation(
        optimizer,
        lambda t: t.scored(float("nan") if t.number % 2 else squares(t)),
    )
    for candidate in optimizer.ask(BATCH):
        require_within(MIXED, candidate.values)


@suite.check("a guess is where a search may begin: it may hold some variables only, and is no fence.")
def begins_at_a_guess(subject: Subject) -> None:
    guesses: tuple[dict[str, Value], ...] = ({"length": 0.05, "modules": 5, "side": "both"}, {"modules": 10})
    for guess in guesses:
        optimizer = started(subject, replace(MIXED, start=guess))
        seen = [dict(c.values) for _ in range(3) for c in generation(optimizer)]
        for values in seen:
            require_within(MIXED, values)
        away = [values for values in seen if any(values[name] != v for name, v in guess.items())]
        require(away, f"all {len(seen)} candidates repeat the guess {guess}")


@suite.check("`recommend` gives candidates within bounds, one per context at most; or none.")
def recommends_within_bounds(subject: Subject) -> None:
    optimizer = started(subject)
    generation(optimizer)
    recommended = optimizer.recommend()
    require(len(recommended) <= 1, f"{len(recommended)} recommendations for a search without contexts")
    for candidate in recommended:
        require_within(MIXED, candidate.values)


@suite.check("`export` writes into the folder that it is given and nowhere else, and names the files.")
def exports_into_its_folder(subject: Subject) -> None:
    optimizer = started(subject)
    generation(optimizer)
    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent).resolve() / "export"
        folder.mkdir()
        for path in optimizer.export(folder):
            require(Path(path).is_file(), f"'{path}' was not written")
            require(folder in Path(path).resolve().parents, f"'{path}' is not in the folder {folder}")
        others = sorted(p.name for p in folder.parent.iterdir() if p != folder)
        require(not others, f"{', '.join(others)} was written beside the folder")


suite.checks.extend(learning.checks)
