"""The loop: the result depends on the seed alone; constraints, `until`, budgets and failures are distinguished."""

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from tests.search.toy_search import PLANE, Contextual, Narrowing, ToyProblem, Watched, searched, told

from pliant.errors import ContractError
from pliant.execution.executors import InlineExecutor
from pliant_search.optimizer import Context, Space, Trial
from pliant_search.run.results import best_row, build_history, pareto_front, refusal_counts

EACH = tuple({"s": s} for s in range(5))


def rows(branches):
    return [(branch.index, row) for branch in branches for row in branch.trials]


@pytest.mark.parametrize(
    ("budget", "generations", "evaluated", "batches"),
    [(300, None, 300, 50), (20, None, 20, 4), (1, 7, 42, 7)],
)
def test_a_search_spends_its_budget_in_batches(tmp_path, budget, generations, evaluated, batches):
    (branch,) = searched(tmp_path, budget=budget, generations=generations)
    assert (branch.budget, branch.evaluated, branch.batches) == (evaluated, evaluated, batches)
    assert (branch.stopped, len(branch.trials)) == ("budget", evaluated)
    best = best_row(rows([branch]))[1]
    assert budget < 300 or (best.objectives[0] < 2e-3 and best.values["n"] == 2)


def test_the_seed_decides_and_branches_differ(tmp_path):
    first, again = searched(tmp_path / "a", branches=EACH), searched(tmp_path / "b", branches=EACH)
    assert told(first) == told(again)
    assert told(searched(tmp_path / "c", branches=EACH, seed=4)) != told(first)
    starts = {branch.trials[0].values["a"] for branch in first}
    assert len(starts) == len(EACH)
    assert [{row.values["s"] for row in branch.trials} for branch in first] == [{s} for s in range(5)]


def test_workers_and_their_timing_change_nothing(tmp_path):
    alone = searched(tmp_path / "alone", branches=EACH[:3], budget=20)
    with ThreadPoolExecutor(4) as pool:
        threads = searched(tmp_path / "threads", branches=EACH[:3], budget=20, executor=pool, delay_s=0.003)
        one = searched(tmp_path / "one", budget=20, executor=pool, delay_s=0.003)
    assert told(threads) == told(alone)
    assert told(one) == told(searched(tmp_path / "other", budget=20))


def test_until_ends_its_own_branch_only(tmp_path):
    problem = ToyProblem(good=0.02)
    branches = searched(tmp_path, branches=({"s": 0}, {"s": 100}), budget=200, problem=problem)
    assert [branch.stopped for branch in branches] == ["until", "budget"]
    assert min(row.objectives[0] for row in branches[0].trials) <= 0.02
    assert branches[0].evaluated < 200 == branches[1].evaluated


def test_until_is_asked_in_every_condition_that_has_a_separate_design(tmp_path):
    space = Space(PLANE, contexts=(Context("one"), Context("two")))
    problem = ToyProblem(good=0.05)
    (branch,) = searched(tmp_path, budget=400, problem=problem, space=space, make=Contextual)
    met = [row.context for row in branch.trials if row.objectives[0] <= 0.05]
    assert branch.stopped == "until"
    assert set(met) == {0, 1}
    before = [row.context for row in branch.trials[: branch.evaluated - 6] if row.objectives[0] <= 0.05]
    assert len(set(before)) == 1  # the last batch was needed, and one condition had its design earlier
    (again,) = searched(tmp_path, budget=400, problem=problem, space=space, make=Contextual)
    assert (again.stopped, told([again])) == ("until", told([branch]))


def test_what_is_refused_is_told_but_neither_simulated_nor_counted(tmp_path):
    (branch,) = searched(tmp_path / "a", budget=60, problem=ToyProblem(most=-0.2))
    assert branch.evaluated == 60
    for row in branch.trials:
        over = row.values["a"] + row.values["b"] + 0.2
        assert (row.state == "refused") == (over > 0)
        if over > 0:
            assert row.violation == pytest.approx(over)
            assert np.isnan(row.told(1).objective) and row.told(1).violation > 0
    assert refusal_counts(rows([branch])) == ({"a + b <= -0.2": branch.refused}, {})
    (own,) = searched(tmp_path / "b", budget=30, refused_above=-0.5)
    assert own.evaluated == 30
    assert refusal_counts(rows([own]))[0] == {"too high": own.refused} != {"too high": 0}
    (none,) = searched(tmp_path / "c", budget=4, problem=ToyProblem(most=-9.0))
    assert (none.stopped, none.evaluated) == ("exhausted", 0)
    assert 200 <= none.refused <= 206


def test_nan_and_errors_count_and_are_survived(tmp_path):
    (branch,) = searched(tmp_path, budget=80, nan_below=-0.2, raises_below=-0.8)
    assert branch.evaluated == 80
    assert set(refusal_counts(rows([branch]))[1]) == {"rmse is not a number", "ZeroDivisionError: b"}
    history = build_history(PLANE, rows([branch]), 1)
    assert np.isnan(history.objectives[history.status > 1]).all()
    assert np.isfinite(history.objectives[history.status == 0]).all()
    assert history.best_so_far()[-1] == np.nanmin(history.objectives)


