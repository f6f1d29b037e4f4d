"""Figures of a search: omitted and kept parts, and that they change with the record."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.report import search_samples as samples

from pliant.report.chart_json import as_script_data
from pliant.report.still import still
from pliant_search.records import SearchResult
from pliant_search.report.charts import (
    branches_chart,
    designs_chart,
    front_chart,
    history_chart,
    moving_median,
    robust_chart,
    slopes_chart,
    successes_chart,
    verified_chart,
)
from pliant_search.report.variable_charts import (
    MOST_LINES,
    answer_chart,
    last_rows,
    parallel_chart,
    policy_chart,
    thinned,
)
from pliant_search.report.view import SearchView, log_suits, short_labels, shown_range


def read(result: SearchResult) -> SearchView:
    return SearchView(result, samples.STUDY)


def test_thinning_keeps_the_best_tenth_and_spreads_the_rest_by_rank() -> None:
    order = np.arange(1000)[::-1]
    kept = thinned(order)
    assert len(kept) == MOST_LINES and len(set(kept.tolist())) == MOST_LINES
    assert kept[:100].tolist() == order[:100].tolist()
    assert kept[-1] == order[-1]
    assert np.diff([int(np.flatnonzero(order == k)[0]) for k in kept]).min() > 0
    many = thinned(np.arange(50_000))
    assert len(many) <= MOST_LINES and many[:200].tolist() == list(range(200))
    assert thinned(np.arange(7)).tolist() == list(range(7))


def test_labels_are_as_short_as_tells_them_apart() -> None:
    names = ["family.average_radius_m", "chain.segments.0.modules", "chain.segments.1.modules", "n1"]
    assert short_labels(names) == ["average radius", "0 modules", "1 modules", "n1"]


def test_axes_are_in_human_units_and_contain_every_value_kind() -> None:
    one = read(samples.one_branch())
    axes = {axis.unit.label: axis for axis in one.axes}
    assert (axes["average radius"].low, axes["average radius"].high) == pytest.approx((6.0, 8.0))
    assert axes["pressure"].title == "pressure (kPa)"
    assert axes["roll"].text(np.pi / 2) == "90°"
    assert axes["side"].choices == ("0°", "90°") and axes["side"].place(np.pi / 2) == 1.0
    assert np.isnan(axes["side"].place(1.0))
    raw = one.result.history.values[samples.RADIUS.name]
    assert axes["average radius"].values == pytest.approx(1e3 * raw)
    influence = [SearchView.influence(slope) for slope in one.by_influence()]
    assert influence == sorted(influence, reverse=True) and len(influence) == 5
    up = read(samples.contextual())
    assert up.scores()[up.ok] == pytest.approx(-up.result.history.objectives[up.ok, 0])
    assert up.scores()[up.order()[0]] == np.nanmax(up.scores())


def test_branches_are_read_from_the_history_or_from_the_branches() -> None:
    result = samples.many_branches(81 * 4)
    values = {name: column for name, column in result.history.values.items() if not name.startswith("n")}
    bare = replace(result, history=replace(result.history, values=values))
    for whole, fewer in zip(read(result).axes, read(bare).axes, strict=True):
        assert whole.values == pytest.approx(fewer.values)
    found = read(result).branch_winners()
    assert len(found) == 81 and found[0][1] == read(result).order()[0]


def test_ranges_leave_out_what_would_flatten_the_rest() -> None:
    values = np.concatenate([np.linspace(1, 2, 99), [1e4]])
    assert shown_range(values, maximised=False)[1] < 3
    assert shown_range(-values, maximised=True)[0] > -3
    assert shown_range(np.array([1.0, 2.0]), maximised=False) == (1.0, 2.0)
    outlying = np.where(np.arange(200) == 50, 1e6, 1.0)
    assert np.all(moving_median(np.arange(200.0), outlying)[1] == 1.0)
    assert log_suits(np.geomspace(1, 100, 20)) and not log_suits(np.linspace(-1, 100, 20))


def test_the_last_quarter_equals_the_condition() -> None:
    one = read(samples.contextual(240))
    rows = last_rows(one, 2)
    assert len(rows) and rows.min() >= 180
    assert set(one.result.history.context[rows].tolist()) == {2} and one.ok[rows].all()


def test_successes_are_counted_by_the_checks_own_trials() -> None:
    checked = replace(samples.one_branch(), verification=samples.verification())
    assert read(checked).success_counts()["mujoco"]["egg-5"] == (7, 10)
    own = samples.verification()
    twenty = {e: {c: {**m, "trials": 20.0} for c, m in one.items()} for e, one in own.conditions.items()}
    more = replace(checked, verification=replace(own, conditions=twenty))
    assert read(more).success_counts()["pybullet"]["egg-5"] == (14, 20)
    odd = {"mujoco": {"egg-0": {"success_share": 0.333}}}
    assert read(replace(checked, verification=replace(own, conditions=odd))).success_counts() == {}


@pytest.mark.slow
def test_figures_exist_for_what_the_record_has() -> None:
    plain, nothing = read(samples.one_branch(40)), read(samples.everything_failed())
    for make in (branches_chart, front_chart, policy_chart, robust_chart, verified_chart, successes_chart):
        assert make(plain) is None
    for made in (answer_chart, parallel_chart, slopes_chart):
        assert made(nothing) is None
    assert bytes(still(history_chart(nothing))[:4]) == b"\x89PNG"
    assert designs_chart(()) is None
    for make in (samples.curved, samples.grasped):
        shown = [make(f"design {k}") for k in (1, 2)]
        alone, both = designs_chart(shown[:1]), designs_chart(shown)
        assert alone is not None and both is not None and len(both.panels) == 2 * len(alone.panels)
        assert (shown[0].rest_m is None) == (make is samples.grasped)


def with_best(result: SearchResult, **changes: Any) -> SearchResult:
    return replace(result, best=(replace(result.best[0], **changes), *result.best[1:]))


SMALL, CONDITIONS = samples.one_branch(40), samples.contextual(60)
ELSEWHERE = {**CONDITIONS.best[0].settings, **dict.fromkeys(samples.RADIUS.keys, -1.0)}
CHECK = samples.verification()


@pytest.mark.parametrize(
    ("draw", "one", "other"),
    [
        (
            answer_chart,
            SMALL,
            with_best(SMALL, values={**SMALL.best[0].values, samples.RADIUS.name: 7.9e-3}),
        ),
        # no star where another variable sets the key in that condition
        (policy_chart, CONDITIONS, with_best(CONDITIONS, settings=ELSEWHERE)),
        # only a check by FEM is called one
        (
            verified_chart,
            replace(SMALL, verification=CHECK),
            replace(SMALL, verification=replace(CHECK, laws=())),
        ),
    ],
)
def test_a_picture_changes_with_what_it_shows(draw: Any, one: SearchResult, other: SearchResult) -> None:
    first, second = draw(read(one)), draw(read(other))
    assert first is not None and second is not None
    assert as_script_data(first) != as_script_data(second)
