"""A space without a feasible candidate is refused before the search begins, with the reason."""

import pytest
from tests.search.search_studies import search_problem

from pliant.errors import UserError
from pliant_search.problem.feasibility import require_feasible

SEARCH = """
variables:
  n1: {{key: chain.segments.0.modules, low: 4, high: 8}}
  n2: {{key: chain.segments.1.modules, low: 4, high: 8}}
  radius: {{key: family.average_radius, low: {low}, high: {high}}}
constraints: [{constraints}]
objective: rmse
"""


def problem(path, constraints="", low="6 mm", high="8 mm"):
    return search_problem(path, SEARCH.format(constraints=constraints, low=low, high=high))


def test_the_share_that_passes_is_estimated(tmp_path):
    found = require_feasible(problem(tmp_path, "n1 + n2 <= 12"), seed=0)
    # 15 of 25 pairs from 4 to 8 have a sum of at most 12.
    assert found.share == pytest.approx(15 / 25, abs=0.02)
    assert found.broken == {"n1 + n2 <= 12": pytest.approx(10 / 25, abs=0.02)}
    assert found.note() == "" and found.refused == {}
    assert require_feasible(problem(tmp_path, "n1 + n2 <= 12"), seed=0) == found


def test_a_constraint_that_never_holds_is_named(tmp_path):
    with pytest.raises(UserError, match=r"of 4096 samples.*'n1 \+ n2 <= 7' never holds") as error:
        require_feasible(problem(tmp_path, "n1 + n2 <= 7, radius <= 7 mm"), seed=0)
    assert "'radius <= 7 mm' fails in 50 %, alone in 0 %" in str(error.value)
    assert "Least broken: n1 = 4, n2 = 4" in str(error.value)


def test_constraints_that_exclude_each_other_are_named_with_their_shares(tmp_path):
    with pytest.raises(UserError, match="no candidate passes") as error:
        require_feasible(problem(tmp_path, "n1 <= 5, n1 >= 6"), seed=0)
    assert "'n1 <= 5' fails in 60 %, alone in 60 %" in str(error.value)
    assert "'n1 >= 6' fails in 40 %, alone in 40 %" in str(error.value)
    assert "never holds" not in str(error.value)


def test_a_small_share_is_said(tmp_path):
    found = require_feasible(problem(tmp_path, "radius <= 6.01 mm"), seed=0)
    assert 0 < found.share < 0.01
    assert "'radius <= 6.01 mm' turns 99" in found.note()


def test_designs_that_the_family_refuses_are_a_separate_cause(tmp_path):
    with pytest.raises(UserError, match="no candidate of the search is a possible design: all of 64 samples"):
        require_feasible(problem(tmp_path, low="2.1 mm", high="3 mm"), seed=0)
    some = require_feasible(problem(tmp_path, low="2.1 mm", high="8 mm"), seed=0)
    assert 0 < sum(some.refused.values()) < some.built == 64
    assert some.share == pytest.approx(1 - sum(some.refused.values()) / 64)


def test_metrics_do_not_count_before_the_search(tmp_path):
    assert require_feasible(problem(tmp_path, "rmse <= -1"), seed=0).share == 1.0
