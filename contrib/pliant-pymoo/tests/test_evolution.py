"""Tests of the additions to pymoo: encoding, refused and failed candidates, a state stored as JSON."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from pliant_pymoo import encoding
from pliant_pymoo.config import DeConfig, Nsga2Config
from pliant_pymoo.evolution import De, Evolution, Nsga2

from pliant_search.optimizer import Space, Trial, Variable

VARIABLES = (
    Variable("r", "real", 2e-3, 4e-3),
    Variable("modules", "integer", 5, 10),
    Variable("side", "categorical", choices=("left", "right", "both")),
)
BOWL = Space((Variable("a", "real", -1.0, 2.0), Variable("b", "real", -2.0, 1.0)))


def searches() -> list[Evolution]:
    return [De(DeConfig()), Nsga2(Nsga2Config(population=12))]


def bowl(candidate: Trial) -> Trial:
    a, b = (float(candidate.values[name]) for name in "ab")
    return candidate.scored((a - 1.3) ** 2 + (b + 0.4) ** 2)


def run_search(search: Evolution, candidates: int, score: Any = bowl) -> float:
    best, tried = np.inf, 0
    while tried < candidates:
        outcomes = [score(c) for c in search.ask(search.batch)]
        search.tell(outcomes)
        tried += len(outcomes)
        best = min(
            [best, *(o.objective for o in outcomes if o.violation == 0 and o.objective == o.objective)]
        )
    return best


@pytest.mark.parametrize(
    "values", [{"r": 2e-3, "modules": 5, "side": "both"}, {"r": 3.1e-3, "modules": 10, "side": "left"}]
)
def test_a_guess_decodes_to_itself(values: dict[str, Any]) -> None:
    x = encoding.encoded(VARIABLES, values, np.full(encoding.size(VARIABLES), 0.5))
    assert encoding.decoded(VARIABLES, x) == pytest.approx(values)


def test_whole_numbers_and_choices_have_equal_shares() -> None:
    x = np.random.default_rng(0).random((6000, encoding.size(VARIABLES)))
    values = [encoding.decoded(VARIABLES, row) for row in x]
    for k in range(5, 11):
        assert sum(v["modules"] == k for v in values) == pytest.approx(1000, abs=120)
    for side in ("left", "right", "both"):
        assert sum(v["side"] == side for v in values) == pytest.approx(2000, abs=170)


def test_the_first_candidate_is_the_guess() -> None:
    for search in searches():
        search.start(Space(VARIABLES, start={"r": 2.5e-3, "modules": 7, "side": "right"}), 1)
        assert search.ask(1)[0].values == pytest.approx({"r": 2.5e-3, "modules": 7, "side": "right"})


def test_differential_evolution_comes_close_to_the_bottom() -> None:
    search = De(DeConfig())
    search.start(BOWL, 5)
    assert run_search(search, 600) < 1e-6


def test_refused_candidates_lead_back_to_what_is_allowed() -> None:
    def score(candidate: Trial) -> Trial:
        over = float(candidate.values["a"]) - 0.5
        return candidate.scored(float("nan"), violation=over) if over > 0 else bowl(candidate)

    for search in searches():
        search.start(BOWL, 2)
        assert run_search(search, 600, score) == pytest.approx(0.64, abs=0.02), "the border a = 0.5"


def test_failed_evaluations_are_left_behind() -> None:
    def score(candidate: Trial) -> Trial:
        failed = float(candidate.values["b"]) < -1
        return candidate.scored(float("nan")) if failed else bowl(candidate)

    for search in searches():
        search.start(BOWL, 2)
        run_search(search, 300, score)
        latest = [float(c.values["b"]) for c in search.ask(search.batch)]
        assert np.mean([b < -1 for b in latest]) < 0.2


def test_it_goes_on_where_it_was_interrupted_in_a_generation() -> None:
    for one, other in zip(searches(), searches(), strict=True):
        one.start(BOWL, 9)
        run_search(one, 50)
        waiting = one.ask(5)
        one.tell([bowl(c) for c in waiting[:3]])
        other.restore(json.loads(json.dumps(one.state(), allow_nan=False)))
        for search in (one, other):
            search.tell([bowl(c) for c in waiting[3:]])
        for _ in range(3):
            asked = [search.ask(one.batch) for search in (one, other)]
            assert asked[0] == asked[1]
            for search, candidates in zip((one, other), asked, strict=True):
                search.tell([bowl(c) for c in candidates])


def test_a_front_has_both_ends() -> None:
    search = Nsga2(Nsga2Config(population=24))
    search.start(Space(BOWL.variables, objectives=2), 4)
    for _ in range(20):
        asked = search.ask(search.batch)
        search.tell([c.scored(float(c.values["a"]) ** 2, (float(c.values["a"]) - 1) ** 2) for c in asked])
    ends = [float(c.values["a"]) for c in search.ask(search.batch)]
    assert min(ends) < 0.1 and max(ends) > 0.9
