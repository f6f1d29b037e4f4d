"""The page of a search: every kind of result in human units, with pictures and alternative texts, in few bytes."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from tests.report import search_samples as samples
from tests.report.pages import check_sound, words
from tests.slow import slow_among

from pliant.config.loading import load_study
from pliant.errors import UserError
from pliant.registry.discovery import discover
from pliant.registry.result_folder import result_folder
from pliant.report import render
from pliant.report.document import Page
from pliant_search.records import SearchResult
from pliant_search.report.document import (
    answer,
    late,
    rebuild_search_page,
    search_document,
    warned,
    write_search_page,
)
from pliant_search.report.page import design_table, robust_table
from pliant_search.report.view import SearchView, price

LARGEST = 1_500_000


def checked() -> SearchResult:
    one = samples.one_branch()
    return replace(one, verification=samples.verification(), robustness=samples.robustness(one.best[0]))


MAKERS: dict[str, tuple[Callable[[], SearchResult], int, tuple[str, ...]]] = {
    "one": (samples.one_branch, 4, ("6 to 8 mm", "2 to 15 kPa", "−180 to 180 °", "candidate 116")),
    "branches": (samples.many_branches, 5, ("n1 · n2 · n3 · n4", "81 searches", "The best searches")),
    "contextual": (samples.contextual, 4, ("one design for each of 6 conditions", "a very long name of a condition")),
    "two": (lambda: samples.two_objectives(150), 4, ("A front of", "The front", "further designs")),
    "checked": (checked, 7, (
        "verified by direct FEM: 1.93 mm in mujoco", "7 / 10", "27 / 30", "1.23 %", "costs 0.5 mm",
    )),
    "failed": (samples.everything_failed, 1, (
        "No design was found", "20 refused, 20 failed", "the chain did not settle",
    )),
}  # fmt: skip


ORDER = (
    "The answer", "How the search went", "All variables at once", "What the objective is sensitive to",
    "Predicted and verified", "What it costs to be robust", "What it took", "Inputs",
)  # fmt: skip


@cache
def page(name: str) -> Page:
    drawn = [samples.curved(f"design {k}") for k in (1, 2)] if name == "one" else []
    return render.page(search_document(samples.STUDY, MAKERS[name][0](), drawn))


@pytest.mark.parametrize("name", slow_among(MAKERS, *(set(MAKERS) - {"two", "failed"})))
def test_every_search_has_its_page(name: str) -> None:
    made = page(name)
    text = re.sub(r"\s+", " ", check_sound(made)).lower()
    assert len(made.pictures) == MAKERS[name][1] + (2 if name == "one" else 0) == made.html.count("<img ")
    for wanted in (*MAKERS[name][2], "what it took", "a <search>"):
        assert wanted.lower() in text, wanted
    titles = re.findall(r"<h2>(.*?)</h2>", made.html)
    order = [title for title in ORDER if title in titles]
    assert [title for title in titles if title in ORDER] == order
    assert len(order) == len(ORDER) or name != "checked"
    assert len(made.html) < LARGEST


@pytest.mark.slow
def test_fifty_thousand_candidates_and_sixteen_long_names_stay_small() -> None:
    wide = samples.one_branch(50_000, samples.wide_variables())
    html = render.page(search_document(samples.STUDY, wide)).html
    assert len(html) < LARGEST
    assert "3 family outer convolution d radius of curvature" in words(html)
    nothing = replace(
        samples.verification(), verified={}, conditions={}, laws=(), notes=("Nothing that FEM could check.",)
    )
    html = render.page(search_document(samples.STUDY, samples.one_branch(40, verification=nothing))).html
    assert "<h2>Predicted and verified</h2>" not in html and "Nothing that FEM could check." in html


def test_the_answer_says_what_is_predicted_and_what_is_verified() -> None:
    one = samples.one_branch()
    best = float(one.best[0].objectives["rmse"])
    predicted = answer(SearchView(one, samples.STUDY))
    assert f"rmse {1e3 * best:.4g}\u00a0mm, predicted and not verified" in predicted
    unverified = [w.sentence for w in warned(SearchView(one, samples.STUDY))]
    assert any("Nothing was verified" in sentence for sentence in unverified)
    sentences = [w.sentence for w in warned(SearchView(checked(), samples.STUDY))]
    assert any("13\u00a0%" in s and "1.93\u00a0mm" in s for s in sentences)
    assert "PyBullet has no wheel for this Python." in sentences
    assert not any("Nothing was verified" in s for s in sentences)


def test_an_objective_stands_once_among_the_designs() -> None:
    table = design_table(SearchView(samples.two_objectives(150), samples.STUDY))
    rows = [row[0] for row in table.rows] if table is not None else []
    assert len(rows) == len(set(rows)) and {"rmse", "work", "e max"} <= set(rows)


def test_a_best_design_at_the_budget_limit_is_warned_about() -> None:
    one = samples.one_branch()
    assert late(SearchView(one, {}))
    assert not late(SearchView(replace(one, stopped="until"), {}))
    objectives = one.history.objectives.copy()
    objectives[3] = 1e-4
    early = replace(one, history=replace(one.history, objectives=objectives))
    assert not late(SearchView(early, {}))


def test_the_robustness_price_has_the_right_sign() -> None:
    one = checked()
    text = price(SearchView(one, {}))
    assert "costs 0.5\u00a0mm" in text and "improves the mean of the worst 20\u00a0%" in text
    assert one.robustness is not None
    free = replace(one.robustness, nominal_of_robust=1.6e-3, robust_of_robust=9e-3)
    text = price(SearchView(replace(one, robustness=free), {}))
    assert "costs nothing where nothing deviates (" in text and "does not improve" in text
    up = samples.contextual(60)
    spread = {"nominal": np.array([0.9, 0.2]), "robust": np.array([0.8, 0.7])}
    found = replace(samples.robustness(up.best[0]), measure="worst", nominal_of_nominal=0.9, robust_of_nominal=0.2,
                    nominal_of_robust=0.8, robust_of_robust=0.7, spread=spread)  # fmt: skip
    robust = SearchView(replace(up, robustness=found), {})
    text, table = price(robust), robust_table(robust)
    assert "costs 0.1 of reward" in text and "(0.9 of the nominal design, 0.8 of the robust one)" in text
    assert "improves the worst" in text and "by 0.5 (0.2 against 0.7)" in text
    assert table is not None
    assert [list(row[1:]) for row in table.rows[:2]] == [["0.9", "0.8"], ["0.2", "0.7"]]


def test_a_design_with_one_condition_shows_what_acts_in_it() -> None:
    one = samples.contextual(60)
    design, variable = one.best[0], one.variables[0]
    read = SearchView(one, {})
    assert read.value(design, variable.name) == design.values[variable.name]
    others = dict.fromkeys(variable.keys, -1.0)
    elsewhere = replace(design, settings={**design.settings, **others})
    assert read.value(elsewhere, variable.name) is None
    assert read.value(replace(elsewhere, context=-1), variable.name) == design.values[variable.name]
    assert read.value(design, "nothing of the kind") is None


STUDY = """
pliant: 1
name: searched
surrogate: {kind: polynomial, form: study, coefficients: {k_n: 1.6e-6, m_a: 0, b_a: 0, m_e: 0.1, b_e: 0.0245}}
chain: {modules: 8, module_length: 11 mm}
task: {kind: free_bending, pressure: 15 kPa}
search:
  variables: {task.pressure: {low: 2 kPa, high: 15 kPa}}
  objective: tip_x
"""


@pytest.mark.slow
def test_a_written_folder_gives_the_same_page_again(tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(STUDY)
    study = load_study(tmp_path / "study.yaml", discover(), ())
    out = tmp_path / "new" / "out"
    drawn = [samples.curved("the best"), samples.grasped("in a scene")]
    written = write_search_page(out, study, checked(), drawn)
    first = written.read_text()
    assert (
        written == out / "search.html" and result_folder(out) is not None and result_folder(tmp_path) is None
    )
    written.unlink()
    assert rebuild_search_page(out).read_text() == first
    again = write_search_page(out, study, samples.everything_failed())
    assert "No design was found" in again.read_text() and rebuild_search_page(out) == again


def test_a_damaged_or_empty_folder_says_so(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="holds no finished search"):
        rebuild_search_page(tmp_path)
    (tmp_path / "study.yaml").write_text(STUDY)
    write_search_page(
        tmp_path, load_study(tmp_path / "study.yaml", discover(), ()), samples.everything_failed()
    )
    value = tmp_path / "data" / "search_page" / "value.json"
    value.write_text(value.read_text().replace("cmaes", "other"))
    with pytest.raises(UserError, match=r"is damaged.*checksum"):
        rebuild_search_page(tmp_path)