def test_contexts_are_tried_in_their_one_condition(tmp_path):
    space = Space(PLANE, contexts=(Context("x"), Context("y")))
    (branch,) = searched(tmp_path, budget=60, space=space)
    assert [row.context for row in branch.trials[:4]] == [0, 1, 0, 1]
    best = [best_row(r for r in rows([branch]) if r[1].context == c)[1] for c in (0, 1)]
    assert [row.values["n"] for row in best] == [2, 3]


class Unruly(Narrowing):
    """An optimizer that proposes an unknown variable."""

    def ask(self, count):
        return [Trial(c.number, {**c.values, "x": 1.0}) for c in super().ask(count)]


class Many(Narrowing):
    """An optimizer that proposes more than requested."""

    def ask(self, count):
        return super().ask(count + 1)


class Mute(Narrowing):
    """An optimizer that proposes nothing after the first batch."""

    def ask(self, count):
        return super().ask(count) if self.asked < 6 else []


@pytest.mark.parametrize(("make", "words"), [(Unruly, "over a, b, n"), (Many, "proposes 7")])
def test_an_optimizer_that_breaks_its_contract_is_named(tmp_path, make, words):
    with pytest.raises(ContractError, match=words):
        searched(tmp_path, make=make)


def test_an_optimizer_with_nothing_left_ends_the_search(tmp_path):
    (branch,) = searched(tmp_path, make=Mute)
    assert (branch.stopped, branch.evaluated) == ("exhausted", 6)


def test_the_bar_tells_totals_the_best_and_what_was_refused(tmp_path):
    bar = Watched()
    problem = ToyProblem(most=0.5, good=0.02)
    each = ({"s": 0}, {"s": 100})
    branches = searched(tmp_path / "a", branches=each, problem=problem, budget=100, progress=bar)
    assert bar.total == bar.done == sum(branch.evaluated for branch in branches)
    lowest = min(row.objectives[0] for branch in branches for row in branch.trials if row.feasible)
    assert bar.texts[-1].startswith(f"best {lowest:.4g}") and "refused" in bar.texts[-1]
    bar = Watched()
    (branch,) = searched(tmp_path / "b", budget=4, problem=ToyProblem(most=-2.0), progress=bar)
    assert any(all(row.state == "refused" for row in branch.trials[k : k + 6]) for k in range(0, 60, 6))
    assert bar.texts[-1].endswith(f", {branch.refused} refused")


def test_the_time_that_workers_take_to_begin_counts_for_nothing(tmp_path):
    begun, slow_s = [], 0.4

    class Slow(InlineExecutor):
        size = 2

        def submit(self, function, *values):
            time.sleep(0.0 if values[-1] else slow_s / self.size)
            return super().submit(function, *values)

    class Titles(Watched):
        def begin(self, title, total, done=0):
            begun.append((title, time.perf_counter()))
            return self

    started = time.perf_counter()
    (branch,) = searched(tmp_path, budget=12, executor=Slow(), progress=Titles())
    assert [title for title, _ in begun] == ["workers begin", "searching"]
    assert begun[1][1] - started >= slow_s
    assert 0.0 < branch.wall_s < time.perf_counter() - started - slow_s


def test_the_front_holds_what_nothing_beats():
    scores = [(1.0, 5.0), (2.0, 3.0), (2.0, 4.0), (3.0, 3.0), (4.0, 1.0), (4.0, 1.0), (5.0, 0.5)]
    told_rows = [(0, Trial(k, {}, -1, "ok", one)) for k, one in enumerate(scores)]
    broken = (0, Trial(9, {}, -1, "ok", (0.0, 0.0), violation=1.0))
    front = pareto_front([*reversed(told_rows), broken])
    assert [row.objectives for _, row in front] == [(1.0, 5.0), (2.0, 3.0), (4.0, 1.0), (5.0, 0.5)]


def test_causes_that_differ_in_numbers_are_counted_as_one():
    def failed(cause, status="failed", violation=0.0):
        return (0, Trial(0, {}, -1, status, cause=cause, violation=violation))

    rows_ = [failed(f"joint {k} stands {10 * k + 0.5} % outside.") for k in range(4)]
    rows_ += [failed("the chain did not settle.")] * 2
    rows_ += [failed(f"n{k} <= 12", "refused", 1.0) for k in (1, 2)] + [failed("n1 <= 7", "refused", 1.0)]
    rows_ += [failed(f"a wall of {k} mm is too thin", "refused") for k in (1, 2)]
    refused, causes = refusal_counts(rows_)
    assert causes == {"joint 0 stands 0.5 % outside, or the like": 4, "the chain did not settle.": 2}
    assert refused == {
        "n1 <= 12": 1, "n2 <= 12": 1, "n1 <= 7": 1, "a wall of 1 mm is too thin, or the like": 2,
    }  # fmt: skip
