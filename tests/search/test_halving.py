"""Successive halving: the best searches continue, an interruption changes nothing, unsuitable searches are refused."""

from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from tests.search.toy_search import StopError, Watched

from pliant.errors import UserError
from pliant_search.run.search import Halving
from pliant_search.stage import search_study

SEARCHES, BUDGET = 9, 6
HALVED = (
    "search.variables.n={key: chain.modules, low: 2, high: 10, each: true}",
    f"search.budget={BUDGET}",
    "search.halving={factor: 3}",
    "search.verify=null",
)


def test_the_best_third_goes_on_with_three_times_the_candidates(optimized):
    history = optimized(*HALVED).history
    counts = Counter(history.branch.tolist())
    assert Counter(counts.values()) == {6: 6, 18: 2, 54: 1}
    for budget, left in ((6, 3), (18, 1)):
        best = {b: np.nanmin(history.objectives[history.branch == b, 0][:budget]) for b in range(SEARCHES)}
        going = {b for b in best if counts[b] > budget}
        tried = [b for b in best if counts[b] >= budget]
        assert going == set(sorted(tried, key=best.__getitem__)[:left])


@pytest.mark.slow
def test_the_winner_is_what_its_search_alone_finds_with_as_many_candidates(optimized):
    (best,) = optimized(*HALVED).best
    alone = optimized(*HALVED, "search.halving=null", "search.budget=54", store="other")
    same = alone.history.branch == best.branch
    assert best.objectives["abs(tip_x - 10 mm)"] == np.nanmin(alone.history.objectives[same, 0])


@pytest.mark.slow
def test_interrupted_anywhere_it_ends_the_same(optimized):
    whole = optimized(*HALVED, store="whole")
    for after in (0, 54, 91, 125):
        store = f"cut-{after}"
        with pytest.raises(StopError):
            optimized(*HALVED, store=store, progress=Watched(after))
        again = optimized(*HALVED, store=store)
        assert np.array_equal(again.history.branch, whole.history.branch)
        assert np.array_equal(again.history.objectives, whole.history.objectives)
        assert [design.values for design in again.best] == [design.values for design in whole.best]
        assert again.evaluations == whole.evaluations


def test_workers_change_nothing(opened, optimized):
    """The search is halved, and its best candidates are evaluated once more."""
    again = "search.confirm={best: 2, change: {chain.payload: 2 g}}"
    study, alone = opened(*HALVED, again), optimized(*HALVED, again, store="alone")
    with ThreadPoolExecutor(2) as pool:
        both = search_study(study.context, study.study, executor=pool).value
    assert np.array_equal(alone.history.objectives, both.history.objectives)
    assert [design.objectives for design in alone.best] == [design.objectives for design in both.best]


def test_budgets_are_rounded_up_to_whole_batches(optimized):
    history = optimized(*HALVED, "search.budget=7", "search.halving={factor: 9}").history
    assert Counter(Counter(history.branch.tolist()).values()) == {12: 8, 66: 1}


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (("search.variables.n={each: false}",), "has one search"),
        (("search.objective=[abs(tip_x - 10 mm), tip_z]", "optimizer=front"), "lists several"),
        (
            ("optimizer=contextual", "search.conditions={a: {task.steps: 2}, b: {task.steps: 3}}"),
            "'contextual'",
        ),
    ],
)
def test_what_cannot_be_halved_is_refused(optimized, overrides, said):
    with pytest.raises(UserError, match=said):
        optimized(*HALVED, *overrides)


@pytest.mark.parametrize(
    "text", ["", "{", '{"of": [9, 3, 6, null]}', '{"of": [9, 2, 6, null], "chosen": [[1]]}']
)
def test_choices_that_are_unreadable_or_from_another_search_are_made_again(tmp_path, text):
    (tmp_path / "halving.json").write_text(text)
    halving = Halving(tmp_path, 9, 3, (6, None))
    assert halving.left == list(range(9))
    assert halving.go_on([5, 4, 3, float("inf"), 1, 9, 9, 9, 9])
    assert halving.left == [1, 2, 4]
    assert Halving(tmp_path, 9, 3, (6, None)).left == [1, 2, 4]
    assert [halving.times(branch) for branch in (0, 1)] == [1, 3]
