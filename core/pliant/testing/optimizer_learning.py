"""Checks that an `Optimizer` learns: paraboloids, refused candidates, several objectives, contexts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pliant.interfaces.optimizer import Optimizer, Trial
from pliant.testing.optimizer_bench import (
    BATCH,
    PLANE,
    TWO_ENDS,
    TWO_PLACES,
    Score,
    generation,
    half_plane,
    hypervolume,
    require_within,
    squares,
    started,
    two_ends,
    two_places,
)
from pliant.testing.suite import CheckSkipped, Finding, Subject, Suite, require

suite = Suite("optimizer")
# A search has learned as soon as its latest candidates show it; this many are its limit.
ENOUGH_OF_ONE, ENOUGH_OF_TWO, ENOUGH_OF_CONTEXTS = 3000, 480, 8000
WINDOW = 40
BLIND_SHARE = 7 / 9  # of the plane that `half_plane` refuses
CORNER, IDEAL = (
    8.0,
    64 - 8 / 3,
)  # reference point of the hypervolume, and what the whole front of `two_ends` has


@suite.check("objectives are minimised: a search gets better than its first generation.")
def improves_on_a_sphere(subject: Subject) -> None:
    optimizer = started(subject, PLANE)
    count = max(BATCH, optimizer.batch)
    scores = [[squares(c) for c in generation(optimizer, count=count)] for _ in range(15)]
    later = min(s for generation in scores[1:] for s in generation)
    median = float(np.median(scores[0]))
    require(
        later < 0.1 * median,
        f"the best of 14 generations on a sphere is {later:.3g}, the first generation's median {median:.3g}: "
        "maximised, or not searching",
    )


@suite.check("candidates that break constraints are survived, and later ones break them less often.")
def avoids_what_is_refused(subject: Subject) -> None:
    optimizer = started(subject, PLANE)
    refused: list[bool] = []
    while len(refused) < ENOUGH_OF_ONE:
        for trial in _round(optimizer, half_plane):
            refused.append(trial.violation > 0)
        share = float(np.mean(refused[-WINDOW:]))
        if len(refused) >= 2 * WINDOW and share <= 0.5 * BLIND_SHARE:
            return
    raise Finding(
        f"{share:.0%} of the last {WINDOW} candidates break a constraint that a blind search breaks in "
        f"{BLIND_SHARE:.0%}: is a trial with `violation` above 0, whatever its objective, or with NaN, taken for a "
        "good one?"
    )


@suite.check("who claims several objectives finds compromises between them: the hypervolume grows.")
def finds_a_front(subject: Subject) -> None:
    if not subject.component.implementation_class().capabilities.several_objectives:
        raise CheckSkipped(f"{subject.component.label} knows one objective")
    optimizer = started(subject, TWO_ENDS)
    points: list[tuple[float, float]] = []
    while len(points) < ENOUGH_OF_TWO:
        points += [(t.objectives[0], t.objectives[1]) for t in _round(optimizer, two_ends)]
        if len(points) < 2 * WINDOW:
            continue
        first, last = (hypervolume(np.array(p), CORNER) for p in (points[:WINDOW], points[-WINDOW:]))
        if last >= first + 0.5 * (IDEAL - first):
            return
    raise Finding(
        f"the last {WINDOW} candidates have the hypervolume {last:.1f}, the first had {first:.1f} of {IDEAL:.1f}: "
        "are all objectives used, the second too?"
    )


@suite.check("who claims contexts tries every one; a candidate's context is the index of one.")
def contexts_are_in_range(subject: Subject) -> None:
    _require_contexts(subject)
    optimizer = started(subject, TWO_PLACES)
    seen = set()
    for _ in range(10):
        for candidate in generation(optimizer, two_places, max(BATCH, optimizer.batch)):
            require(
                candidate.context in (0, 1), f"context {candidate.context!r} of a search with two contexts"
            )
            require_within(TWO_PLACES, candidate.values)
            seen.add(candidate.context)
    require(seen == {0, 1}, f"only contexts {sorted(seen)} of 0 and 1 were tried")


@suite.check("who claims contexts learns an answer for each.")
def learns_an_answer_for_each_context(subject: Subject) -> None:
    _require_contexts(subject)
    optimizer = started(subject, TWO_PLACES)
    told = 0
    while told < ENOUGH_OF_CONTEXTS:
        asked = generation(optimizer, two_places, optimizer.batch)
        told += len(asked)
        recommended = optimizer.recommend()
        for candidate in recommended:
            require_within(TWO_PLACES, candidate.values)
        places = [_place(recommended or asked, context) for context in (0, 1)]
        if told >= WINDOW and places[1] - places[0] >= 0.5:
            return
    raise Finding(
        f"after {told} candidates 'a' is {places[0]:.2f} in one context and {places[1]:.2f} in the other, where "
        "−0.5 and 0.5 are best: one answer for both?"
    )


def _require_contexts(subject: Subject) -> None:
    if not subject.component.implementation_class().capabilities.contexts:
        raise CheckSkipped(f"{subject.component.label} knows no contexts")


def _place(candidates: Sequence[Trial], context: int) -> float:
    """Mean of `a` in a context; NaN where no candidate is for it."""
    found = [float(c.values["a"]) for c in candidates if c.context == context]
    return float(np.mean(found)) if found else float("nan")


def _round(optimizer: Optimizer, score: Score) -> list[Trial]:
    """A batch of the optimizer's own size."""
    asked = optimizer.ask(optimizer.batch)
    trials = [score(c) for c in asked]
    optimizer.tell(trials)
    return trials
