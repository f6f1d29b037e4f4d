"""Successive halving: the best searches go on, an interruption changes nothing, what cannot be halved is refused."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.cli.search_study import STUDY
from tests.search.test_journal import StopError, Stopping

from pliant import api
from pliant.errors import UserError
from pliant.search.run.search import Halving

PLUGIN = Path(__file__).with_name("narrowing_plugin.py")
SEARCHES, BUDGET = 9, 6
MODULES = "search.variables.n={key: chain.modules, low: 2, high: 10, each: true}"


@pytest.fixture
def opened(tmp_path):
    """Open the study: nine searches of one batch each."""
    path = tmp_path / "study.yaml"
    path.write_text(STUDY.replace("{kind: cmaes}", "{kind: narrowing}") + f"plugins: [{PLUGIN}]\n")
    usual = (MODULES, f"search.budget={BUDGET}", "search.halving={factor: 3}", "search.verify=null")

    def call(*overrides, store="store"):
        return api.open_study(path, (*usual, *overrides), store=tmp_path / store)

    return call


def test_the_best_third_goes_on_with_three_times_the_candidates(opened):
    history = api.optimize(opened(), workers=1).history
    counts = Counter(history.branch.tolist())
    assert Counter(counts.values()) == {6: 6, 18: 2, 54: 1}
    for budget, left in ((6, 3), (18, 1)):
        best = {b: np.nanmin(history.objectives[history.branch == b, 0][:budget]) for b in range(SEARCHES)}
        going = {b for b in best if counts[b] > budget}
        tried = [b for b in best if counts[b] >= budget]
        assert going == set(sorted(tried, key=best.__getitem__)[:left])


def test_the_winner_is_what_its_search_alone_finds_with_as_many_candidates(opened):
    result = api.optimize(opened(), workers=1)
    (best,) = result.best
    alone = api.optimize(opened("search.halving=null", "search.budget=54", store="other"), workers=1)
    same = alone.history.branch == best.branch
    assert best.objectives["abs(tip_x - 10 mm)"] == np.nanmin(alone.history.objectives[same, 0])


@pytest.mark.parametrize("after", [0, 40, 54, 60, 91, 100, 125])
def test_interrupted_anywhere_it_ends_the_same(opened, after):
    whole = api.optimize(opened(store="whole"), workers=1)
    study = opened(store="cut")
    stopped = replace(study, bench=replace(study.bench, progress=Stopping(after)))
    with pytest.raises(StopError):
        api.optimize(stopped, workers=1)
    again = api.optimize(study, workers=1)
    assert np.array_equal(again.history.branch, whole.history.branch)
    assert np.array_equal(again.history.objectives, whole.history.objectives)
    assert [design.values for design in again.best] == [design.values for design in whole.best]
    assert again.evaluations == whole.evaluations


def test_workers_change_nothing(opened):
    alone, both = api.optimize(opened(), workers=1), api.optimize(opened(store="two"), workers=2)
    assert np.array_equal(alone.history.objectives, both.history.objectives)


def test_budgets_are_rounded_up_to_whole_batches(opened):
    history = api.optimize(opened("search.budget=7", "search.halving={factor: 9}"), workers=1).history
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
def test_what_cannot_be_halved_is_refused(opened, overrides, said):
    with pytest.raises(UserError, match=said):
        api.optimize(opened(*overrides), workers=1)


@pytest.mark.parametrize(
    "text", ["", "{", '{"of": [9, 3, 6, null]}', '{"of": [9, 2, 6, null], "chosen": [[1]]}']
)
def test_choices_that_cannot_be_read_or_are_of_another_search_are_made_again(tmp_path, text):
    (tmp_path / "halving.json").write_text(text)
    halving = Halving(tmp_path, 9, 3, (6, None))
    assert halving.left == list(range(9))
    assert halving.go_on([5, 4, 3, float("inf"), 1, 9, 9, 9, 9])
    assert halving.left == [1, 2, 4]
    assert Halving(tmp_path, 9, 3, (6, None)).left == [1, 2, 4]
    assert [halving.times(branch) for branch in (0, 1)] == [1, 3]
