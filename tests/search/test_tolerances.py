"""Tolerances that leave the meta-model's range are reported before the search, with the range that would suffice."""

import pytest
from tests.search import evaluation_bench as bench
from tests.search.toy_search import Watched

from pliant.errors import UserError
from pliant_search.evaluate.evaluator import evaluator_from_study
from pliant_search.evaluate.scenarios import tolerance_notes
from pliant_search.stage import search_study

# The table's radii are 4 mm to 5.5 mm, its lengths 8 mm to 10 mm; the study's own 4.7 mm and 8.6 mm.
SEARCH = "variables: {{R: {{key: family.radius, low: {low}, high: {high}}}}}\nobjective: bend_angle\n{more}"


def said(folder, vary, low="4 mm", high="5.5 mm", more="", extrapolate=""):
    search = (
        SEARCH.format(low=low, high=high, more=more) + f"\nrobust: {{samples: 2, laws: false, vary: {vary}}}"
    )
    one, problem = bench.springs(folder, search)
    study = one.study
    if extrapolate:
        block = study.meta_model.model_copy(update={"extrapolate": True})
        study = study.model_copy(update={"meta_model": block})
        object.__setattr__(problem, "study", study)
    return tolerance_notes(one.context, problem, evaluator_from_study(one.context, study).scenarios)


def test_a_variables_range_with_its_tolerance_is_told_beside_the_meta_models(tmp_path):
    (note,) = said(tmp_path, "{family.radius: 0.1 mm}")
    assert "family.radius (R), 4 mm to 5.5 mm, comes to 3.9 mm to 5.6 mm" in note
    assert "meta-model's range 4 mm to 5.5 mm" in note
    assert "keep it within 4.1 mm to 5.4 mm, solve designs beyond" in note


@pytest.mark.parametrize(
    ("vary", "within"),
    [("{family.radius: 10 %}", "4.44444 mm to 5 mm"), ("{family.radius: {sd: 0.1 mm}}", "4.3 mm to 5.2 mm")],
)
def test_shares_and_normal_deviations_reach_as_far_as_they_are_drawn(tmp_path, vary, within):
    (note,) = said(tmp_path, vary)
    assert f"keep it within {within}" in note


def test_what_stays_inside_or_may_leave_is_not_told(tmp_path):
    assert said(tmp_path, "{family.radius: 0.1 mm}", low="4.1 mm", high="5.4 mm") == []
    assert said(tmp_path, "{family.radius: 0.1 mm}", extrapolate="yes") == []
    assert said(tmp_path, "{task.pressure: 5 kPa}") == []


def test_a_key_that_is_no_variable_counts_by_the_studys_value_and_its_conditions(tmp_path):
    conditions = "conditions: {short: {family.length: 8.05 mm}, long: {family.length: 9 mm}}"
    assert said(tmp_path, "{family.length: 0.1 mm}", low="4.1 mm") == []
    (note,) = said(tmp_path, "{family.length: 0.1 mm}", more=conditions)
    assert "family.length, 8.05 mm to 9 mm, comes to 7.95 mm to 9.1 mm" in note


def test_where_no_candidate_stays_inside_the_search_does_not_begin(tmp_path):
    with pytest.raises(UserError, match=r"family\.length, 8\.6 mm, comes to 7\.1 mm .* tolerance smaller"):
        said(tmp_path, "{family.length: 1.5 mm}")


@pytest.mark.parametrize(
    ("vary", "sentence"), [("{task.pressure: 5 mm}", "a pressure"), ("{family.defect: 1}", "decimals")]
)
def test_what_cannot_be_varied_is_said_before_the_nominal_search(tmp_path, vary, sentence):
    more = f"robust: {{samples: 2, vary: {vary}}}\nbudget: 1\nverify: null"
    one, _ = bench.springs(tmp_path, SEARCH.format(low="4.2 mm", high="5 mm", more=more))
    with pytest.raises(UserError, match=sentence):
        search_study(one.context, one.study, workers=1)
    assert not list(one.context.store.root.glob("search/*"))


@pytest.mark.slow
def test_a_search_notes_it_once(tmp_path):
    pytest.importorskip("cma")
    watched = Watched()
    more = "robust: {samples: 2, laws: false, vary: {family.radius: 0.1 mm}}\nbudget: 1\nverify: null"
    one, _ = bench.springs(tmp_path, SEARCH.format(low="4 mm", high="5 mm", more=more))
    object.__setattr__(one.context, "progress", watched)
    search_study(one.context, one.study, workers=1)
    assert [note for note in watched.notes if "tolerance" in note] == [watched.notes[0]]
    assert "keep it within 4.1 mm to 5 mm" in watched.notes[0]
