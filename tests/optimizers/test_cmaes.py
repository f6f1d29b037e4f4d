"""CMA-ES: known optima, generations in pieces, failures, restarts, exact resumption."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tests.optimizers.optimizer_searches as searches
from tests.optimizers.optimizer_searches import (
    MIXED,
    NAN,
    best,
    box,
    require_goes_on,
    resumed,
    scored,
    search,
)

from pliant_search.optimizer import Space, Variable
from pliant_search.optimizers.config import CmaesConfig

pytest.importorskip("cma")

from pliant_search.optimizers.cmaes.fitness import ScoredTrial, fitness
from pliant_search.optimizers.cmaes.optimizer import Cmaes, Encoding


def cmaes(space: Space, seed: int = 1, **config: Any) -> Cmaes:
    optimizer = Cmaes(CmaesConfig(**config))
    optimizer.start(space, seed)
    return optimizer


def test_finds_the_minimum_in_rosenbrocks_valley() -> None:
    candidate, outcome = best(search(cmaes(box(5)), searches.rosenbrock, 2400))
    assert outcome.objective < 1e-8
    assert np.allclose(list(candidate.values.values()), 1.0, atol=1e-3)


def test_finds_a_mixed_optimum() -> None:
    candidate, _ = best(search(cmaes(MIXED), searches.mixed, 400))
    assert (candidate.values["n"], candidate.values["c"], candidate.values["d"]) == (31, "v", 0)
    assert candidate.values["a"] == pytest.approx(0.3, abs=0.01)


def test_finds_an_optimum_on_a_constraint_in_a_corner_and_in_one_variable() -> None:
    done = search(cmaes(box(2)), searches.line, 500)
    assert best(done)[1].objective == pytest.approx(-np.sqrt(2), abs=1e-3)
    candidate, _ = best(search(cmaes(box(3)), lambda v: sum(v.values()), 600))  # type: ignore[arg-type]
    assert np.allclose(list(candidate.values.values()), -2.0, atol=1e-3)
    one = Space((Variable("a", "real", -1.0, 1.0),))
    candidate, _ = best(search(cmaes(one), lambda v: (v["a"] - 0.9) ** 2, 150))  # type: ignore[operator]
    assert candidate.values["a"] == pytest.approx(0.9, abs=1e-3)


def test_a_space_without_freedom_is_searched_all_the_same() -> None:
    fixed = Space((Variable("a", "real", 2.0, 2.0), Variable("c", "categorical", choices=("only",))))
    assert {tuple(c.values.values()) for c, _ in search(cmaes(fixed), lambda v: 0.0, 40)} == {(2.0, "only")}


def test_failures_are_survived_at_first_and_throughout() -> None:
    generator = np.random.default_rng(5)
    done = search(cmaes(box(4)), lambda v: NAN if generator.random() < 0.3 else searches.sphere(v), 900)
    assert best(done)[1].objective < 1e-3
    optimizer = cmaes(box(3))
    search(optimizer, lambda v: NAN, 60)
    assert best(search(optimizer, searches.sphere, 600))[1].objective < 1e-2


def test_smaller_violations_lead_into_the_feasible_part() -> None:
    """1 in 10⁵ of the box is feasible: random draws do not reach it."""

    def far(values: Any) -> tuple[float, float]:
        distance = float(np.linalg.norm(np.array(list(values.values())) - 0.9))
        return (distance, 0.0) if distance < 0.2 else (NAN, distance)

    done = search(cmaes(box(5)), far, 600)
    assert sum(o.violation == 0 for _, o in done) > 100


@pytest.mark.parametrize("at", [0, 20])
def test_goes_on_after_an_interruption_as_if_there_was_none(at: int) -> None:
    """The interruption is within a generation, with outcomes missing."""
    optimizer = cmaes(MIXED)
    search(optimizer, searches.mixed, at * optimizer.batch)
    waiting = optimizer.ask(3)
    optimizer.tell([scored(waiting[1], searches.mixed)])
    late = [scored(waiting[0], searches.mixed), waiting[2].scored(NAN)]
    require_goes_on(optimizer, late, searches.mixed, 150)


def test_goes_on_exactly_with_surplus_candidates_and_after_restarts() -> None:
    optimizer = cmaes(box(2), restarts=1)
    search(optimizer, searches.sphere, 1200)
    assert optimizer.state()["run"] > 0
    asked = [c for _ in range(3) for c in optimizer.ask(optimizer.batch)]
    require_goes_on(optimizer, [scored(c, searches.sphere) for c in asked], searches.sphere, 150)


def test_pieces_from_a_generation_are_the_generation() -> None:
    """Asked one by one, the candidates are those of one call."""
    whole, pieces = cmaes(box(4)), cmaes(box(4))
    for _ in range(5):
        together = whole.ask(whole.batch)
        single = [pieces.ask(1)[0] for _ in together]
        assert [c.values for c in together] == [c.values for c in single]
        for one, asked in ((whole, together), (pieces, single[::-1])):
            for candidate in asked:
                one.tell([scored(candidate, searches.sphere)])


def test_outcomes_that_never_come_do_not_stop_the_search() -> None:
    optimizer = cmaes(box(3))
    done = []
    for _ in range(60):
        asked = optimizer.ask(optimizer.batch)
        pairs = [(c, scored(c, searches.sphere)) for c in asked[1:]]  # the first one's worker has died
        optimizer.tell([o for _, o in pairs])
        done += pairs
    assert best(done)[1].objective < 0.1 * best(done[:20])[1].objective


def test_a_run_that_has_converged_is_followed_by_another() -> None:
    plain, ipop = cmaes(box(2), population=6), cmaes(box(2), population=6, restarts=2)
    for optimizer in (plain, ipop):
        search(optimizer, searches.sphere, 2000)
        assert optimizer.state()["run"] >= 2
    assert plain.batch == 6
    assert ipop.batch == 24


def test_begins_with_the_guess_itself() -> None:
    guess = {"a": 0.25, "n": 12, "c": "w", "d": 1}
    first = cmaes(replace(MIXED, start=guess)).ask(1)[0]
    assert {**first.values, "a": pytest.approx(0.25)} == guess


def test_population_follows_pycmas_rule() -> None:
    assert cmaes(box(13)).batch == 4 + int(3 * np.log(13))
    assert cmaes(box(13), population=31).batch == 31


def test_failed_ones_rank_behind_evaluated_ones_and_before_refused_ones() -> None:
    results = [
        ScoredTrial(3.0),
        ScoredTrial(None),
        ScoredTrial(None, 2.0),
        ScoredTrial(None, 0.1),
        ScoredTrial(-1.0),
    ]
    values = fitness(results, worst=7.0)
    assert np.argsort(values).tolist() == [4, 0, 1, 3, 2]
    assert values[1] > 7.0
    assert np.all(np.isfinite(fitness([ScoredTrial(None, 1e300), ScoredTrial(None)], None)))
    huge = fitness(
        [ScoredTrial(1e306), ScoredTrial(None), ScoredTrial(None, 1e300), ScoredTrial(-1e306)], 1e306
    )
    assert np.all(np.isfinite(huge))
    assert np.argsort(huge).tolist() == [3, 0, 1, 2]


def test_every_choice_and_number_can_be_reached() -> None:
    encoding = Encoding.from_variables(MIXED.variables)
    for guess in ({"n": n, "c": c, "d": d} for n in (4, 17, 40) for c in "uvwz" for d in (0, 1)):
        assert {k: encoding.decoded(encoding.encoded(guess))[k] for k in guess} == guess


def test_leaves_no_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cma_signals.in").write_text("{'maxiter': 0}")
    search(cmaes(box(2)), searches.sphere, 50)
    assert [p.name for p in tmp_path.iterdir()] == ["cma_signals.in"]


def test_a_spread_keeps_the_first_generations_about_the_start() -> None:
    axes = box(4).variables
    start = {v.name: 0.5 * (v.low + v.high) for v in axes}

    def width(space: Space) -> float:
        asked = [c for _ in range(40) for c in cmaes(space, seed=_).ask(8)]
        shares = [(float(c.values[v.name]) - v.low) / (v.high - v.low) for c in asked for v in axes]
        return float(np.std(shares))

    assert width(Space(axes, start=start, spread=0.05)) == pytest.approx(0.05, rel=0.15)
    assert width(Space(axes, start=start)) > 0.2
    assert width(Space(axes, start=start, spread=0.9)) == width(Space(axes, start=start))
    again = resumed(cmaes(Space(axes, start=start, spread=0.05)))
    assert [c.values for c in again.ask(8)] == [
        c.values for c in cmaes(Space(axes, start=start, spread=0.05)).ask(8)
    ]
