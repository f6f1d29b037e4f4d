"""Checks of an `Optimizer`: bounds, reproducibility, interruptions, failed evaluations, and improvement."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pliant.records.design import Array
from pliant.testing import CheckSkipped, Finding, Subject, require
from pliant_search.optimizer import (
    Context,
    Optimizer,
    OptimizerCapabilities,
    Space,
    Trial,
    Value,
    Variable,
)

MIXED = Space(
    (
        Variable("length", "real", -0.02, 0.05),
        Variable("modules", "integer", 5, 10),
        Variable("side", "categorical", choices=("left", "right", "both")),
    )
)
PLANE = Space((Variable("a", "real", -1.0, 2.0), Variable("b", "real", -2.0, 1.0)))
TWO_ENDS = Space(tuple(Variable(name, "real", -2.0, 2.0) for name in "abcd"), objectives=2)
TWO_PLACES = Space(
    (Variable("a", "real", -1.0, 1.0), Variable("b", "real", -1.0, 1.0)),
    contexts=(Context("left", (-1.0,)), Context("right", (1.0,))),
)
BATCH = 8
# Largest number of candidates of a search, which ends as soon as its latest candidates have improved.
ENOUGH_OF_ONE, ENOUGH_OF_TWO, ENOUGH_OF_CONTEXTS = 3000, 480, 8000
WINDOW = 40
BLIND_SHARE = 7 / 9  # share of the plane that `half_plane` refuses
# Reference point of the hypervolume, and the hypervolume of the whole front of `two_ends`.
CORNER, IDEAL = 8.0, 64 - 8 / 3
Score = Callable[[Trial], Trial]


def started(subject: Subject, space: Space = MIXED, seed: int = 3) -> Optimizer:
    """Return a new optimizer with a started search."""
    optimizer: Optimizer = subject.build()
    optimizer.start(space, seed)
    return optimizer


def squares(trial: Trial) -> float:
    """Return the sum of the squares of all numbers."""
    return sum(float(v) ** 2 for v in trial.values.values() if not isinstance(v, str))


def sphere(trial: Trial) -> Trial:
    """Score a trial by the sum of squares, with its minimum at 0."""
    return trial.scored(squares(trial))


def two_ends(trial: Trial) -> Trial:
    """Score by squared distances to two points: the front is between them, f₁ = 4 t², f₂ = 4 (1 − t)²."""
    x = np.array([float(v) for v in trial.values.values()])
    return trial.scored(float(np.sum((x - 0.5) ** 2)), float(np.sum((x + 0.5) ** 2)))


def two_places(trial: Trial) -> Trial:
    """Score by a paraboloid with its minimum at a = −0.5 in the first context and at a = +0.5 in the second."""
    minimum = 0.5 if trial.context else -0.5
    a, b = float(trial.values["a"]), float(trial.values["b"])
    return trial.scored((a - minimum) ** 2 + b**2)


def half_plane(trial: Trial) -> Trial:
    """Score by a paraboloid in the corner of the plane a + b ≤ −1; the other 78 % are refused.

    Half of these are refused after the evaluation, as for a constraint on a metric, with an objective below all allowed
    ones.
    """
    a, b = float(trial.values["a"]), float(trial.values["b"])
    if a + b > -1:
        return trial.scored(-1.0 if trial.number % 2 else math.nan, violation=a + b + 1)
    return trial.scored((a + 0.7) ** 2 + (b + 1.3) ** 2)


def generation(optimizer: Optimizer, score: Score = sphere, count: int = BATCH) -> Sequence[Trial]:
    """Ask, score and tell one batch; return the candidates."""
    asked = optimizer.ask(count)
    optimizer.tell([score(c) for c in asked])
    return asked


def proposals(optimizer: Optimizer, rounds: int = 3) -> list[tuple[int, int, dict[str, Value]]]:
    """Return the proposals of an optimizer on a sphere."""
    return [(c.number, c.context, dict(c.values)) for _ in range(rounds) for c in generation(optimizer)]


def require_within(space: Space, candidates: Sequence[Trial]) -> None:
    """Raise `Finding` unless each has a fitting value for every variable and no other."""
    names = [v.name for v in space.variables]
    for values in (candidate.values for candidate in candidates):
        require(
            set(values) == set(names), f"a candidate has values for {sorted(values)}, the search for {names}"
        )
        for variable in space.variables:
            _require_value(variable, values[variable.name])


def _require_value(variable: Variable, value: Value) -> None:
    is_it = f"variable '{variable.name}' is {value!r}, not"
    plain = type(value) in (int, float, str)
    require(plain, f"{is_it} a plain int, float or str: {type(value).__name__} is nothing that JSON holds")
    if variable.type == "categorical":
        require(value in variable.choices, f"{is_it} one of {variable.choices}")
        return
    if isinstance(value, str) or not np.isfinite(value):
        raise Finding(f"{is_it} a finite number")
    require(variable.low <= value <= variable.high, f"{is_it} in [{variable.low}, {variable.high}]")
    if variable.type == "integer":
        require(isinstance(value, int), f"{is_it} an int")


def hypervolume(points: Array, corner: float) -> float:
    """Return the area that points (n, 2) dominate within [0, corner]²."""
    area, height = 0.0, corner
    for first, second in sorted(points.tolist()):
        if first < corner and second < height:
            area += (corner - first) * (height - second)
            height = second
    return area


def declares_its_capabilities(subject: Subject) -> None:
    """`capabilities` states what the optimizer supports, before it is built."""
    given = subject.component.implementation_class().capabilities
    require(isinstance(given, OptimizerCapabilities), f"capabilities is {given!r}")


def proposals_are_within_bounds(subject: Subject) -> None:
    """every variable has a value within its bounds and a plain int, float or str, so that a study can hold it."""
    optimizer = started(subject)
    for _ in range(5):
        require_within(MIXED, generation(optimizer))


def batch_is_a_number(subject: Subject) -> None:
    """`batch` is how many candidates to ask for at a time: a whole number, 1 or more."""
    batch = started(subject).batch
    require(isinstance(batch, int) and batch >= 1, f"batch is {batch!r}")


def candidates_have_their_own_numbers(subject: Subject) -> None:
    """`ask(count)` gives one to `count` new candidates, each with a unique number."""
    optimizer = started(subject)
    seen: list[int] = []
    for count in (1, 5, BATCH):
        asked = generation(optimizer, count=count)
        require(1 <= len(asked) <= count, f"ask({count}) gave {len(asked)} candidates")
        seen += [c.number for c in asked]
    require(len(set(seen)) == len(seen), f"a number was given twice: {sorted(seen)}")


def answers_before_all_is_told(subject: Subject) -> None:
    """`ask` may be called again before `tell` of all candidates, which may follow later."""
    optimizer = started(subject)
    asked = [c for _ in range(6) for c in optimizer.ask(BATCH)]
    require(len({c.number for c in asked}) == len(asked), "a number was given twice")
    for part in (asked[1::2], asked[::2]):
        optimizer.tell([sphere(c) for c in part])
    require_within(MIXED, generation(optimizer))


def seed_decides_everything(subject: Subject) -> None:
    """same seed, space and results give the same proposals, another seed gives others."""
    first, again, other = (proposals(started(subject, seed=seed)) for seed in (3, 3, 4))
    require(first == again, "two searches with one seed differ: a random generator without the seed")
    require(first != other, "two seeds give the same proposals: the seed is not used")


def leaves_global_random_state_alone(subject: Subject) -> None:
    """the global random state of numpy is left alone."""
    before = repr(np.random.get_state())
    proposals(started(subject), rounds=1)
    finding = "numpy's global generator was used or seeded; use np.random.default_rng(seed)"
    require(repr(np.random.get_state()) == before, finding)


def result_order_does_not_matter(subject: Subject) -> None:
    """`tell` accepts results in any order."""
    searches = [started(subject), started(subject)]
    for direction, optimizer in zip((1, -1), searches, strict=True):
        for _ in range(2):
            optimizer.tell([sphere(c) for c in optimizer.ask(BATCH)][::direction])
    first, second = ([dict(c.values) for c in o.ask(BATCH)] for o in searches)
    require(first == second, "proposals depend on the order in which a batch's results arrived")


def continues_after_an_interruption(subject: Subject) -> None:
    """`state` is JSON and `restore` continues the search exactly from it."""
    optimizer = started(subject)
    generation(optimizer)
    waiting = optimizer.ask(3)
    resumed: Optimizer = subject.build()
    resumed.restore(json.loads(json.dumps(optimizer.state(), allow_nan=False)))
    for search in (optimizer, resumed):
        search.tell([sphere(c) for c in waiting])
    finding = "the restored search proposes something else: the state leaves something out"
    require(proposals(resumed) == proposals(optimizer), finding)


def survives_failed_evaluations(subject: Subject) -> None:
    """NaN objectives are accepted: the search continues within bounds."""
    optimizer = started(subject)
    generation(optimizer, lambda trial: trial.scored(math.nan))
    generation(optimizer, lambda trial: trial.scored(math.nan if trial.number % 2 else squares(trial)))
    require_within(MIXED, optimizer.ask(BATCH))


def begins_at_a_guess(subject: Subject) -> None:
    """a search may start at a guess, which may have only some of the variables and does not limit the search."""
    guesses: tuple[dict[str, Value], ...] = ({"length": 0.05, "modules": 5, "side": "both"}, {"modules": 10})
    for guess in guesses:
        optimizer = started(subject, replace(MIXED, start=guess))
        seen = [c for _ in range(3) for c in generation(optimizer)]
        require_within(MIXED, seen)
        away = any(c.values[name] != value for c in seen for name, value in guess.items())
        require(away, f"all {len(seen)} candidates repeat the guess {guess}")


def recommends_within_bounds(subject: Subject) -> None:
    """`recommend` gives candidates within bounds, one per context at most; or none."""
    optimizer = started(subject)
    generation(optimizer)
    recommended = optimizer.recommend()
    require(len(recommended) <= 1, f"{len(recommended)} recommendations for a search without contexts")
    require_within(MIXED, recommended)


def exports_into_its_folder(subject: Subject) -> None:
    """`export` writes into the folder that it is given and nowhere else, and names the files."""
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


def improves_on_a_sphere(subject: Subject) -> None:
    """objectives are minimised: a search gets better than its first generation."""
    optimizer = started(subject, PLANE)
    count = max(BATCH, optimizer.batch)
    first, *others = ([squares(c) for c in generation(optimizer, count=count)] for _ in range(15))
    later, median = min(map(min, others)), float(np.median(first))
    require(
        later < 0.1 * median,
        f"the best of 14 generations on a sphere is {later:.3g}, the first generation's median {median:.3g}: "
        "maximised, or not searching",
    )


def avoids_what_is_refused(subject: Subject) -> None:
    """candidates that violate constraints are accepted, and later ones violate them less often."""
    optimizer = started(subject, PLANE)
    refused: list[bool] = []
    while len(refused) < ENOUGH_OF_ONE:
        refused += [trial.violation > 0 for trial in _round(optimizer, half_plane)]
        share = float(np.mean(refused[-WINDOW:]))
        if len(refused) >= 2 * WINDOW and share <= 0.5 * BLIND_SHARE:
            return
    raise Finding(
        f"{share:.0%} of the last {WINDOW} candidates break a constraint that a blind search breaks in "
        f"{BLIND_SHARE:.0%}: is a trial with `violation` above 0, whatever its objective, or with NaN, taken for a "
        "good one?"
    )


def finds_a_front(subject: Subject) -> None:
    """an optimizer of several objectives finds compromises between them: the hypervolume grows."""
    _require_claim(subject, "several_objectives", "one objective")
    optimizer = started(subject, TWO_ENDS)
    points: list[tuple[float, ...]] = []
    while len(points) < ENOUGH_OF_TWO:
        points += [trial.objectives for trial in _round(optimizer, two_ends)]
        first, last = (hypervolume(np.array(p), CORNER) for p in (points[:WINDOW], points[-WINDOW:]))
        if len(points) >= 2 * WINDOW and last >= first + 0.5 * (IDEAL - first):
            return
    raise Finding(
        f"the last {WINDOW} candidates have the hypervolume {last:.1f}, the first had {first:.1f} of {IDEAL:.1f}: "
        "are all objectives used, the second too?"
    )


def learns_an_answer_for_each_context(subject: Subject) -> None:
    """an optimizer with contexts tries every one and learns an optimum for each; a context is an index."""
    _require_claim(subject, "contexts", "no contexts")
    optimizer = started(subject, TWO_PLACES)
    seen: list[int] = []
    while len(seen) < ENOUGH_OF_CONTEXTS:
        asked = optimizer.ask(optimizer.batch)
        require_within(TWO_PLACES, asked)
        seen += [candidate.context for candidate in asked]
        tried = set(seen)
        require(tried <= {0, 1}, f"contexts {sorted(tried)} of a search with two contexts")
        require(len(tried) == 2 or len(seen) < WINDOW, f"only contexts {sorted(tried)} of 0 and 1 were tried")
        optimizer.tell([two_places(candidate) for candidate in asked])
        recommended = optimizer.recommend()
        require_within(TWO_PLACES, recommended)
        left, right = (
            [float(c.values["a"]) for c in recommended or asked if c.context == context] for context in (0, 1)
        )
        places = [float(np.mean(found)) if found else math.nan for found in (left, right)]
        if len(seen) >= WINDOW and places[1] - places[0] >= 0.5:
            return
    raise Finding(
        f"after {len(seen)} candidates 'a' is {places[0]:.2f} in one context and {places[1]:.2f} in the other, where "
        "−0.5 and 0.5 are best: one answer for both?"
    )


def _require_claim(subject: Subject, capability: str, otherwise: str) -> None:
    if not getattr(subject.component.implementation_class().capabilities, capability):
        raise CheckSkipped(f"{subject.component.label} knows {otherwise}")


def _round(optimizer: Optimizer, score: Score) -> list[Trial]:
    """Return a batch of the optimizer's own size, scored."""
    trials = [score(c) for c in optimizer.ask(optimizer.batch)]
    optimizer.tell(trials)
    return trials
