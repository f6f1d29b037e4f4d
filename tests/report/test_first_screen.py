"""The first screen of a page answers four questions; the sections below are folded, and printing opens them."""

import re

import numpy as np
import pytest
from tests.report.pages import check_sound
from tests.report.test_comparison_page import bench, falling_shift, page_html

from pliant.report.chart import robust_ends
from pliant.report.comparison_charts import beyond_notes
from pliant.report.document import Document, Section, Table, Warned, answers, drawn
from pliant.report.render import page

LABELS = ["How good", "What is missing", "How sure", "What next"]


def folded(html):
    """Return titles of the sections, and whether each is open."""
    every = re.findall(r"<section>\s*<details( open)?><summary><h2>(.*?)</h2></summary>", html)
    assert len(every) == html.count("<section")
    return {title: bool(is_open) for is_open, title in every}


def labels_before_the_picture(html):
    return re.findall(r"<dt>(.*?)</dt><dd>.+?</dd>", html.split("<img")[0])


@pytest.mark.slow
def test_a_comparison_answers_four_questions_before_its_first_picture():
    made = page_html(*bench(0, effect=falling_shift(0.02)))
    assert labels_before_the_picture(made.html) == LABELS
    sections = folded(made.html)
    assert sections["Where the error is"] and not sections["Numbers"]
    assert "falling pressure: 8" in check_sound(made).lower()


def test_sections_are_reached_from_the_navigation_and_opened_by_printing():
    table = Table("t", ["a"], [["b"]])
    both = (Section("One", tables=(table,), open=True), Section("Two", tables=(table,)))
    html = page(
        Document("k", "t", "s.", answers=answers("good"), points=("p.",), draw=lambda: drawn(None, *both))
    ).html
    assert folded(html) == {"In more words": False, "One": True, "Two": False}
    assert re.findall(r'<a href="#(s\d)">', html) == re.findall(r'<div id="(s\d)">', html) == ["s1", "s2"]
    assert "::details-content" in html.split("@media print")[1]


def test_many_warnings_are_folded_after_the_gravest():
    html = page(Document("k", "t", "s.", warnings=tuple(Warned(f"Number {k}.") for k in range(9)))).html
    before, after = html.split("<details><summary>4 more</summary>")
    assert "Number 4." in before and "Number 5." in after


@pytest.mark.parametrize("far", [60.0, -60.0])
def test_a_step_does_not_squeeze_the_rate_panel_and_is_marked(far):
    values = np.concatenate([np.linspace(-1.0, 1.0, 200), [far, far / 2]])
    low, high = robust_ends(values)
    assert -1.5 < low < -0.8 and 0.8 < high < 1.5
    (note,) = beyond_notes((low, high), values)
    assert "2 beyond, to" in note.text and "60" in note.text


@pytest.mark.parametrize("values", [np.linspace(-3, 3, 50), np.ones(9), np.zeros(0), np.array([0.0, 60.0])])
def test_values_that_nothing_squeezes_keep_their_axis(values):
    assert robust_ends(values) is None
