"""Checks of an `Optimizer`: bounds, reproducibility, interruptions, failed evaluations, progress."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence

import numpy as np

from pliant.interfaces.optimizer import Candidate, Optimizer, Outcome, Value, Variable
from pliant.testing.suite import Finding, Subject, Suite, require

suite = Suite("optimizer")
MIXED = (
    Variable("length", "real", -0.02, 0.05),
    Variable("modules", "integer", 5, 10),
    Variable("side", "categorical", choices=("left", "right", "both")),
)
PLANE = (Variable("a", "real", -1.0, 2.0), Variable("b", "real", -2.0, 1.0))
BATCH = 8


def _started(subject: Subject, variables: Sequence[Variable] = MIXED, seed: int = 3) -> Optimizer:
    optimizer: Optimizer = subject.build()
    optimizer.start(variables, seed)
    return optimizer


def _sphere(candidate: Candidate) -> float:
    return sum(float(v) ** 2 for v in candidate.values.values() if not isinstance(v, str))


def _generation(optimizer: Optimizer, score: Callable[[Candidate], float] = _sphere) -> Sequence[Candidate]:
    asked = optimizer.ask(BATCH)
    optimizer.tell([Outcome(c.number, score(c)) for c in asked])
    return asked


def _proposals(optimizer: Optimizer, rounds: int = 3) -> list[tuple[int, dict[str, Value]]]:
    return [(c.number, dict(c.values)) for _ in range(rounds) for c in _generation(optimizer)]


@suite.check("every value is within its variable's bounds and of its type; every variable has one.")
def proposals_are_within_bounds(subject: Subject) -> None:
    optimizer = _started(subject)
    for _ in range(5):
        for candidate in _generation(optimizer):
            require(
                set(candidate.values) == {v.name for v in MIXED},
                f"a candidate has values for {sorted(candidate.values)}, the search for "
                f"{[v.name for v in MIXED]}",
            )
            for variable in MIXED:
                _require_value(variable, candidate.values[variable.name])


def _require_value(variable: Variable, value: Value) -> None:
    name = f"variable '{variable.name}'"
    if variable.type == "categorical":
        require(value in variable.choices, f"{name} is {value!r}, not one of {variable.choices}")
        return
    if isinstance(value, str) or not np.isfinite(value):
        raise Finding(f"{name} is {value!r}, not a finite number")
    require(
        variable.low <= value <= variable.high,
        f"{name} is {value!r}, not in [{variable.low}, {variable.high}]",
    )
    if variable.type == "integer":
        require(isinstance(value, int) and not isinstance(value, bool), f"{name} is {value!r}, not an int")


@suite.check("values are plain int, float or str, so that they can be written to a study.")
def proposals_are_plain_values(subject: Subject) -> None:
    for candidate in _started(subject).ask(BATCH):
        for name, value in candidate.values.items():
            require(
                type(value) in (int, float, str),
                f"'{name}' is a {type(value).__name__}, which JSON cannot hold",
            )


@suite.check("`ask(count)` gives one to `count` new candidates, each with a number of its own.")
def candidates_have_their_own_numbers(subject: Subject) -> None:
    optimizer = _started(subject)
    seen: list[int] = []
    for count in (1, 5, BATCH):
        asked = optimizer.ask(count)
        require(1 <= len(asked) <= count, f"ask({count}) gave {len(asked)} candidates")
        seen += [c.number for c in asked]
        optimizer.tell([Outcome(c.number, _sphere(c)) for c in asked])
    require(len(set(seen)) == len(seen), f"a number was given twice: {sorted(seen)}")


@suite.check("same seed, variables and outcomes give the same proposals.")
def seed_decides_everything(subject: Subject) -> None:
    require(
        _proposals(_started(subject)) == _proposals(_started(subject)),
        "two searches with one seed differ: a random generator without the seed",
    )


@suite.check("another seed gives another search.")
def seeds_differ(subject: Subject) -> None:
    require(
        _proposals(_started(subject, seed=3)) != _proposals(_started(subject, seed=4)),
        "two seeds give the same proposals: the seed is not used",
    )


@suite.check("the global random state of numpy is left alone.")
def leaves_global_random_state_alone(subject: Subject) -> None:
    before = repr(np.random.get_state())
    _proposals(_started(subject), rounds=1)
    require(
        repr(np.random.get_state()) == before,
        "numpy's global generator was used or seeded; use np.random.default_rng(seed)",
    )


@suite.check("outcomes may be told in any order.")
def order_of_outcomes_does_not_matter(subject: Subject) -> None:
    searches = [_started(subject), _started(subject)]
    for direction, optimizer in zip((1, -1), searches, strict=True):
        for _ in range(2):
            outcomes = [Outcome(c.number, _sphere(c)) for c in optimizer.ask(BATCH)]
            optimizer.tell(outcomes[::direction])
    first, second = ([dict(c.values) for c in o.ask(BATCH)] for o in searches)
    require(first == second, "proposals depend on the order in which a batch's outcomes arrived")


@suite.check("`state` is JSON and `restore` continues the search exactly where it was taken.")
def continues_after_an_interruption(subject: Subject) -> None:
    optimizer = _started(subject)
    _generation(optimizer)
    text = json.dumps(optimizer.state(), allow_nan=False)
    on = _proposals(optimizer)
    resumed: Optimizer = subject.build()
    resumed.restore(json.loads(text))
    require(
        _proposals(resumed) == on,
        "the restored search proposes something else: the state leaves something out",
    )


@suite.check("NaN objectives are survived: the search goes on within bounds.")
def survives_failed_evaluations(subject: Subject) -> None:
    optimizer = _started(subject)
    _generation(optimizer, lambda candidate: float("nan"))
    _generation(optimizer, lambda candidate: float("nan") if candidate.number % 2 else _sphere(candidate))
    for candidate in optimizer.ask(BATCH):
        for variable in MIXED:
            _require_value(variable, candidate.values[variable.name])


@suite.check("objectives are minimised: a search gets better than its first generation.")
def improves_on_a_sphere(subject: Subject) -> None:
    optimizer = _started(subject, PLANE)
    scores = [[_sphere(c) for c in _generation(optimizer)] for _ in range(15)]
    later = min(s for generation in scores[1:] for s in generation)
    median = float(np.median(scores[0]))
    require(
        later < 0.1 * median,
        f"the best of 14 generations on a sphere is {later:.3g}, the first generation's median {median:.3g}: "
        "maximised, or not searching",
    )
