"""Pages about counts answer the four questions of the first screen, whatever the verdict."""

import numpy as np
import pytest
from tests.pliant_counts.test_counts_comparison import make_counts
from tests.pliant_counts.test_counts_diagnosis import counted, draw_sets, scan, shares
from tests.report.pages import check_sound
from tests.report.test_first_screen import LABELS, labels_before_the_picture

from pliant.registry.discovery import discover
from pliant.report.render import page, terminal
from pliant_counts.comparison import compare_counts
from pliant_counts.comparison_page import counts_document
from pliant_counts.diagnosis_page import counts_diagnosis_document
from pliant_counts.evidence import weighed
from pliant_counts.records import Counts
from pliant_counts.verdict import judge_counts


def document_answers(document):
    made = page(document)
    assert labels_before_the_picture(made.html) == LABELS
    check_sound(made)
    return dict(document.answers)


def compared(conditions, simulated):
    counts = make_counts(*conditions)
    return counts_document("gripper", counts, compare_counts(counts, simulated))


def test_a_comparison_says_which_conditions_are_wrong_and_which_way():
    said = document_answers(compared([[10, 9, 10], [0, 0, 0], [6, 7, 6]], [(0, 10), (0, 10), (6, 10)]))
    assert "1 of 3 conditions differs by more than chance" in said["How good"]
    assert said["What is missing"].startswith("The bench succeeds more often: 0 weights (29/30, model 0/10)")
    assert "90 trials counted, 10 simulated" in said["How sure"] and "agree" in said["How sure"]
    assert "pliant diagnose" in said["What next"]


def test_a_right_model_and_contradictory_repeats_ask_for_other_things():
    right = document_answers(compared([[5, 5], [9, 10]], [(3, 8), (7, 8)]))
    assert (
        right["What is missing"] == "Nothing that these counts show" and "diagnose" not in right["What next"]
    )
    odd = document_answers(compared([[10, 0, 5], [10, 10, 10]], [(5, 10), (10, 10)]))
    assert "contradict" in odd["How sure"] and "differed" in odd["What next"]


FOUND = {
    "missing_effect": lambda: scan(draw_sets(1.0, np.random.default_rng(0))),
    "nothing_missing": lambda: scan([[round(10 * p)] * 3 for p in shares(0.8)]),
    "unknown_effect": lambda: scan([[round(10 * p)] * 3 for p in 1.0 - shares(0.8)]),
    "not_repeatable": lambda: scan([[10, 0, 10], *draw_sets(0.9, np.random.default_rng(0))[1:]]),
    "insufficient_data": lambda: weighed(counted([[9], [0]]), [((), ())], [((12, 12), (0, 12))]),
    "ambiguous": lambda: next(
        found
        for seed in range(20)
        if judge_counts(found := scan(draw_sets(0.9, np.random.default_rng(seed)))).verdict == "ambiguous"
    ),
}


def diagnosed(verdict):
    found = FOUND[verdict]()
    judged = judge_counts(found)
    assert judged.verdict == verdict
    counts = Counts(tuple(one.condition for one in found.comparison.conditions))
    return judged, counts_diagnosis_document("gripper", counts, found, judged, discover())


@pytest.mark.parametrize("verdict", FOUND)
def test_every_verdict_answers_the_four_questions(verdict):
    judged, document = diagnosed(verdict)
    said = document_answers(document)
    if verdict == "missing_effect":
        assert said["What is missing"] == "Most likely task.friction 1" and " %; " in said["How sure"]
    if judged.next_count is not None and verdict != "not_repeatable":
        assert judged.next_count.condition in said["What next"]
    table = document.brief[0]
    assert [row[0] for row in table.rows][:1] and "explanations" in table.note
    assert any(table.note in str(getattr(block, "note", block)) for block in terminal(document, False))
